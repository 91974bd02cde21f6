//! Scenes: files and the built-in one, as triangles; of the library's user triangles, indexed vertices, and boxes.
//!
//! What is done for all triangles at once (reading, counting, scaling) is done on the threads of the current rayon pool: `pool.install(|| …)` says which.
//! Outside of any pool that is rayon's own, which starts when it is first needed.

mod built_in;
mod census;
mod error;
#[cfg(feature = "files")]
mod files;
mod memory;
mod note;
mod place;
mod range;

#[cfg(test)]
mod tests;

pub use built_in::DEFAULT_TRIANGLES;
#[doc(hidden)]
pub use built_in::Noise;
pub use census::{Census, duplicate_boxes};
pub use error::{MAX_TRIANGLES, SceneError};
#[cfg(feature = "files")]
pub use files::{Format, LoadOptions, NoSuchFormat, load, load_with, name_of};
pub use memory::Vertices;
pub(crate) use memory::stand_in;
pub use note::Note;
pub use place::Place;
pub use prbvh_kernel::aabb::Aabb;
pub use prbvh_kernel::setup::Triangle;
pub use range::{OutOfRange, SafeRange};

use error::Blame;
use rayon::prelude::*;

/// What a scene is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Primitives {
    /// Triangles.
    #[default]
    Triangles,
    /// Boxes ([`Scene::from_boxes`]).
    Boxes,
}

/// Triangles with all that is known of them before anything is built. There is at least one and at most [`MAX_TRIANGLES`], and
/// all coordinates are finite.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Scene {
    /// Short name: that of the file without folder and extensions.
    pub name: String,
    /// Path of the file, or `built-in`, or `library` for [`Scene::from_triangles`].
    pub source: String,
    /// What the scene is made of.
    pub primitives: Primitives,
    /// The triangles, in the order of the file. Of boxes: one for each, with the same box, which stands for it wherever a tree is built or measured.
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
        Self::screened(name, "library".into(), triangles, Primitives::Triangles)
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
        Ok((Self::screened(name, "library".into(), triangles, Primitives::Triangles)?, left_out))
    }

    /// A scene of triangles that are finite and not too many.
    fn screened(
        name: String,
        source: String,
        mut triangles: Vec<Triangle>,
        primitives: Primitives,
    ) -> Result<Self, SceneError> {
        if triangles.is_empty() {
            let file = if source == "library" { name } else { source };
            return Err(SceneError::NoTriangles { file, notes: Vec::new() });
        }
        // A reader does not know how many will come, and they stay for the whole run.
        triangles.shrink_to_fit();
        let census = || match primitives {
            Primitives::Triangles => Census::of(&triangles),
            Primitives::Boxes => Census::of_boxes(&triangles),
        };
        let (census, hash) = rayon::join(census, || hash(&triangles));
        Ok(Self { name, source, primitives, triangles, census, hash, attribute_bytes: 0, notes: Vec::new() })
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
        primitives: Primitives::Triangles,
        triangles,
        census,
        hash,
        attribute_bytes: 0,
        notes: Vec::new(),
    }
}

pub(crate) fn is_finite(t: &Triangle) -> bool {
    t.a.iter().chain(&t.b).chain(&t.c).all(|x| x.is_finite())
}

fn hash(triangles: &[Triangle]) -> String {
    blake3::hash(bytemuck::cast_slice(triangles)).to_hex()[..32].to_string()
}
