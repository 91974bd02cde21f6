//! A scene file to a `tree.bvh` beside it; needs the cargo feature `files`.

use prbvh::bvh::file;
use prbvh::{DeviceChoice, Settings, scene};
use std::ops::ControlFlow;
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args_os().nth(1).ok_or("which scene file?")?;
    optimize(path.as_ref())
}

fn optimize(path: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let scene = scene::load(path)?;
    let mut device = prbvh::open_device(DeviceChoice::Auto, 0, false)?;
    let done = prbvh::optimize(&scene, &mut *device, &Settings::default(), &mut |_| ControlFlow::Continue(()))?;
    let out = path.with_extension("bvh");
    file::write(&out, &done.tree, &scene.hash)?;
    println!("{}: SAH cost {:.2}", out.display(), done.quality.sah_cost);
    Ok(())
}

#[test]
fn the_tree_lies_beside_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.obj");
    std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nf 1 2 3\nf 2 3 4\n").unwrap();
    optimize(&path).unwrap();
    assert_eq!(file::read(&folder.path().join("scene.bvh")).unwrap().tree.triangle_order.len(), 2);
    std::fs::write(&path, "f 1 2 3\n").unwrap();
    assert!(optimize(&path).unwrap_err().to_string().contains("scene.obj"));
}
