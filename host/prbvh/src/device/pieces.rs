//! Long buffers, read without a copy of the whole.

use super::{Buffer, Device, DeviceError, DeviceKind};
use bytemuck::Pod;

/// Bytes that are read at a time, about.
const PIECE_BYTES: usize = 1 << 20;
/// The same where each time is a submission.
const PIECE_BYTES_OF_A_GPU: usize = 16 << 20;

/// Hands the elements of a buffer over, in order, some at a time.
///
/// # Errors
/// If the device fails.
pub(crate) fn read_pieces<T: Pod>(
    device: &mut dyn Device,
    buffer: &Buffer,
    mut take: impl FnMut(&[T]),
) -> Result<(), DeviceError> {
    let bytes = if device.info().kind == DeviceKind::VulkanGpu { PIECE_BYTES_OF_A_GPU } else { PIECE_BYTES };
    let at_a_time = (bytes / size_of::<T>()).clamp(1, buffer.length.max(1));
    let mut piece = vec![T::zeroed(); at_a_time.min(buffer.length)];
    for first in (0..buffer.length).step_by(at_a_time) {
        piece.truncate(buffer.length - first);
        device.download_from(buffer, first * size_of::<T>(), bytemuck::cast_slice_mut(&mut piece))?;
        take(&piece);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::cpu::CpuDevice;
    use super::*;

    #[test]
    fn pieces_are_the_whole_in_order() {
        let mut device = CpuDevice::new(1).unwrap();
        for length in [0, 1, PIECE_BYTES / 4, PIECE_BYTES / 2 + 3] {
            let words: Vec<u32> = (0..length as u32).collect();
            let buffer = device.allocate("words", length, 4).unwrap();
            device.upload(&buffer, bytemuck::cast_slice(&words)).unwrap();
            let (mut read, mut calls) = (Vec::new(), 0);
            read_pieces(&mut device, &buffer, |piece: &[u32]| {
                read.extend_from_slice(piece);
                calls += 1;
            })
            .unwrap();
            assert!(read == words, "{length} words");
            assert_eq!(calls, (4 * length).div_ceil(PIECE_BYTES));
            device.free(buffer);
        }
    }
}
