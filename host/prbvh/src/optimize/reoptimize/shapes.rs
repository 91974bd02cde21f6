//! What a frame is made of.

use crate::scene::{Scene, SceneError};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;

/// Primitives that a thread takes at once.
const AT_ONCE: usize = 1024;

/// Primitives of a frame: triangles or boxes, by their numbers.
#[derive(Clone, Copy, Debug)]
pub enum Shapes<'a> {
    /// Triangles.
    Triangles(&'a [Triangle]),
    /// Boxes.
    Boxes(&'a [Aabb]),
}

impl Shapes<'_> {
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Triangles(triangles) => triangles.len(),
            Self::Boxes(boxes) => boxes.len(),
        }
    }

    /// Writes the boxes from one on; false if one is not finite or inverted.
    pub(super) fn write(&self, first: usize, boxes: &mut [Aabb]) -> bool {
        match self {
            Self::Triangles(triangles) => write_all(boxes, &triangles[first..], |t| {
                // A sum of finite numbers that is none is far out of the range anyway.
                let sum: f32 = t.a.iter().chain(&t.b).chain(&t.c).map(|x| x.abs()).sum();
                (t.aabb(), sum < f32::INFINITY)
            }),
            Self::Boxes(from) => write_all(boxes, &from[first..], |aabb| {
                let is_good = |k: usize| aabb.min[k] <= aabb.max[k] && aabb.max[k] - aabb.min[k] < f32::INFINITY;
                (*aabb, (0..3).all(is_good))
            }),
        }
    }

    /// What is wrong with them, told by the number of the primitive.
    pub(super) fn fault(&self) -> Option<SceneError> {
        match self {
            Self::Triangles(triangles) => Scene::from_triangles("frame", triangles.to_vec()).err(),
            Self::Boxes(boxes) => Scene::from_boxes("frame", boxes).err(),
        }
    }
}

/// Writes the box of each; false if one is no good.
fn write_all<T: Sync>(boxes: &mut [Aabb], from: &[T], of: impl Fn(&T) -> (Aabb, bool) + Sync) -> bool {
    let write = |(to, from): (&mut Aabb, &T)| {
        let (aabb, is_good) = of(from);
        *to = aabb;
        is_good
    };
    boxes.par_iter_mut().zip(from).with_min_len(AT_ONCE).map(write).reduce(|| true, |a, b| a && b)
}

impl<'a> From<&'a [Triangle]> for Shapes<'a> {
    fn from(triangles: &'a [Triangle]) -> Self {
        Self::Triangles(triangles)
    }
}

impl<'a> From<&'a Vec<Triangle>> for Shapes<'a> {
    fn from(triangles: &'a Vec<Triangle>) -> Self {
        Self::Triangles(triangles)
    }
}

impl<'a> From<&'a [Aabb]> for Shapes<'a> {
    fn from(boxes: &'a [Aabb]) -> Self {
        Self::Boxes(boxes)
    }
}

impl<'a> From<&'a Vec<Aabb>> for Shapes<'a> {
    fn from(boxes: &'a Vec<Aabb>) -> Self {
        Self::Boxes(boxes)
    }
}
