//! Trees that contend for the place of a [top](super::new_top), made and optimised by the CPU whatever the device.
//!
//! They are small, and each of their rounds waits for the one before. A GPU takes a microsecond for a step of the longest search of a round, and some to begin each dispatch; a CPU
//! has done the whole round in about that time, and nobody waits for a submission. All devices make the same bits.

use super::areas::measure_unchecked;
use super::run::Run;
use super::search::Search;
use super::{PrbvhSettings, StopReason};
use crate::build::{self, CodeCensus, DeviceTree, MortonBits};
use crate::device::cpu::CpuDevice;
use crate::device::{Device, DeviceError, on_host};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use std::ops::ControlFlow;
use std::time::Instant;

/// A tree that is optimised.
#[derive(Debug)]
pub(super) struct Contender {
    pub(super) nodes: Vec<Node>,
    /// Nodes that the searches looked at.
    pub(super) visits: u32,
}

/// From an LBVH and from a tree by binned SAH, on the threads that the device lends: that the two differ is the point of them. Their searches end by `until`.
pub(super) fn contenders(
    device: &dyn Device,
    triangles: &[Triangle],
    settings: &PrbvhSettings,
    until: Option<Instant>,
) -> Result<[Contender; 2], DeviceError> {
    let from = |begin: Begin| optimised(begin, triangles, settings.clone(), until);
    let (lbvh, binned) = on_host(device, || rayon::join(|| from(lbvh), || from(binned)));
    Ok([lbvh?, binned?])
}

/// Makes a tree to begin with.
type Begin = fn(&mut CpuDevice, &[Triangle]) -> Result<DeviceTree, DeviceError>;

fn lbvh(device: &mut CpuDevice, triangles: &[Triangle]) -> Result<DeviceTree, DeviceError> {
    let all = triangles.iter().fold(Aabb::EMPTY, |all, triangle| all.union(triangle.aabb()));
    let codes = CodeCensus::of(triangles, all.min, all.max).enough(MortonBits::default());
    Ok(build::lbvh(device, triangles, codes)?.0)
}

fn binned(device: &mut CpuDevice, triangles: &[Triangle]) -> Result<DeviceTree, DeviceError> {
    DeviceTree::upload(device, &build::sah_binned(triangles))
}

/// Worst first, without new tops.
fn optimised(
    begin: Begin,
    triangles: &[Triangle],
    mut settings: PrbvhSettings,
    until: Option<Instant>,
) -> Result<Contender, DeviceError> {
    let device = &mut CpuDevice::in_this_pool();
    let tree = begin(device, triangles)?;
    let (areas, _) = measure_unchecked(device, &tree)?;
    settings.limits.max_time = until.map(|until| until.saturating_duration_since(Instant::now()));
    let mut run = Run::begin(device, &tree, Some(areas), &settings)?;
    let internal = run.session.internal;
    let tail = Search::tail(&settings.worst_first, internal);
    let mut stop = None;
    for search in std::iter::once(Search::worst(&settings.worst_first, internal)).chain(tail) {
        if stop.is_none() {
            stop = run.search(device, &mut |_, _, _| ControlFlow::Continue(()), search)?;
        }
    }
    let outcome = run.finish(device, stop.unwrap_or(StopReason::Converged))?;
    let visits = outcome.rows.iter().fold(0u32, |visits, row| visits.saturating_add(row.visits));
    Ok(Contender { nodes: tree.download(device)?, visits })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimize::Limits;
    use crate::scene::built_in;
    use crate::stop::Stop;

    #[test]
    fn they_end_when_the_run_does() {
        let triangles = built_in(2000).triangles;
        let device = CpuDevice::new(2).unwrap();
        let visits = |settings: &PrbvhSettings, until| {
            contenders(&device, &triangles, settings, until).unwrap().map(|contender| {
                assert_eq!(contender.nodes.len(), 2 * triangles.len() - 1);
                contender.visits
            })
        };
        let settings = PrbvhSettings::default();
        assert!(visits(&settings, None).iter().all(|&visits| visits > 1000));
        assert_eq!(visits(&settings, Some(Instant::now())), [0; 2]);
        let stop = Stop::default();
        stop.ask();
        let limits = Limits { stop: Some(stop), ..Limits::iterations(1000) };
        assert_eq!(visits(&PrbvhSettings { limits, ..settings }, None), [0; 2]);
    }
}
