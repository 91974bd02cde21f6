//! Faces as lists of vertex numbers, kept until all vertices are known.

use super::polygon::Polygons;
use crate::scene::Place;
use crate::scene::error::{Blame, SceneError};
use crate::scene::files::notes::Notes;
use prbvh_kernel::setup::Triangle;

/// What a polygon that crosses itself is noted as.
pub(super) const CROSSING: &str = "a polygon that crosses itself is read as a fan around its first corner";

/// What a face that holds no triangle is noted as.
pub(super) const TOO_SMALL: &str = "a face of fewer than three corners is left out";

/// Faces of one kind. A face is what [`Self::corner`] was called with since [`Self::end`].
pub(super) struct Faces {
    /// From the number of a face to its place.
    place: fn(u64) -> Place,
    /// What the file calls the first vertex.
    first: u64,
    corners: Vec<u32>,
    /// Per face where it ends in `corners`, and its number.
    faces: Vec<(usize, u64)>,
    triangles: u64,
}

impl Faces {
    pub(super) fn new(place: fn(u64) -> Place, first: u64) -> Self {
        Self { place, first, corners: Vec::new(), faces: Vec::new(), triangles: 0 }
    }

    pub(super) fn corner(&mut self, vertex: u32) {
        self.corners.push(vertex);
    }

    /// Ends a face; one of fewer than three corners is left out.
    pub(super) fn end(&mut self, blame: Blame<'_>, number: u64, notes: &mut Notes) -> Result<(), SceneError> {
        let start = self.faces.last().map_or(0, |(end, _)| *end);
        let corners = self.corners.len() - start;
        if corners < 3 {
            self.corners.truncate(start);
            notes.add((self.place)(number), TOO_SMALL);
            return Ok(());
        }
        self.faces.push((self.corners.len(), number));
        self.triangles += corners as u64 - 2;
        blame.limit(self.triangles)
    }

    /// Appends the triangles of all faces over `vertices`.
    pub(super) fn triangles(
        &self,
        blame: Blame<'_>,
        vertices: &[[f32; 3]],
        triangles: &mut Vec<Triangle>,
        notes: &mut Notes,
    ) -> Result<(), SceneError> {
        let mut polygons = Polygons::default();
        let mut corners = Vec::new();
        triangles.reserve(self.triangles as usize);
        let mut start = 0;
        for &(end, number) in &self.faces {
            corners.clear();
            for &vertex in &self.corners[start..end] {
                let corner = vertices.get(vertex as usize);
                corners.push(*corner.ok_or_else(|| self.out_of_range(blame, number, vertex, vertices.len()))?);
            }
            if !polygons.push(&corners, triangles) {
                notes.add((self.place)(number), CROSSING);
            }
            start = end;
        }
        blame.limit(triangles.len() as u64)
    }

    fn out_of_range(&self, blame: Blame<'_>, number: u64, vertex: u32, count: usize) -> SceneError {
        blame.index((self.place)(number), u64::from(vertex) + self.first, count as u64)
    }
}
