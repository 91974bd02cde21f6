//! What tree files of all versions have around their nodes: header and checksum.

use super::file_error::TreeFileError;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// First bytes of the file. Line ends and end-of-file mark betray a transfer as text.
pub(crate) const MAGIC: [u8; 8] = *b"PRBVH\r\n\x1a";
pub(crate) const HEADER_BYTES: usize = 64;
pub(crate) const CHECKSUM_BYTES: usize = 16;

/// The numbers of a header: triangles, nodes, and one of the version's own.
pub(crate) struct Header {
    pub(crate) counts: [u32; 3],
    pub(crate) scene_hash: String,
}

/// The bytes of a header.
pub(crate) fn header(version: u32, counts: [u32; 3], hash: [u8; 16]) -> [u8; HEADER_BYTES] {
    let mut header = [0; HEADER_BYTES];
    header[..8].copy_from_slice(&MAGIC);
    header[8..12].copy_from_slice(&version.to_le_bytes());
    for (k, count) in counts.into_iter().enumerate() {
        header[12 + 4 * k..16 + 4 * k].copy_from_slice(&count.to_le_bytes());
    }
    header[24..40].copy_from_slice(&hash);
    header
}

/// The version of a file, from its first bytes.
pub(crate) fn version(path: &Path, bytes: &[u8]) -> Result<u32, TreeFileError> {
    let malformed =
        |offset, what, value, need| Err(TreeFileError::Malformed { path: path.to_owned(), offset, what, value, need });
    let length = bytes.len();
    if length < MAGIC.len() || bytes[..MAGIC.len()] != MAGIC {
        let found = bytes[..length.min(MAGIC.len())].escape_ascii().to_string();
        return malformed(0, "the magic number", found, MAGIC.escape_ascii().to_string());
    }
    if length < HEADER_BYTES {
        let what = "the length of the file";
        return malformed(length, what, format!("{length} bytes"), format!("at least {HEADER_BYTES}"));
    }
    Ok(word(bytes, 8))
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

impl Header {
    /// The header of a file of this version that has `smallest` bytes at least.
    pub(crate) fn of(path: &Path, bytes: &[u8], need: u32, smallest: usize) -> Result<Self, TreeFileError> {
        let malformed = |offset, what, value, need| {
            Err(TreeFileError::Malformed { path: path.to_owned(), offset, what, value, need })
        };
        let found = version(path, bytes)?;
        if found != need {
            return malformed(8, "the version", found.to_string(), need.to_string());
        }
        if bytes.len() < smallest {
            let what = "the length of the file";
            return malformed(bytes.len(), what, format!("{} bytes", bytes.len()), format!("at least {smallest}"));
        }
        if let Some(at) = (40..HEADER_BYTES).find(|&at| bytes[at] != 0) {
            return malformed(at, "a reserved byte", bytes[at].to_string(), "0".to_owned());
        }
        let counts = [12, 16, 20].map(|at| word(bytes, at));
        Ok(Self { counts, scene_hash: hex(&bytes[24..40]) })
    }
}

/// What lies between header and checksum, `need` bytes, if the checksum is right. In 64 bits, so that no count overflows.
pub(crate) fn body<'a>(path: &Path, bytes: &'a [u8], need: u64) -> Result<&'a [u8], TreeFileError> {
    let malformed =
        |offset, what, value, need| Err(TreeFileError::Malformed { path: path.to_owned(), offset, what, value, need });
    let (length, need) = (bytes.len(), need + (HEADER_BYTES + CHECKSUM_BYTES) as u64);
    if length as u64 != need {
        let at = (length as u64).min(need) as usize;
        return malformed(at, "the length of the file", format!("{length} bytes"), format!("{need} by its header"));
    }
    let checksum_at = length - CHECKSUM_BYTES;
    let checksum = blake3::hash(&bytes[..checksum_at]);
    if checksum.as_bytes()[..CHECKSUM_BYTES] != bytes[checksum_at..] {
        let value = hex(&bytes[checksum_at..]);
        return malformed(checksum_at, "the checksum", value, checksum.to_hex()[..2 * CHECKSUM_BYTES].to_owned());
    }
    Ok(&bytes[HEADER_BYTES..checksum_at])
}

/// The bytes of a file.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, TreeFileError> {
    read_most(path, u64::MAX)
}

/// The bytes of its header, or all of a shorter one.
pub(crate) fn read_start(path: &Path) -> Result<Vec<u8>, TreeFileError> {
    read_most(path, HEADER_BYTES as u64)
}

fn read_most(path: &Path, most: u64) -> Result<Vec<u8>, TreeFileError> {
    let failed = |source| TreeFileError::Read { path: path.to_owned(), source };
    // A device or a pipe could go on for ever.
    if !std::fs::metadata(path).map_err(failed)?.is_file() {
        return Err(failed(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file")));
    }
    let mut bytes = Vec::new();
    File::open(path).and_then(|file| file.take(most).read_to_end(&mut bytes)).map_err(failed)?;
    Ok(bytes)
}

pub(crate) fn parse_hash(hash: &str) -> Option<[u8; 16]> {
    if hash.len() != 32 || !hash.bytes().all(|digit| digit.is_ascii_hexdigit()) {
        return None;
    }
    u128::from_str_radix(hash, 16).ok().map(u128::to_be_bytes)
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
