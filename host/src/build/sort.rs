//! Recording of the stable radix sort.

use super::Scratch;
use super::scan::Scanner;
use crate::device::{Buffer, Device, DeviceError, Recording};
use prbvh_kernel::Kernel;
use prbvh_kernel::sort::{DIGIT_BITS, DIGITS, SortParams};

/// Buffers of a sort of `pairs` pairs, used again by every sort of that size.
#[derive(Debug)]
pub(super) struct Sorter {
    pairs: u32,
    chunk: u32,
    keys: Buffer,
    values: Buffer,
    table: Buffer,
    scanner: Scanner,
}

impl Sorter {
    pub(super) fn new(scratch: &mut Scratch, device: &mut dyn Device, pairs: u32) -> Result<Self, DeviceError> {
        let length = pairs as usize;
        let chunk = pairs.div_ceil(device.info().busy_invocations.max(1)).max(256);
        let table = pairs.div_ceil(chunk) as usize * DIGITS;
        Ok(Self {
            pairs,
            chunk,
            keys: scratch.allocate(device, "sort keys", length, 4)?,
            values: scratch.allocate(device, "sort values", length, 4)?,
            table: scratch.allocate(device, "sort table", table, 4)?,
            scanner: Scanner::new(scratch, device, table)?,
        })
    }

    /// Scratch of one word per pair, free between sorts.
    pub(super) fn spare_words(&self) -> &Buffer {
        &self.keys
    }

    /// Sorts `keys`, of which no bit from `bits` on is set, and moves `values` along, both in place.
    pub(super) fn record(&self, recording: &mut Recording, keys: &Buffer, values: &Buffer, bits: u32) {
        let chunks = self.pairs.div_ceil(self.chunk);
        let words = chunks * DIGITS as u32;
        let mut from = (keys, values);
        let mut to = (&self.keys, &self.values);
        // An even number of passes, so that the result lies where the input was.
        for pass in 0..bits.div_ceil(DIGIT_BITS).next_multiple_of(2) {
            let params = SortParams { count: chunks, pairs: self.pairs, chunk: self.chunk, shift: pass * DIGIT_BITS };
            recording.dispatch("sort", Kernel::SortCount, chunks, &params, &[from.0, &self.table]);
            self.scanner.record(recording, "sort", &self.table, words);
            let buffers = [from.0, from.1, &self.table, to.0, to.1];
            recording.dispatch("sort", Kernel::SortScatter, chunks, &params, &buffers);
            std::mem::swap(&mut from, &mut to);
        }
    }
}
