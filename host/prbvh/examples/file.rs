//! A scene file to a `tree.bvh` beside it; needs the cargo feature `files`.

use prbvh::bvh::file;
use prbvh::device::{self, DeviceChoice};
use prbvh::pipeline::{self, Settings};
use prbvh::scene;
use std::ops::ControlFlow;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = PathBuf::from(std::env::args_os().nth(1).ok_or("which scene file?")?);
    let scene = scene::load(&path)?;
    let mut device = device::open(DeviceChoice::Auto, 0, false)?;
    let done = pipeline::optimize(&scene, &mut *device, &Settings::default(), &mut |_| ControlFlow::Continue(()))?;
    let out = path.with_extension("bvh");
    file::write(&out, &done.tree, &scene.hash)?;
    println!("{}: SAH cost {:.2}", out.display(), done.quality.sah_cost);
    Ok(())
}
