//! From a path to the format and the unpacked bytes.

use super::error::SceneError;
use ruzstd::decoding::errors::{FrameDecoderError, ReadFrameHeaderError};
use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

/// Formats of scene files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Obj,
    Ply,
    Stl,
    Gltf,
}

const FORMATS: [(&str, Format); 5] =
    [("obj", Format::Obj), ("ply", Format::Ply), ("stl", Format::Stl), ("gltf", Format::Gltf), ("glb", Format::Gltf)];

/// What a file is packed with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Packing {
    Xz,
    Gzip,
    Zstd,
}

const PACKINGS: [(&str, Packing); 3] = [("xz", Packing::Xz), ("gz", Packing::Gzip), ("zst", Packing::Zstd)];

/// Memory that an xz file may ask for: eight times what `xz -9` does, so that a damaged header cannot take all there is.
const XZ_MEMORY_KIB: u32 = 512 * 1024;

const BUFFER_BYTES: usize = 128 * 1024;

/// An open scene file.
pub(super) struct Opened {
    pub(super) format: Format,
    pub(super) file: String,
    /// Name of the file without the extensions.
    pub(super) name: String,
    packing: Option<Packing>,
    /// The unpacked bytes.
    pub(super) bytes: Box<dyn BufRead>,
}

/// Opens a scene file, which is not empty.
pub(super) fn open(path: &Path) -> Result<Opened, SceneError> {
    let file = path.display().to_string();
    // A folder named like a scene is still a folder, and one named otherwise has no extension to complain about.
    if path.is_dir() {
        return Err(SceneError::Directory { file });
    }
    let (format, packing) = kind(path, &file)?;
    let handle = File::open(path).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound => SceneError::NotFound { file: file.clone() },
        _ => SceneError::Io { file: file.clone(), source },
    })?;
    let mut packed = BufReader::with_capacity(BUFFER_BYTES, handle);
    match packed.fill_buf() {
        Ok([]) => return Err(SceneError::Empty { file }),
        Ok(_) => {}
        Err(source) => return Err(SceneError::Io { file, source }),
    }
    let bytes: Box<dyn BufRead> = match packing {
        None => Box::new(packed),
        Some(Packing::Xz) => buffered(lzma_rust2::XzReader::new_mem_limit(packed, true, XZ_MEMORY_KIB)),
        Some(Packing::Gzip) => buffered(flate2::bufread::MultiGzDecoder::new(packed)),
        Some(Packing::Zstd) => buffered(ZstdFrames::new(packed)),
    };
    let stem = Path::new(path.file_stem().unwrap_or_default());
    let name = if packing.is_some() { stem.file_stem().unwrap_or_default() } else { stem.as_os_str() };
    let mut opened = Opened { format, file, name: name.to_string_lossy().into(), packing, bytes };
    match opened.bytes.fill_buf() {
        Ok([]) => Err(SceneError::Empty { file: opened.file }),
        Ok(_) => Ok(opened),
        Err(source) => Err(opened.fault(source)),
    }
}

impl Opened {
    /// The error for a read that failed.
    pub(super) fn fault(&self, source: io::Error) -> SceneError {
        let file = self.file.clone();
        let format = match self.packing {
            None => return SceneError::Io { file, source },
            Some(Packing::Xz) => "xz",
            Some(Packing::Gzip) => "gzip",
            Some(Packing::Zstd) => "zstd",
        };
        SceneError::Archive { file, format, source }
    }

    /// All the bytes.
    pub(super) fn read_all(&mut self) -> Result<Vec<u8>, SceneError> {
        let mut all = Vec::new();
        match self.bytes.read_to_end(&mut all) {
            Ok(_) => Ok(all),
            Err(source) => Err(self.fault(source)),
        }
    }
}

fn buffered(bytes: impl Read + 'static) -> Box<dyn BufRead> {
    Box::new(BufReader::with_capacity(BUFFER_BYTES, bytes))
}

fn kind(path: &Path, file: &str) -> Result<(Format, Option<Packing>), SceneError> {
    let extension = |path: &Path| path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let last = extension(path);
    let packing = PACKINGS.iter().find(|(name, _)| *name == last).map(|(_, packing)| *packing);
    let inner = match packing {
        Some(_) => extension(Path::new(path.file_stem().unwrap_or_default())),
        None => last.clone(),
    };
    let known = |(name, format): &(&str, Format)| (*name == inner).then_some((*format, packing));
    FORMATS.iter().find_map(known).ok_or_else(|| {
        let list = |names: Vec<&str>| names.iter().map(|name| format!(".{name}")).collect::<Vec<_>>().join(", ");
        let known = format!(
            "{}, each also packed as {}",
            list(FORMATS.iter().map(|(name, _)| *name).collect()),
            list(PACKINGS.iter().map(|(name, _)| *name).collect()),
        );
        let extension = if packing.is_some() && !inner.is_empty() { format!("{inner}.{last}") } else { last };
        SceneError::Extension { file: file.into(), extension, known }
    })
}

/// The frames of a zstd file one after another: parallel compressors write many, with skippable ones between.
struct ZstdFrames<R: BufRead> {
    source: R,
    decoder: FrameDecoder,
    /// Whether the decoder is inside a frame.
    inside: bool,
}

impl<R: BufRead> ZstdFrames<R> {
    fn new(source: R) -> Self {
        Self { source, decoder: FrameDecoder::new(), inside: false }
    }

    /// Starts the next frame; false at the end of the file.
    fn next_frame(&mut self) -> io::Result<bool> {
        while !self.source.fill_buf()?.is_empty() {
            match self.decoder.init(&mut self.source) {
                Ok(()) => return Ok(true),
                Err(FrameDecoderError::ReadFrameHeaderError(ReadFrameHeaderError::SkipFrame { length, .. })) => {
                    io::copy(&mut (&mut self.source).take(u64::from(length)), &mut io::sink())?;
                }
                Err(fault) => return Err(io::Error::other(fault)),
            }
        }
        Ok(false)
    }

    /// The decoder computes the checksum of a frame but leaves the comparison to its user.
    fn verify(&self) -> io::Result<()> {
        match (self.decoder.get_checksum_from_data(), self.decoder.get_calculated_checksum()) {
            (Some(want), Some(have)) if want != have => Err(io::Error::new(
                io::ErrorKind::InvalidData,
                format!("checksum of a frame is {have:08x} instead of {want:08x}"),
            )),
            _ => Ok(()),
        }
    }
}

impl<R: BufRead> Read for ZstdFrames<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() {
            return Ok(0);
        }
        loop {
            if !self.inside {
                self.inside = self.next_frame()?;
                if !self.inside {
                    return Ok(0);
                }
            }
            while self.decoder.can_collect() == 0 && !self.decoder.is_finished() {
                let step = BlockDecodingStrategy::UptoBlocks(1);
                self.decoder.decode_blocks(&mut self.source, step).map_err(io::Error::other)?;
            }
            let read = self.decoder.read(buffer)?;
            if read > 0 {
                return Ok(read);
            }
            self.verify()?;
            self.inside = false;
        }
    }
}
