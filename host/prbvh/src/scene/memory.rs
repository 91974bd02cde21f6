//! Scenes of what the library's user has in memory: indexed vertices, boxes.

use super::error::Blame;
use super::place::Place;
use super::{Primitives, Scene, SceneError};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;

/// Bytes of a position.
const POSITION: usize = size_of::<[f32; 3]>();

/// Positions of vertices, lent: as they are, or one in each stride of a buffer with other attributes between.
#[derive(Clone, Copy, Debug)]
pub struct Vertices<'a> {
    bytes: &'a [u8],
    stride: usize,
    count: usize,
}

impl<'a> Vertices<'a> {
    /// `count` positions: three float32 in the byte order of the machine, the first at byte `offset`, each `stride` bytes after the one before. They need
    /// not be aligned.
    ///
    /// # Errors
    /// [`SceneError::Stride`] if a position would overlap the next one or end behind `bytes`.
    pub fn strided(bytes: &'a [u8], offset: usize, stride: usize, count: usize) -> Result<Self, SceneError> {
        let end_of = |last: usize| last.checked_mul(stride)?.checked_add(offset)?.checked_add(POSITION);
        let end = count.checked_sub(1).map_or(Some(0), end_of);
        if stride < POSITION || end.is_none_or(|end| end > bytes.len()) {
            return Err(SceneError::Stride { bytes: bytes.len(), offset, stride, count });
        }
        Ok(Self { bytes: bytes.get(offset..).unwrap_or_default(), stride, count })
    }

    /// Positions.
    #[must_use]
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    fn get(&self, index: u32) -> Option<[f32; 3]> {
        let at = (index as usize) < self.count;
        at.then(|| bytemuck::pod_read_unaligned(&self.bytes[index as usize * self.stride..][..POSITION]))
    }
}

impl<'a> From<&'a [[f32; 3]]> for Vertices<'a> {
    fn from(positions: &'a [[f32; 3]]) -> Self {
        Self { bytes: bytemuck::cast_slice(positions), stride: POSITION, count: positions.len() }
    }
}

impl<'a> From<&'a Vec<[f32; 3]>> for Vertices<'a> {
    fn from(positions: &'a Vec<[f32; 3]>) -> Self {
        positions.as_slice().into()
    }
}

/// A triangle with the box `aabb`.
pub(crate) fn stand_in(aabb: &Aabb) -> Triangle {
    Triangle { a: aabb.min, b: aabb.max, c: aabb.max }
}

impl Scene {
    /// A scene of indexed vertices: a triangle for each three of `indices`.
    ///
    /// # Errors
    /// [`SceneError::Index`], [`SceneError::NotFinite`], [`SceneError::NoTriangles`] or [`SceneError::TooMany`]; the first two with the triangle.
    pub fn indexed<'a>(
        name: impl Into<String>,
        vertices: impl Into<Vertices<'a>>,
        indices: &[[u32; 3]],
    ) -> Result<Self, SceneError> {
        let (name, vertices) = (name.into(), vertices.into());
        let blame = Blame(&name);
        blame.limit(indices.len() as u64)?;
        let triangle = |(index, corners): (usize, &[u32; 3])| {
            let corner = |k: usize| {
                vertices.get(corners[k]).ok_or_else(|| SceneError::Index {
                    file: name.clone(),
                    place: Place::Element("triangle", index as u64),
                    index: corners[k].to_string(),
                    count: vertices.len() as u64,
                })
            };
            Ok(Triangle { a: corner(0)?, b: corner(1)?, c: corner(2)? })
        };
        let triangles = indices.par_iter().enumerate().map(triangle).collect::<Result<Vec<_>, SceneError>>()?;
        Self::from_triangles(name, triangles)
    }

    /// A scene of boxes: particles, instances, what hangs below a tree over trees. A tree over it holds their numbers. Nothing is drawn of it: a ray hits
    /// no box here.
    ///
    /// # Errors
    /// [`SceneError::NotFinite`], [`SceneError::Inverted`], [`SceneError::NoTriangles`] or [`SceneError::TooMany`]; the first two with the box.
    pub fn from_boxes(name: impl Into<String>, boxes: &[Aabb]) -> Result<Self, SceneError> {
        let name = name.into();
        let blame = Blame(&name);
        blame.limit(boxes.len() as u64)?;
        let is_good = |aabb: &Aabb| {
            (0..3).all(|k| aabb.min[k].is_finite() && aabb.max[k].is_finite() && aabb.min[k] <= aabb.max[k])
        };
        if let Some(index) = boxes.par_iter().position_first(|aabb| !is_good(aabb)) {
            let (place, Aabb { min, max }) = (Place::Element("box", index as u64), boxes[index]);
            blame.finite(place, min)?;
            blame.finite(place, max)?;
            return Err(SceneError::Inverted { file: name, place, min, max });
        }
        Self::screened(name, "library".into(), boxes.par_iter().map(stand_in).collect(), Primitives::Boxes)
    }

    /// The boxes of the primitives.
    #[must_use]
    pub fn boxes(&self) -> Vec<Aabb> {
        self.triangles.par_iter().map(Triangle::aabb).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f32; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    #[test]
    fn indexed_vertices_are_triangles() {
        let scene = Scene::indexed("two", &CORNERS[..], &[[0, 1, 2], [3, 2, 1]]).unwrap();
        let [a, b, c, d] = CORNERS;
        assert_eq!(scene.triangles, [Triangle { a, b, c }, Triangle { a: d, b: c, c: b }]);
        let plain = Scene::from_triangles("two", scene.triangles.clone()).unwrap();
        assert_eq!((scene.hash, scene.primitives), (plain.hash, Primitives::Triangles));
    }

    #[test]
    fn a_stride_may_be_any_number_of_bytes() {
        let mut bytes = vec![0xff_u8; 5];
        for corner in CORNERS {
            bytes.extend_from_slice(bytemuck::bytes_of(&corner));
            bytes.extend([0xff; 7]);
        }
        let without_the_last_gap = &bytes[..bytes.len() - 7];
        let vertices = Vertices::strided(without_the_last_gap, 5, 19, 4).unwrap();
        let scene = Scene::indexed("strided", vertices, &[[3, 1, 0]]).unwrap();
        assert_eq!(scene.triangles, Scene::indexed("plain", &CORNERS[..], &[[3, 1, 0]]).unwrap().triangles);
        for (bytes, offset, stride, count) in [
            (&without_the_last_gap[1..], 5, 19, 4),
            (without_the_last_gap, 6, 19, 4),
            (without_the_last_gap, 5, 19, 5),
            (without_the_last_gap, 5, 11, 4),
            (without_the_last_gap, 5, 0, 4),
            (without_the_last_gap, 5, usize::MAX, 4),
            (without_the_last_gap, usize::MAX - 3, 19, 1),
        ] {
            let error = Vertices::strided(bytes, offset, stride, count).unwrap_err().to_string();
            assert!(error.contains(&format!("{count} positions")), "{error}");
        }
        assert!(Vertices::strided(&[], 9, 12, 0).unwrap().is_empty());
    }

    #[test]
    fn bad_indices_and_corners_are_named() {
        let error = Scene::indexed("mesh", &CORNERS[..], &[[0, 1, 2], [0, 4, 1]]).unwrap_err().to_string();
        assert_eq!(error, "mesh, triangle 1: vertex index 4 is out of range: there are 4 vertices");
        let mut corners = CORNERS;
        corners[3][1] = f32::NAN;
        let error = Scene::indexed("mesh", &corners[..], &[[0, 1, 2], [0, 3, 1]]).unwrap_err().to_string();
        assert_eq!(error, "mesh, triangle 1: coordinate NaN is not a finite float32");
        assert!(matches!(Scene::indexed("mesh", &CORNERS[..], &[]), Err(SceneError::NoTriangles { .. })));
    }

    #[test]
    fn boxes_keep_their_boxes() {
        let boxes = [
            Aabb { min: [0.0; 3], max: [1.0, 2.0, 3.0] },
            Aabb { min: [-1.0; 3], max: [-1.0; 3] },
            Aabb { min: [-1.0; 3], max: [-1.0; 3] },
        ];
        let scene = Scene::from_boxes("boxes", &boxes).unwrap();
        assert_eq!((scene.boxes(), scene.primitives), (boxes.to_vec(), Primitives::Boxes));
        let census = &scene.census;
        assert_eq!((census.triangles, census.zero_area, census.duplicates), (3, 2, 1));
        assert_eq!((census.largest_area, census.smallest_area), (22.0, 22.0));
    }

    #[test]
    fn bad_boxes_are_named_with_their_values() {
        let good = Aabb { min: [0.0; 3], max: [1.0; 3] };
        let error = |bad: Aabb| Scene::from_boxes("boxes", &[good, good, bad]).unwrap_err().to_string();
        let nan = error(Aabb { min: [0.0, f32::NAN, 0.0], max: [1.0; 3] });
        assert_eq!(nan, "boxes, box 2: coordinate NaN is not a finite float32");
        assert!(error(Aabb { min: [0.0; 3], max: [1.0, 1.0, f32::INFINITY] }).contains("box 2: coordinate inf"));
        let inverted = error(Aabb { min: [0.0, 2.0, 0.0], max: [1.0; 3] });
        assert_eq!(inverted, "boxes, box 2: the box from [0.0, 2.0, 0.0] to [1.0, 1.0, 1.0] is inverted");
        assert!(matches!(Scene::from_boxes("none", &[]), Err(SceneError::NoTriangles { .. })));
    }
}
