//! Scene files. Each reader takes the positions and faces of its format, and notes what else there is.

mod faces;
mod format;
mod gltf;
mod lines;
mod notes;
mod obj;
mod open;
mod origin;
mod ply;
mod polygon;
mod stl;
#[cfg(test)]
mod tests;
mod zstd;

pub use format::{Format, NoSuchFormat};
pub use open::name_of;

use super::Place;
use super::error::{Blame, SceneError};
use super::{Primitives, Scene, Triangle};
use notes::Notes;
use std::path::Path;

/// How a scene file is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
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
        Ok(Scene { attribute_bytes, notes, ..Scene::screened(name, file.clone(), triangles, Primitives::Triangles)? })
    });
    match (scene, looks) {
        // A wrong extension explains more than what follows from it.
        (Err(SceneError::Format { .. } | SceneError::NoTriangles { .. }), Some(looks)) if looks != format => {
            Err(Blame(&file).format(Place::File, format!("read as {format}, but it begins as {looks} does")))
        }
        (scene, _) => scene,
    }
}
