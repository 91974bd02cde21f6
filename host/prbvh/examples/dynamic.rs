//! A scene in motion: its tree follows it, refitted in each frame and made a little better.

use prbvh::device::{self, DeviceChoice};
use prbvh::optimize::{Budget, Reoptimizer};
use prbvh::pipeline::{self, Settings};
use prbvh::scene::{self, Triangle};
use std::ops::ControlFlow;
use std::time::Duration;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = scene::built_in(10_000);
    let mut device = device::open(DeviceChoice::Auto, 0, false)?;
    let built = pipeline::optimize(&scene, &mut *device, &Settings::default(), &mut |_| ControlFlow::Continue(()))?;

    // It owns the device from here on; the tree stays in a buffer of it.
    let mut moving = Reoptimizer::new(device, &built.tree, &scene.triangles)?;
    for frame in 1..=30 {
        let sway = |p: [f32; 3]| [p[0] + 0.02 * frame as f32 * p[1].sin(), p[1], p[2]];
        let triangles: Vec<Triangle> =
            scene.triangles.iter().map(|t| Triangle { a: sway(t.a), b: sway(t.b), c: sway(t.c) }).collect();
        moving.refit(&triangles)?;
        let refitted = moving.cost()?;
        let step = moving.step(Budget::Time(Duration::from_millis(1)))?;
        if frame % 10 == 0 {
            println!("frame {frame}: SAH cost {:.2} instead of {refitted:.2}, {} moves", moving.cost()?, step.applied);
        }
    }

    // What comes and goes.
    let new = moving.insert(&scene.triangles[..10])?;
    moving.remove(&[0, 1, new.start])?;
    println!("{} triangles in {} nodes", moving.primitives(), moving.tree()?.nodes.len());
    Ok(())
}

#[test]
fn it_runs() {
    main().unwrap();
}
