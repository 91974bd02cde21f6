//! A tree that you have, made better: here an LBVH that stands for one of another library.

use prbvh::build::{DeviceTree, MortonBits, lbvh};
use prbvh::bvh::{self, Bvh, SahModel};
use prbvh::device::cpu::CpuDevice;
use prbvh::optimize::{PrbvhSettings, prbvh};
use prbvh::scene;
use std::ops::ControlFlow;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = scene::built_in(10_000);
    let mut device = CpuDevice::new(0)?;
    let yours = {
        let (tree, _) = lbvh(&mut device, &scene.triangles, MortonBits::default())?;
        let nodes = tree.download(&mut device)?;
        tree.free(&mut device);
        Bvh::from_device(&nodes).map_err(|faults| bvh::summary(&faults))?
    };

    // One triangle per leaf; coordinates of a scene that is neither tiny nor huge (see `scene::SafeRange`).
    let tree = DeviceTree::upload(&mut device, &yours.to_device()?)?;
    prbvh(&mut device, &tree, &PrbvhSettings::default(), &mut |_, _, _| ControlFlow::Continue(()))?;
    let nodes = tree.download(&mut device)?;
    tree.free(&mut device);

    let better = Bvh::from_device(&nodes).map_err(|faults| bvh::summary(&faults))?;
    bvh::validate(&better, Some(&scene.triangles)).map_err(|faults| bvh::summary(&faults))?;
    let cost = |tree| bvh::quality(tree, &SahModel::default()).sah_cost;
    println!("SAH cost {:.2} instead of {:.2}", cost(&better), cost(&yours));
    Ok(())
}

#[test]
fn it_runs() {
    main().unwrap();
}
