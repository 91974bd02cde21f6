//! Scenes: files and the built-in one, as triangles.

mod built_in;
mod census;
mod error;
mod faces;
mod format;
mod gltf;
mod lines;
mod note;
mod obj;
mod open;
mod ply;
mod polygon;
mod range;
mod stl;
mod zstd;

#[cfg(test)]
mod tests;

pub use built_in::DEFAULT_TRIANGLES;
pub(crate) use built_in::Noise;
pub use census::{Census, duplicate_boxes};
pub use error::{MAX_TRIANGLES, Place, SceneError};
pub use format::{Format, NoSuchFormat};
pub use note::Note;
pub use range::SafeRange;

use error::Blame;
use note::Notes;
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;
use std::path::Path;

/// Triangles with all that is known of them before anything is built. There is at least one and at most [`MAX_TRIANGLES`], and
/// all coordinates are finite.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Scene {
    /// Short name: that of the file without folder and extensions.
    pub name: String,
    /// Path of the file, or `built-in`, or `library` for [`Scene::from_triangles`].
    pub source: String,
    /// The triangles, in the order of the file.
    pub triangles: Vec<Triangle>,
    /// Counts and measures.
    pub census: Census,
    /// BLAKE3 of the bytes of the triangles, the first 128 bits as 32 hex digits: the same for the same triangles in any format.
    pub hash: String,
    /// Bytes that normals, texture coordinates and colours of the file would take as float32; they are not read. 0 where there is no file.
    pub attribute_bytes: u64,
    /// What of the file was not read, or not as the file means it. Empty where there is no file.
    pub notes: Vec<Note>,
}

/// How a scene file is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LoadOptions {
    /// The format of the file; none: by its extension, or else by its first bytes.
    pub format: Option<Format>,
    /// Whether a file that is not read whole is refused ([`SceneError::NotWhole`]).
    pub strict: bool,
}

/// What a reader makes of a file.
struct Loaded {
    triangles: Vec<Triangle>,
    /// See [`Scene::attribute_bytes`].
    attribute_bytes: u64,
    notes: Notes,
}

/// Bytes of a number of an attribute.
const ATTRIBUTE_NUMBER: u64 = size_of::<f32>() as u64;

impl Scene {
    /// A scene of the library's user.
    ///
    /// # Errors
    /// [`SceneError::NotFinite`], [`SceneError::NoTriangles`] or [`SceneError::TooMany`].
    pub fn from_triangles(name: impl Into<String>, triangles: Vec<Triangle>) -> Result<Self, SceneError> {
        let name = name.into();
        let blame = Blame(&name);
        blame.limit(triangles.len() as u64)?;
        if let Some(index) = triangles.par_iter().position_first(|triangle| !is_finite(triangle)) {
            for corner in [triangles[index].a, triangles[index].b, triangles[index].c] {
                blame.finite(Place::Element("triangle", index as u64), corner)?;
            }
        }
        Self::screened(name, "library".into(), triangles)
    }

    /// The same of the triangles whose coordinates are all finite; also returns the numbers of those left out, ascending.
    ///
    /// # Errors
    /// [`SceneError::NoTriangles`] where none is finite, or [`SceneError::TooMany`].
    pub fn from_finite(name: impl Into<String>, mut triangles: Vec<Triangle>) -> Result<(Self, Vec<u32>), SceneError> {
        let name = name.into();
        Blame(&name).limit(triangles.len() as u64)?;
        let left_out: Vec<u32> = (0..).zip(&triangles).filter(|(_, t)| !is_finite(t)).map(|(index, _)| index).collect();
        triangles.retain(is_finite);
        Ok((Self::screened(name, "library".into(), triangles)?, left_out))
    }

    /// A scene of triangles that are finite and not too many.
    fn screened(name: String, source: String, mut triangles: Vec<Triangle>) -> Result<Self, SceneError> {
        if triangles.is_empty() {
            let file = if source == "library" { name } else { source };
            return Err(SceneError::NoTriangles { file, notes: Vec::new() });
        }
        // A reader does not know how many will come, and they stay for the whole run.
        triangles.shrink_to_fit();
        let (census, hash) = rayon::join(|| Census::of(&triangles), || hash(&triangles));
        Ok(Self { name, source, triangles, census, hash, attribute_bytes: 0, notes: Vec::new() })
    }
}

/// Loads a scene file: OBJ, PLY, STL, glTF or GLB by its extension, which `.xz`, `.gz` or `.zst` may follow, or else by its first bytes.
/// `-` is standard input.
///
/// Only positions and faces are read. Polygons become triangles. What is left out is in [`Scene::notes`].
///
/// # Errors
/// A [`SceneError`] that names the file, the line or element, and the value at fault.
pub fn load(path: &Path) -> Result<Scene, SceneError> {
    load_with(path, &LoadOptions::default())
}

/// [`load`], as the options say.
///
/// # Errors
/// A [`SceneError`] that names the file, the line or element, and the value at fault.
pub fn load_with(path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
    let opened = open::open(path, options)?;
    let (name, file) = (opened.name.clone(), opened.origin.file.clone());
    let (format, looks) = (opened.format, opened.looks);
    let loaded = match format {
        Format::Obj => obj::read(opened),
        Format::Ply => ply::read(opened),
        Format::Stl => stl::read(opened),
        Format::Gltf => gltf::read(opened, path),
    };
    let scene = loaded.and_then(|Loaded { triangles, attribute_bytes, notes }| {
        let notes = notes.into_vec();
        if triangles.is_empty() {
            return Err(SceneError::NoTriangles { file: file.clone(), notes });
        }
        if options.strict && !notes.is_empty() {
            return Err(SceneError::NotWhole { file: file.clone(), notes });
        }
        Ok(Scene { attribute_bytes, notes, ..Scene::screened(name, file.clone(), triangles)? })
    });
    match (scene, looks) {
        // A wrong extension explains more than what follows from it.
        (Err(SceneError::Format { .. } | SceneError::NoTriangles { .. }), Some(looks)) if looks != format => {
            Err(Blame(&file).format(Place::File, format!("read as {format}, but it begins as {looks} does")))
        }
        (scene, _) => scene,
    }
}

/// The built-in scene of exactly `triangles` triangles (at least 1, at most [`MAX_TRIANGLES`]): a hall with columns and arches,
/// bookshelves, benches, chandeliers, a statue, railings, cables, and a carpet of tufts. The same bits on every machine. It is whole from
/// about 1,000 triangles on; fewer are the first of that many.
#[must_use]
pub fn built_in(triangles: usize) -> Scene {
    let triangles = built_in::hall(triangles.clamp(1, MAX_TRIANGLES as usize));
    let (census, hash) = rayon::join(|| Census::of(&triangles), || hash(&triangles));
    Scene {
        name: "hall".into(),
        source: "built-in".into(),
        triangles,
        census,
        hash,
        attribute_bytes: 0,
        notes: Vec::new(),
    }
}

fn is_finite(t: &Triangle) -> bool {
    t.a.iter().chain(&t.b).chain(&t.c).all(|x| x.is_finite())
}

fn hash(triangles: &[Triangle]) -> String {
    blake3::hash(bytemuck::cast_slice(triangles)).to_hex()[..32].to_string()
}
