//! Which kernels search, on which kind of device.

use super::moves::Strategy;
use crate::build::Scratch;
use crate::device::{Buffer, Device, DeviceError, DeviceInfo, DeviceKind, Recording};
use prbvh_kernel::Kernel;
use prbvh_kernel::prbvh::PrbvhParams;
use prbvh_kernel::prbvh::walk::WalkParams;

/// How input nodes are searched. Both ways find the same, bit for bit.
#[derive(Debug)]
pub(super) enum Searching {
    /// An invocation for each ([`prbvh_kernel::prbvh::search`]).
    Alone,
    /// Lanes that take one after another ([`prbvh_kernel::prbvh::walk`]).
    InLanes {
        /// How many are taken.
        taken: Buffer,
    },
}

/// Whether lanes are faster than an invocation for each node, as measured in `docs/performance.md`, and the device has the 64-bit words that
/// they load.
fn is_in_lanes(device: &DeviceInfo) -> bool {
    device.kind == DeviceKind::VulkanCpu && device.atomics_64
}

/// The kernels that search the nodes on a list.
pub(crate) fn kernels_of_list(device: &DeviceInfo, strategy: Strategy) -> &'static [Kernel] {
    match (is_in_lanes(device), strategy) {
        (false, Strategy::Aggressive) => &[Kernel::PrbvhSearchCandidates],
        (false, Strategy::Conservative) => &[Kernel::PrbvhSearchTopCandidates],
        (true, Strategy::Aggressive) => &[Kernel::PrbvhListCandidates, Kernel::PrbvhWalk, Kernel::PrbvhConfirm],
        (true, Strategy::Conservative) => &[Kernel::PrbvhListCandidates, Kernel::PrbvhWalk, Kernel::PrbvhConfirmTop],
    }
}

impl Searching {
    pub(super) fn new(device: &mut dyn Device, scratch: &mut Scratch) -> Result<Self, DeviceError> {
        Ok(if is_in_lanes(device.info()) {
            Self::InLanes { taken: scratch.allocate(device, "taken", 1, 4)? }
        } else {
            Self::Alone
        })
    }

    /// Records the search of every node or of those on a list; `tops` gets the children of the pivots above the outputs, if it is there.
    #[allow(clippy::too_many_arguments, reason = "the buffers of a search")]
    pub(super) fn record(
        &self,
        recording: &mut Recording,
        params: &PrbvhParams,
        candidates: Option<&Buffer>,
        nodes: &Buffer,
        found: &Buffer,
        tops: Option<&Buffer>,
        report: &Buffer,
    ) {
        let dispatch = |recording: &mut Recording, kernel, buffers: &[Option<&Buffer>]| {
            let buffers: Vec<&Buffer> = buffers.iter().copied().flatten().collect();
            recording.dispatch("search", kernel, params.count, params, &buffers);
        };
        match self {
            Self::Alone => {
                let kernel = match (candidates, tops) {
                    (None, None) => Kernel::PrbvhSearch,
                    (None, Some(_)) => Kernel::PrbvhSearchTop,
                    (Some(_), None) => Kernel::PrbvhSearchCandidates,
                    (Some(_), Some(_)) => Kernel::PrbvhSearchTopCandidates,
                };
                dispatch(recording, kernel, &[Some(nodes), candidates, Some(found), tops, Some(report)]);
            }
            Self::InLanes { taken } => {
                let list = if candidates.is_some() { Kernel::PrbvhListCandidates } else { Kernel::PrbvhList };
                dispatch(recording, list, &[Some(nodes), candidates, Some(found)]);
                recording.clear("search", taken);
                let walk = WalkParams::of(params);
                recording.dispatch("search", Kernel::PrbvhWalk, walk.count, &walk, &[nodes, found, taken, report]);
                let confirm = if tops.is_some() { Kernel::PrbvhConfirmTop } else { Kernel::PrbvhConfirm };
                dispatch(recording, confirm, &[Some(nodes), Some(found), tops, Some(report)]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Command;
    use crate::device::cpu::CpuDevice;

    fn buffer(label: &'static str, element_bytes: usize) -> Buffer {
        Buffer { id: 0, label, length: 8, element_bytes }
    }

    #[test]
    fn the_kernels_of_a_list_are_those_that_run() {
        let mut info = CpuDevice::new(1).unwrap().info().clone();
        let (nodes, list, found) = (buffer("nodes", 32), buffer("list", 4), buffer("found", 12));
        let (tops, report) = (buffer("tops", 4), buffer("report", 4));
        let params = PrbvhParams::every(1, 0, 8);
        for (kind, searching) in [
            (DeviceKind::Cpu, Searching::Alone),
            (DeviceKind::VulkanGpu, Searching::Alone),
            (DeviceKind::VulkanCpu, Searching::InLanes { taken: buffer("taken", 4) }),
        ] {
            (info.kind, info.atomics_64) = (kind, false);
            assert!(!is_in_lanes(&info));
            info.atomics_64 = true;
            assert_eq!(is_in_lanes(&info), matches!(searching, Searching::InLanes { .. }));
            for (strategy, tops) in [(Strategy::Aggressive, None), (Strategy::Conservative, Some(&tops))] {
                let mut recording = Recording::new();
                searching.record(&mut recording, &params, Some(&list), &nodes, &found, tops, &report);
                let kernels: Vec<Kernel> = recording
                    .commands()
                    .iter()
                    .filter_map(|(_, command)| match command {
                        Command::Dispatch(dispatch) => Some(dispatch.kernel),
                        _ => None,
                    })
                    .collect();
                assert_eq!(kernels, kernels_of_list(&info, strategy));
            }
        }
    }
}
