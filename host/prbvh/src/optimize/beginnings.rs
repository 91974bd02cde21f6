//! Trees to begin with over the leaves of a [top](super::new_top), made by the CPU whatever the device.
//!
//! A GPU takes longer to begin the dispatches of such a build than a CPU to do their work, and its host would wait for it three times. All devices make the same bits.

use super::areas::{TreeAreas, measure_unchecked};
use crate::build::{self, CodeCensus, DeviceTree, MortonBits};
use crate::device::cpu::CpuDevice;
use crate::device::{Device, DeviceError, on_host};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;

/// A tree that is made and measured.
#[derive(Debug)]
pub(super) struct Beginning {
    pub(super) nodes: Vec<Node>,
    pub(super) areas: TreeAreas,
}

/// An LBVH and a tree by binned SAH: that these differ is the point of them. Each on a thread that the device lends.
pub(super) fn beginnings(device: &dyn Device, triangles: &[Triangle]) -> Result<[Beginning; 2], DeviceError> {
    let (lbvh, binned) = on_host(device, || rayon::join(|| lbvh(triangles), || binned(triangles)));
    Ok([lbvh?, binned?])
}

fn lbvh(triangles: &[Triangle]) -> Result<Beginning, DeviceError> {
    let all = triangles.iter().fold(Aabb::EMPTY, |all, triangle| all.union(triangle.aabb()));
    let codes = CodeCensus::of(triangles, all.min, all.max).enough(MortonBits::default());
    let device = &mut CpuDevice::on_this_thread();
    let (tree, _) = build::lbvh(device, triangles, codes)?;
    let (areas, _) = measure_unchecked(device, &tree)?;
    Ok(Beginning { nodes: tree.download(device)?, areas })
}

fn binned(triangles: &[Triangle]) -> Result<Beginning, DeviceError> {
    let nodes = build::sah_binned(triangles);
    let device = &mut CpuDevice::on_this_thread();
    let tree = DeviceTree::upload(device, &nodes)?;
    let (areas, _) = measure_unchecked(device, &tree)?;
    Ok(Beginning { nodes, areas })
}
