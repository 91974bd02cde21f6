//! Boxes in memory to a good tree over them: particles, instances, whatever has a box.

use prbvh::bvh::Content;
use prbvh::device::cpu::CpuDevice;
use prbvh::pipeline::{self, Settings};
use prbvh::scene::{Aabb, Scene};
use std::ops::ControlFlow;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Particles on a spiral; yours come from your scene.
    let particles: Vec<Aabb> = (0..10_000)
        .map(|k| {
            let (angle, height) = (0.1 * k as f32, 1e-3 * k as f32);
            let centre = [angle.cos() * (1.0 + height), height, angle.sin() * (1.0 + height)];
            Aabb { min: centre.map(|x| x - 0.01), max: centre.map(|x| x + 0.01) }
        })
        .collect();
    let scene = Scene::from_boxes("particles", &particles)?;
    let mut device = CpuDevice::new(0)?;
    let done = pipeline::optimize(&scene, &mut device, &Settings::default(), &mut |_| ControlFlow::Continue(()))?;

    // Leaves hold the numbers of your boxes.
    let leaf = done.tree.nodes.iter().find_map(|node| match node.content {
        Content::Leaf { first, .. } => Some(done.tree.triangle_order[first as usize]),
        Content::Internal { .. } => None,
    });
    println!("SAH cost {:.2} instead of {:.2}", done.quality.sah_cost, done.initial.sah_cost);
    println!("the first leaf holds box {}", leaf.ok_or("no leaf")?);
    Ok(())
}

#[test]
fn it_runs() {
    main().unwrap();
}
