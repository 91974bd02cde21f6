//! Long uploads, on a device whose memory the host does not reach.

use super::*;
use crate::device::vulkan::ring::PIECE_BYTES;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The words of a buffer from `first` on as a piece has them.
fn write(seed: u32, first: usize, piece: &mut [u8]) {
    let words: &mut [u32] = bytemuck::cast_slice_mut(piece);
    (first as u32 / 4..).zip(words).for_each(|(k, word)| *word = k.wrapping_mul(0x9e37_79b9) ^ seed);
}

fn words(seed: u32, bytes: usize) -> Vec<u32> {
    let mut words = vec![0; bytes / 4];
    write(seed, 0, bytemuck::cast_slice_mut(&mut words));
    words
}

#[test]
fn long_uploads_go_in_pieces_that_nobody_waits_for() {
    if left_out("long_uploads_go_in_pieces_that_nobody_waits_for") {
        return;
    }
    let mut device = open(options(Access::Never));
    // 24 bytes, as boxes have, are no part of a piece.
    for (length, element) in [(PIECE_BYTES / 4, 4), (PIECE_BYTES / 4 + 1, 4), (PIECE_BYTES / 2, 4), (600_001, 24)] {
        let bytes = length * element;
        let buffer = device.allocate("words", length, element).unwrap();
        let before = device.traffic();
        let mut pieces = Vec::new();
        let mut fill = |first: usize, piece: &mut [u8]| {
            pieces.push((first, piece.len()));
            write(7, first, piece);
        };
        device.upload_with(&buffer, bytes, &mut fill).unwrap();
        assert!(pieces.iter().all(|(first, size)| first % element == 0 && size % element == 0), "{pieces:?}");
        let traffic = device.traffic().since(before);
        let expected = (0, bytes.div_ceil(PIECE_BYTES / element * element) as u64 - 1, bytes as u64);
        assert_eq!((traffic.submissions, traffic.ahead, traffic.bytes_in), expected, "{bytes} bytes");
        assert_eq!(pieces.len() as u64, traffic.ahead + 1);
        let mut read = vec![0u32; bytes / 4];
        device.download(&buffer, bytemuck::cast_slice_mut(&mut read)).unwrap();
        assert!(read == words(7, bytes), "{bytes} bytes differ");
        device.free(buffer);
    }
    let held = device.staging.bytes();
    assert!(held <= 3 * PIECE_BYTES as u64 + (16 << 20), "{held} bytes for bytes on their way");
    device.close().unwrap();
}

#[test]
fn the_last_of_several_uploads_counts() {
    if left_out("the_last_of_several_uploads_counts") {
        return;
    }
    let mut device = open(options(Access::Never));
    let bytes = 3 * PIECE_BYTES + 40;
    let buffer = device.allocate("words", bytes / 4, 4).unwrap();
    let gone = device.allocate("gone", bytes / 4, 4).unwrap();
    device.upload(&gone, bytemuck::cast_slice(&words(9, bytes))).unwrap();
    device.free(gone);
    // The start of a buffer that waits to be zeroed, all of it, another part, and a few words.
    let mut expected = vec![0; bytes / 4];
    for (seed, size) in [(1, 2 * PIECE_BYTES), (2, bytes), (3, PIECE_BYTES + 8), (4, 12)] {
        device.upload(&buffer, bytemuck::cast_slice(&words(seed, size))).unwrap();
        expected[..size / 4].copy_from_slice(&words(seed, size));
        if seed % 2 == 1 {
            assert!(content::<u32>(&mut device, &buffer) == expected, "upload {seed}");
        }
    }
    assert!(content::<u32>(&mut device, &buffer) == expected);
    device.close().unwrap();
}

#[test]
fn an_upload_that_ends_halfway_leaves_the_device_at_rest() {
    if left_out("an_upload_that_ends_halfway_leaves_the_device_at_rest") {
        return;
    }
    let mut device = open(options(Access::Never));
    let bytes = 4 * PIECE_BYTES;
    let buffer = device.allocate("words", bytes / 4, 4).unwrap();
    let mut panics = |first: usize, _: &mut [u8]| assert!(first < 2 * PIECE_BYTES, "of the caller");
    let upload = AssertUnwindSafe(|| device.upload_with(&buffer, bytes, &mut panics));
    assert!(catch_unwind(upload).is_err());
    device.free(buffer);
    let buffer = device.allocate("words", bytes / 4, 4).unwrap();
    device.upload_with(&buffer, bytes, &mut |first, piece| write(5, first, piece)).unwrap();
    assert!(content::<u32>(&mut device, &buffer) == words(5, bytes));

    let logical = Arc::clone(&device.device);
    let mut gives_up = |first: usize, _: &mut [u8]| {
        if first > 0 {
            logical.abandon();
        }
    };
    let error = device.upload_with(&buffer, bytes, &mut gives_up).unwrap_err();
    assert!(matches!(error, DeviceError::Vulkan { code: 2, .. }), "{error}");
    drop(logical);
    device.close().unwrap();
}
