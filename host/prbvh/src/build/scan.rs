//! Recording of an exclusive scan.

use super::Scratch;
use crate::device::{Buffer, Device, DeviceError, Recording};
use prbvh_kernel::Kernel;
use prbvh_kernel::sort::{SCAN_CHUNK, ScanParams};

/// Sums of chunks, sums of chunks of these, and so on, until one invocation can scan what is left. Used again by every scan of at most
/// so many words.
#[derive(Debug)]
pub(crate) struct Scanner {
    levels: Vec<Buffer>,
}

impl Scanner {
    pub(crate) fn new(scratch: &mut Scratch, device: &mut dyn Device, words: usize) -> Result<Self, DeviceError> {
        let mut levels = Vec::new();
        let mut length = words;
        loop {
            length = length.div_ceil(SCAN_CHUNK as usize).max(1);
            levels.push(scratch.allocate(device, "scan sums", length, 4)?);
            if length <= SCAN_CHUNK as usize {
                return Ok(Self { levels });
            }
        }
    }

    /// Turns the first `count` of `words` into their exclusive scan.
    pub(crate) fn record(&self, recording: &mut Recording, label: &'static str, words: &Buffer, count: u32) {
        let mut scanned = Vec::new();
        let mut level = (words, count);
        for sums in &self.levels {
            let params = ScanParams { count: level.1.div_ceil(SCAN_CHUNK), words: level.1 };
            recording.dispatch(label, Kernel::ScanSums, params.count, &params, &[level.0, sums]);
            scanned.push((params, sums, level.0));
            level = (sums, params.count);
            if params.count <= SCAN_CHUNK {
                break;
            }
        }
        let spine = ScanParams { count: 1, words: level.1 };
        recording.dispatch(label, Kernel::ScanSpine, 1, &spine, &[level.0]);
        for (params, sums, words) in scanned.into_iter().rev() {
            recording.dispatch(label, Kernel::ScanApply, params.count, &params, &[sums, words]);
        }
    }
}
