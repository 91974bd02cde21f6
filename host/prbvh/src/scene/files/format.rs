//! What a scene file is: by its name, and by its first bytes.

use std::fmt;
use std::str::FromStr;

/// Formats of scene files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// Wavefront OBJ.
    Obj,
    /// PLY, text or binary.
    Ply,
    /// STL, text or binary.
    Stl,
    /// glTF 2.0, as JSON or as one binary file (GLB).
    Gltf,
}

/// Extensions of the formats, which are the names that [`Format::from_str`] takes too.
pub(super) const FORMATS: [(&str, Format); 5] =
    [("obj", Format::Obj), ("ply", Format::Ply), ("stl", Format::Stl), ("gltf", Format::Gltf), ("glb", Format::Gltf)];

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Obj => "OBJ",
            Self::Ply => "PLY",
            Self::Stl => "STL",
            Self::Gltf => "glTF",
        })
    }
}

/// There is no such format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("\"{0}\" is no format: there are obj, ply, stl, gltf and glb")]
pub struct NoSuchFormat(String);

impl FromStr for Format {
    type Err = NoSuchFormat;

    fn from_str(name: &str) -> Result<Self, NoSuchFormat> {
        Self::of_extension(&name.to_lowercase()).ok_or_else(|| NoSuchFormat(name.to_owned()))
    }
}

/// First bytes of a text as Unicode has them.
const UTF8_MARK: &[u8] = b"\xef\xbb\xbf";

/// Whether a text begins as UTF-16 does, of either byte order.
pub(super) fn is_utf16(head: &[u8]) -> bool {
    head.starts_with(b"\xff\xfe") || head.starts_with(b"\xfe\xff")
}

/// The bytes without the mark that some editors put before a text.
pub(super) fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(UTF8_MARK).unwrap_or(bytes)
}

impl Format {
    /// The format of a file name that ends so, in lower case.
    pub(super) fn of_extension(extension: &str) -> Option<Self> {
        FORMATS.iter().find(|(name, _)| *name == extension).map(|(_, format)| *format)
    }

    /// The format of a file that begins so, as far as that tells.
    pub(super) fn of_head(head: &[u8]) -> Option<Self> {
        if is_utf16(head) {
            return None;
        }
        let head = without_mark(head);
        let text = head.trim_ascii_start();
        let first = first_word(text);
        if first.eq_ignore_ascii_case(b"ply") {
            Some(Self::Ply)
        } else if head.starts_with(b"glTF") || text.starts_with(b"{") {
            Some(Self::Gltf)
        } else if first.eq_ignore_ascii_case(b"solid") || is_binary_stl(head) {
            Some(Self::Stl)
        } else if is_obj(head) {
            Some(Self::Obj)
        } else {
            None
        }
    }
}

fn first_word(text: &[u8]) -> &[u8] {
    text.split(u8::is_ascii_whitespace).next().unwrap_or_default()
}

/// Whether a whole facet follows the header, with a count that is not 0.
fn is_binary_stl(head: &[u8]) -> bool {
    let (Some(count), Some(facet)) = (head.get(80..84), head.get(84..132)) else { return false };
    let (numbers, _) = facet.as_chunks::<4>();
    // Texts and machine code make numbers of other magnitudes.
    let is_common = |x: f32| x == 0.0 || (1e-30..1e30).contains(&x.abs());
    count != [0; 4] && numbers.iter().all(|bytes| is_common(f32::from_le_bytes(*bytes))) && head.contains(&0)
}

/// Whether the first line that is no comment holds a common statement; comments alone are enough where they are all there is.
fn is_obj(head: &[u8]) -> bool {
    const COMMON: [&str; 12] = ["v", "vn", "vt", "vp", "f", "fo", "g", "o", "s", "l", "mtllib", "usemtl"];
    let mut lines = head.split(|byte| matches!(byte, b'\n' | b'\r')).map(<[u8]>::trim_ascii);
    match lines.find(|line| !line.is_empty() && !line.starts_with(b"#")) {
        Some(line) => COMMON.iter().any(|name| first_word(line).eq_ignore_ascii_case(name.as_bytes())),
        None => head.trim_ascii_start().starts_with(b"#"),
    }
}

/// Beginnings of what is often found in the place of a scene, whatever the name says.
const STAND_INS: [(&[u8], &str); 6] = [
    (b"version https://git-lfs", "a Git LFS pointer, not the file itself, which `git lfs pull` fetches"),
    (b"version https://hawser", "a Git LFS pointer, not the file itself, which `git lfs pull` fetches"),
    // The slash as a number, for it is no path of this machine.
    (b"\x2fannex/objects/", "a git-annex pointer, not the file itself, which `git annex get` fetches"),
    (b"<!doctype html", "an HTML page, not a scene: a download that went wrong?"),
    (b"<html", "an HTML page, not a scene: a download that went wrong?"),
    (b"kaydara fbx binary", "an FBX file, which is not read"),
];

/// What stands in the place of a scene, if it begins so.
pub(super) fn stand_in(head: &[u8]) -> Option<&'static str> {
    let text = without_mark(head).trim_ascii_start();
    let begins = |with: &[u8]| text.len() >= with.len() && text[..with.len()].eq_ignore_ascii_case(with);
    STAND_INS.iter().find(|(with, _)| begins(with)).map(|(_, what)| *what)
}
