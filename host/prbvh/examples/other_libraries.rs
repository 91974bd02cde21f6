//! A tree of another library measured, and a tree of ours handed to it; needs the cargo feature `obvhs`.

use obvhs::BvhBuildParams;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::triangle::Triangle;
use prbvh::bvh::{self, SahModel};
use prbvh::device::cpu::CpuDevice;
use prbvh::interop::obvhs::{from_bvh2, to_bvh2};
use prbvh::pipeline::{self, Settings};
use prbvh::scene::built_in;
use std::ops::ControlFlow;
use std::time::Duration;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = built_in(5_000);
    let theirs: Vec<Triangle> =
        scene.triangles.iter().map(|t| Triangle { v0: t.a.into(), v1: t.b.into(), v2: t.c.into() }).collect();
    let params = BvhBuildParams { pre_split: false, ..BvhBuildParams::medium_build() };
    let tree = build_bvh2_from_tris(&theirs, params, &mut Duration::default());

    // In: leaves may hold several triangles.
    let ours = from_bvh2(&tree).map_err(|faults| bvh::summary(&faults))?;
    bvh::validate(&ours, Some(&scene.triangles)).map_err(|faults| bvh::summary(&faults))?;
    let before = bvh::quality(&ours, &SahModel::default()).sah_cost;

    // Out: their validator takes it, and their traversal can.
    let mut device = CpuDevice::new(0)?;
    let done = pipeline::optimize(&scene, &mut device, &Settings::default(), &mut |_| ControlFlow::Continue(()))?;
    to_bvh2(&done.tree).validate(&theirs, false, true);
    println!("SAH cost {:.2} of theirs, {:.2} of ours", before, done.quality.sah_cost);
    Ok(())
}
