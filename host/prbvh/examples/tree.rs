//! A tree that you have, made better in place: here one with leaves of up to four triangles that stands for one of another library.

use prbvh::bvh::{self, Bvh};
use prbvh::collapse::CollapseSettings;
use prbvh::device::cpu::CpuDevice;
use prbvh::pipeline::{self, Initial, Leaves, Optimizer, Settings};
use prbvh::scene::{self, Scene};
use std::ops::ControlFlow;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = scene::built_in(10_000);
    let mut device = CpuDevice::new(0)?;
    let mut tree = yours(&scene, &mut device)?;

    // Your leaves stay what they are, and nothing needs to be known of what is in them.
    let go_on = &mut |_: &_| ControlFlow::Continue(());
    let whole = pipeline::optimize_tree(&mut tree, Leaves::Whole, &mut device, &Settings::default(), go_on)?;
    println!("leaves whole: SAH cost {:.2} instead of {:.2}", whole.quality.sah_cost, whole.initial.sah_cost);

    // Or leaves are made anew, too, by the boxes of the primitives.
    let boxes = scene.boxes();
    let split = pipeline::optimize_tree(&mut tree, Leaves::Split(&boxes), &mut device, &Settings::default(), go_on)?;
    println!("leaves made anew: {:.2}, {} leaves", split.quality.sah_cost, split.quality.leaves);

    bvh::validate(&tree, Some(&scene.triangles)).map_err(|faults| bvh::summary(&faults))?;
    Ok(())
}

fn yours(scene: &Scene, device: &mut CpuDevice) -> Result<Bvh, Box<dyn std::error::Error>> {
    let settings = Settings::default().with(|settings| {
        settings.initial = Initial::Lbvh;
        settings.optimizer = Optimizer::None;
        settings.adaptive = Some(CollapseSettings::default().with(|leaves| leaves.max_leaf = Some(4)));
    });
    Ok(pipeline::optimize(scene, device, &settings, &mut |_| ControlFlow::Continue(()))?.tree)
}

#[test]
fn it_runs() {
    main().unwrap();
}
