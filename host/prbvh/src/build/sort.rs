//! Recording of the stable radix sort.

use super::Scratch;
use crate::device::{Buffer, Device, DeviceError, DeviceInfo, DeviceKind, Recording};
use prbvh_kernel::sort::{DIGIT_BITS, DIGITS, SortParams};
use prbvh_kernel::{Kernel, grid};

/// Fewest pairs of a chunk: fewer, and the table of digits is longer than the pairs.
const FEWEST: u32 = 512;

/// Most pairs of a chunk: one invocation may take them one after another, and no loop of a kernel may be long.
const MOST: u32 = 1 << 15;

/// Buffers of a sort of `pairs` pairs, used again by every sort of that size.
#[derive(Debug)]
pub(super) struct Sorter {
    pairs: u32,
    chunk: u32,
    kernels: [Kernel; 3],
    keys: Buffer,
    values: Buffer,
    table: Buffer,
    totals: Buffer,
}

impl Sorter {
    pub(super) fn new(scratch: &mut Scratch, device: &mut dyn Device, pairs: u32) -> Result<Self, DeviceError> {
        let length = pairs as usize;
        let info = device.info();
        let kernels = kernels(info);
        let chunks =
            if kernels.contains(&Kernel::SortScatterAlone) { info.busy_invocations } else { info.busy_workgroups() };
        let chunk = pairs.div_ceil(chunks.max(1)).clamp(FEWEST, MOST);
        let table = pairs.div_ceil(chunk) as usize * DIGITS;
        Ok(Self {
            pairs,
            chunk,
            kernels,
            keys: scratch.allocate(device, "sort keys", length, 4)?,
            values: scratch.allocate(device, "sort values", length, 4)?,
            table: scratch.allocate(device, "sort table", table, 4)?,
            totals: scratch.allocate(device, "sort totals", DIGITS, 4)?,
        })
    }

    /// Scratch of one word per pair, free between sorts.
    pub(super) fn spare_words(&self) -> &Buffer {
        &self.keys
    }

    /// Sorts `keys`, which differ in bits of `differing` alone, and moves `values` along, both in place. Passes go over these bits only:
    /// the order of a stable sort is unique, so it is that of a sort by all bits.
    pub(super) fn record(&self, recording: &mut Recording, keys: &Buffer, values: &Buffer, differing: u32) {
        self.record_from(recording, keys, keys, values, differing);
    }

    /// As [`Sorter::record`], with the keys from `source`, which stays as it is.
    pub(super) fn record_from(
        &self,
        recording: &mut Recording,
        source: &Buffer,
        keys: &Buffer,
        values: &Buffer,
        differing: u32,
    ) {
        let chunks = self.pairs.div_ceil(self.chunk);
        let mut from = (source, values);
        let mut to = (&self.keys, &self.values);
        for shift in shifts(differing) {
            let mut pass = |kernel, count, buffers: &[&Buffer]| {
                let params = SortParams { count, pairs: self.pairs, chunk: self.chunk, chunks, shift };
                recording.dispatch("sort", kernel, count, &params, buffers);
            };
            let [count, rows, scatter] = self.kernels;
            pass(count, grid::invocations(chunks), &[from.0, &self.table]);
            pass(rows, grid::invocations(DIGITS as u32), &[&self.table, &self.totals]);
            let is_alone = scatter == Kernel::SortScatterAlone;
            let invocations = if is_alone { chunks } else { grid::invocations(chunks) };
            pass(scatter, invocations, &[from.0, from.1, &self.table, &self.totals, to.0, to.1]);
            from = to;
            to = if from.0 == keys { (&self.keys, &self.values) } else { (keys, values) };
        }
        if from.0 != keys {
            recording.copy("sort", from.0, keys);
        }
        if from.1 != values {
            recording.copy("sort", from.1, values);
        }
    }
}

/// The kernels of a pass on a device: count, rows, scatter.
pub(crate) fn kernels(info: &DeviceInfo) -> [Kernel; 3] {
    let is_alone = info.kind == DeviceKind::VulkanCpu;
    [Kernel::SortCount, Kernel::SortRows, if is_alone { Kernel::SortScatterAlone } else { Kernel::SortScatter }]
}

/// The lowest bits of the digits that a sort must look at, lowest first: each starts at a bit of `differing` and the last one may end
/// beyond the word.
fn shifts(differing: u32) -> impl Iterator<Item = u32> {
    let mut left = differing;
    std::iter::from_fn(move || {
        let shift = (left != 0).then(|| left.trailing_zeros())?;
        left = u32::try_from(u64::from(left) >> (shift + DIGIT_BITS) << (shift + DIGIT_BITS)).unwrap_or(0);
        Some(shift)
    })
}

/// Passes of a sort of keys that differ in bits of `differing` alone.
pub(super) fn passes(differing: u32) -> usize {
    shifts(differing).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Command;
    use crate::device::cpu::CpuDevice;
    use proptest::prelude::*;

    /// With an even and an odd number of passes, and with none.
    #[test]
    fn a_sort_is_stable_and_leaves_its_source_alone() {
        for differing in [0, 1, 0x00ff_00ff, 0x00ff_ffff, u32::MAX] {
            let source: Vec<u32> = (0..3000).map(|k: u32| k.wrapping_mul(0x9e37_79b9) & differing).collect();
            let device: &mut dyn Device = &mut CpuDevice::new(2).unwrap();
            let mut scratch = Scratch::default();
            let sorter = Sorter::new(&mut scratch, device, 3000).unwrap();
            let [from, keys, values] =
                ["source", "keys", "values"].map(|name| scratch.allocate(device, name, 3000, 4).unwrap());
            device.upload(&from, bytemuck::cast_slice(&source)).unwrap();
            device.upload(&values, bytemuck::cast_slice(&(0..3000).collect::<Vec<u32>>())).unwrap();
            let mut recording = Recording::new();
            sorter.record_from(&mut recording, &from, &keys, &values, differing);
            let is_dispatch = |command: &&(&str, Command)| matches!(command.1, Command::Dispatch(_));
            assert_eq!(recording.commands().iter().filter(is_dispatch).count(), 3 * passes(differing));
            device.run(&recording).unwrap();

            let mut read = |buffer: &Buffer| {
                let mut words = vec![0u32; 3000];
                device.download(buffer, bytemuck::cast_slice_mut(&mut words)).unwrap();
                words
            };
            let mut expected: Vec<(u32, u32)> = source.iter().copied().zip(0..).collect();
            expected.sort_by_key(|pair| pair.0);
            let sorted: Vec<(u32, u32)> = read(&keys).into_iter().zip(read(&values)).collect();
            assert!(sorted == expected, "{differing:#x}");
            assert!(read(&from) == source, "{differing:#x}");
        }
    }

    #[test]
    fn a_sort_looks_at_bits_that_differ_alone() {
        for (differing, expected) in [
            (0, &[][..]),
            (1, &[0]),
            (0x3fff_ffff, &[0, 8, 16, 24]),
            (0xffff_ffff, &[0, 8, 16, 24]),
            (0x8000_0000, &[31]),
            (0x0924_9249, &[0, 9, 18, 27]),
            (0x00ff_0000, &[16]),
            (0x0180_0001, &[0, 23]),
        ] {
            assert_eq!(shifts(differing).collect::<Vec<_>>(), expected, "{differing:#x}");
        }
    }

    proptest! {
        #[test]
        fn every_bit_is_in_one_digit(differing: u32) {
            let digits: Vec<u32> = shifts(differing).collect();
            let within = |bit: u32, shift: u32| (shift..shift + DIGIT_BITS).contains(&bit);
            for bit in 0..u32::BITS {
                let times = digits.iter().filter(|&&shift| within(bit, shift)).count();
                prop_assert!(times <= 1 && (times == 1 || differing >> bit & 1 == 0));
            }
            prop_assert!(digits.len() <= 4 && digits.is_sorted());
        }
    }
}
