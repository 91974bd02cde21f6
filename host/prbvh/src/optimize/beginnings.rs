//! Trees to begin with over the leaves of a [top](super::new_top), made by the CPU whatever the device.
//!
//! A GPU takes longer to begin the dispatches of such a build than a CPU to do their work, and its host would wait for it three times. All devices make the same bits.

use super::areas::{Measure, TreeAreas};
use super::session::no_fault;
use crate::build::{self, CodeCensus, DeviceTree, MortonBits, Scratch};
use crate::device::cpu::CpuDevice;
use crate::device::{Device, DeviceError, on_host};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::status::{FAULTS, REPORT_WORDS};

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
    measured(device, &tree)
}

fn binned(triangles: &[Triangle]) -> Result<Beginning, DeviceError> {
    let device = &mut CpuDevice::on_this_thread();
    let tree = DeviceTree::upload(device, &build::sah_binned(triangles))?;
    measured(device, &tree)
}

/// With the boxes that a refit makes.
fn measured(device: &mut dyn Device, tree: &DeviceTree) -> Result<Beginning, DeviceError> {
    let mut scratch = Scratch::default();
    let report = scratch.allocate(device, "report", REPORT_WORDS as usize, 4)?;
    let (areas, _) = Measure::new(device, &mut scratch, tree, &report)?.refitted_areas(device)?;
    let mut words = [0u32; REPORT_WORDS as usize];
    device.download(&report, bytemuck::cast_slice_mut(&mut words))?;
    no_fault(device, words[FAULTS])?;
    Ok(Beginning { nodes: tree.download(device)?, areas })
}
