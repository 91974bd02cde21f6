//! From a path to the format and the unpacked bytes. All bytes of a scene pass through here, those of files beside it too.

use super::LoadOptions;
use super::format::{FORMATS, Format, is_utf16, stand_in};
use super::lines::Lines;
use super::origin::{Origin, Packing};
use super::zstd::ZstdFrames;
use crate::scene::Place;
use crate::scene::error::{Blame, SceneError};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read};
use std::path::Path;

const PACKINGS: [(&str, Packing); 3] = [("xz", Packing::Xz), ("gz", Packing::Gzip), ("zst", Packing::Zstd)];

/// The path that stands for standard input.
const STDIN: &str = "-";
/// What its scene is called.
const STDIN_NAME: &str = "stdin";

/// Memory that an xz file may ask for: eight times what `xz -9` does, so that a damaged header cannot take all there is.
const XZ_MEMORY_KIB: u32 = 512 * 1024;

const BUFFER_BYTES: usize = 128 * 1024;

/// Bytes that are looked at to tell what a file is.
const HEAD_BYTES: u64 = 4096;

/// An open scene file.
pub(super) struct Opened {
    pub(super) format: Format,
    /// What the first bytes look like.
    pub(super) looks: Option<Format>,
    pub(super) origin: Origin,
    /// Name of the file without the extensions.
    pub(super) name: String,
    /// The first of the unpacked bytes.
    pub(super) head: Vec<u8>,
    /// The unpacked bytes.
    pub(super) bytes: Box<dyn BufRead>,
}

/// The name of the scene in a file, which is there to be told before the file is read: that of the file without folder and extensions.
#[must_use]
pub fn name_of(path: &Path) -> String {
    if path == Path::new(STDIN) { STDIN_NAME.to_owned() } else { Names::of(path).stem }
}

/// Opens a scene file, which is not empty. `-` is standard input.
pub(super) fn open(path: &Path, options: &LoadOptions) -> Result<Opened, SceneError> {
    let is_stdin = path == Path::new(STDIN);
    let file = if is_stdin { STDIN_NAME.to_owned() } else { path.display().to_string() };
    // A folder named like a scene is still a folder, and one named otherwise has no extension to complain about.
    if !is_stdin && path.is_dir() {
        return Err(SceneError::Directory { file });
    }
    let bytes: Box<dyn Read> = if is_stdin {
        Box::new(io::stdin())
    } else {
        Box::new(File::open(path).map_err(|source| not_open(&file, source))?)
    };
    let mut origin = Origin { file, packing: None };
    let (head, packed) = peek(&origin, BufReader::with_capacity(BUFFER_BYTES, bytes))?;

    let names = Names::of(path);
    origin.packing = names.packing.or_else(|| packing_of(&head));
    let bytes: Box<dyn BufRead> = match origin.packing {
        None => Box::new(packed),
        Some(Packing::Xz) => buffered(lzma_rust2::XzReader::new_mem_limit(packed, true, XZ_MEMORY_KIB)),
        Some(Packing::Gzip) => buffered(flate2::bufread::MultiGzDecoder::new(packed)),
        Some(Packing::Zstd) => buffered(ZstdFrames::new(packed)),
    };
    let (head, bytes) = peek(&origin, bytes)?;
    let looks = Format::of_head(&head);
    let named = Format::of_extension(&names.extension);
    let format = options.format.or(named).or(looks).ok_or_else(|| names.unknown(&origin.file))?;
    Ok(Opened { format, looks, origin, name: name_of(path), head, bytes: Box::new(bytes) })
}

fn not_open(file: &str, source: io::Error) -> SceneError {
    let file = file.to_owned();
    match source.kind() {
        io::ErrorKind::NotFound => SceneError::NotFound { file },
        _ => SceneError::Io { file, source },
    }
}

/// Bytes of which the first were looked at.
type Peeked<R> = io::Chain<Cursor<Vec<u8>>, R>;

/// The first bytes, and all of them. There is at least one, and they are no pointer to a file that is elsewhere.
fn peek<R: BufRead>(origin: &Origin, mut bytes: R) -> Result<(Vec<u8>, Peeked<R>), SceneError> {
    let mut head = Vec::new();
    bytes.by_ref().take(HEAD_BYTES).read_to_end(&mut head).map_err(|source| origin.fault(source))?;
    if head.is_empty() {
        return Err(SceneError::Empty { file: origin.file.clone() });
    }
    match stand_in(&head) {
        Some(what) => Err(Blame(&origin.file).format(Place::File, what)),
        None => Ok((head.clone(), Cursor::new(head).chain(bytes))),
    }
}

/// The first `length` bytes of a file beside a scene, or all if it has fewer.
///
/// # Errors
/// A text that names the path.
pub(super) fn beside(path: &Path, length: usize) -> Result<Vec<u8>, String> {
    let explain = |fault: io::Error| format!("{}: {fault}", path.display());
    // A device or a pipe could go on for ever.
    if !std::fs::metadata(path).map_err(explain)?.is_file() {
        return Err(format!("{}: not a regular file", path.display()));
    }
    let mut bytes = Vec::new();
    let mut file = File::open(path).map_err(explain)?.take(length as u64);
    file.read_to_end(&mut bytes).map_err(explain)?;
    match stand_in(&bytes) {
        Some(what) => Err(format!("{}: {what}", path.display())),
        None => Ok(bytes),
    }
}

impl Opened {
    /// All the bytes.
    pub(super) fn read_all(&mut self) -> Result<Vec<u8>, SceneError> {
        let mut all = Vec::new();
        match self.bytes.read_to_end(&mut all) {
            Ok(_) => Ok(all),
            Err(source) => Err(self.origin.fault(source)),
        }
    }

    /// The lines of a text.
    pub(super) fn lines(self) -> Result<Lines<Box<dyn BufRead>>, SceneError> {
        self.check_encoding()?;
        Ok(Lines::new(self.origin, self.bytes))
    }

    /// Checks that a text is of an encoding that agrees with ASCII.
    pub(super) fn check_encoding(&self) -> Result<(), SceneError> {
        if is_utf16(&self.head) {
            return Err(Blame(&self.origin.file).format(Place::File, "a text in UTF-16; UTF-8 is read"));
        }
        Ok(())
    }
}

fn buffered(bytes: impl Read + 'static) -> Box<dyn BufRead> {
    Box::new(BufReader::with_capacity(BUFFER_BYTES, bytes))
}

fn packing_of(head: &[u8]) -> Option<Packing> {
    match head {
        [0xfd, b'7', b'z', b'X', b'Z', 0, ..] => Some(Packing::Xz),
        [0x1f, 0x8b, ..] => Some(Packing::Gzip),
        // A frame, or one to be skipped.
        [0x28, 0xb5, 0x2f, 0xfd, ..] | [0x50..=0x5f, 0x2a, 0x4d, 0x18, ..] => Some(Packing::Zstd),
        _ => None,
    }
}

/// What the name of a file tells.
struct Names {
    /// The name without the extensions.
    stem: String,
    packing: Option<Packing>,
    /// Extension of the unpacked file, in lower case.
    extension: String,
    /// All that is taken for extensions, for messages.
    extensions: String,
}

impl Names {
    fn of(path: &Path) -> Self {
        let extension = |path: &Path| path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let last = extension(path);
        let stem = Path::new(path.file_stem().unwrap_or_default());
        let Some((_, packing)) = PACKINGS.iter().find(|(name, _)| *name == last) else {
            return Self {
                stem: stem.to_string_lossy().into(),
                packing: None,
                extension: last.clone(),
                extensions: last,
            };
        };
        let inner = extension(stem);
        let extensions = if inner.is_empty() { last } else { format!("{inner}.{last}") };
        let stem = stem.file_stem().unwrap_or_default().to_string_lossy().into();
        Self { stem, packing: Some(*packing), extension: inner, extensions }
    }

    fn unknown(&self, file: &str) -> SceneError {
        let list = |names: Vec<&str>| names.iter().map(|name| format!(".{name}")).collect::<Vec<_>>().join(", ");
        let known = format!(
            "{}, each also packed as {}",
            list(FORMATS.iter().map(|(name, _)| *name).collect()),
            list(PACKINGS.iter().map(|(name, _)| *name).collect()),
        );
        SceneError::Extension { file: file.into(), extension: self.extensions.clone(), known }
    }
}
