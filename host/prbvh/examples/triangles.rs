//! Triangles in memory to a good tree over them.

use prbvh::{DeviceChoice, Scene, Settings, Triangle};
use std::ops::ControlFlow;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A strip of triangles: yours come from your meshes.
    let triangles = (0..1000).map(|k| {
        let x = k as f32;
        Triangle { a: [x, 0.0, 0.0], b: [x + 1.0, 0.0, (0.1 * x).sin()], c: [x, 1.0, 0.0] }
    });
    let scene = Scene::from_triangles("strip", triangles.collect())?;

    // A GPU if there is one, else all cores.
    let mut device = prbvh::open_device(DeviceChoice::Auto, 0, false)?;
    let done = prbvh::optimize(&scene, &mut *device, &Settings::default(), &mut |row| {
        println!("iteration {}: cost {:.2}", row.iteration, row.cost);
        ControlFlow::Continue(())
    })?;
    println!(
        "{} nodes, SAH cost {:.2} instead of {:.2}",
        done.tree.nodes.len(),
        done.quality.sah_cost,
        done.initial.sah_cost
    );
    Ok(())
}

#[test]
fn it_runs() {
    main().unwrap();
}
