//! What a scene is made of: counts and measures that later stages plan by.

use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;
use std::hash::{DefaultHasher, Hasher};

/// Counts and measures of a scene of at least one triangle, all of finite coordinates.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Census {
    /// Triangles.
    pub triangles: usize,
    /// Triangles of area 0, computed in float64: points, segments, and corners on a line.
    pub zero_area: usize,
    /// Triangles whose 36 bytes are those of an earlier one.
    pub duplicates: usize,
    /// Smallest coordinate per axis.
    pub min: [f32; 3],
    /// Largest coordinate per axis.
    pub max: [f32; 3],
    /// Whether the scene has no extent along the axis.
    pub flat_axes: [bool; 3],
    /// Largest magnitude of a coordinate.
    pub largest_coordinate: f32,
    /// Largest extent of the box of a triangle along an axis.
    pub largest_extent: f64,
    /// Smallest extent above 0 of the box of a triangle along an axis; 0 where all triangles are points.
    pub smallest_extent: f64,
}

impl Census {
    /// Takes the census of finite `triangles`.
    #[must_use]
    pub fn of(triangles: &[Triangle]) -> Self {
        let sum = triangles.par_iter().fold(Sums::default, Sums::add).reduce(Sums::default, Sums::merge);
        let (min, max) = if triangles.is_empty() { ([0.0; 3], [0.0; 3]) } else { (sum.min, sum.max) };
        Self {
            triangles: triangles.len(),
            zero_area: sum.zero_area,
            duplicates: duplicates(triangles),
            min,
            max,
            flat_axes: [0, 1, 2].map(|k| min[k] == max[k]),
            largest_coordinate: min.iter().chain(&max).fold(0.0, |m, x| m.max(x.abs())),
            largest_extent: sum.largest_extent,
            smallest_extent: if sum.smallest_extent.is_finite() { sum.smallest_extent } else { 0.0 },
        }
    }
}

/// Sums whose order does not matter.
struct Sums {
    zero_area: usize,
    min: [f32; 3],
    max: [f32; 3],
    largest_extent: f64,
    smallest_extent: f64,
}

impl Default for Sums {
    fn default() -> Self {
        Self {
            zero_area: 0,
            min: [f32::INFINITY; 3],
            max: [f32::NEG_INFINITY; 3],
            largest_extent: 0.0,
            smallest_extent: f64::INFINITY,
        }
    }
}

impl Sums {
    fn add(mut self, triangle: &Triangle) -> Self {
        let aabb = triangle.aabb();
        self.zero_area += usize::from(has_zero_area(triangle));
        for k in 0..3 {
            self.min[k] = self.min[k].min(aabb.min[k]);
            self.max[k] = self.max[k].max(aabb.max[k]);
            let extent = f64::from(aabb.max[k]) - f64::from(aabb.min[k]);
            self.largest_extent = self.largest_extent.max(extent);
            if extent > 0.0 {
                self.smallest_extent = self.smallest_extent.min(extent);
            }
        }
        self
    }

    fn merge(mut self, other: Self) -> Self {
        self.zero_area += other.zero_area;
        for k in 0..3 {
            self.min[k] = self.min[k].min(other.min[k]);
            self.max[k] = self.max[k].max(other.max[k]);
        }
        self.largest_extent = self.largest_extent.max(other.largest_extent);
        self.smallest_extent = self.smallest_extent.min(other.smallest_extent);
        self
    }
}

fn has_zero_area(triangle: &Triangle) -> bool {
    let edge = |to: [f32; 3]| [0, 1, 2].map(|k| f64::from(to[k]) - f64::from(triangle.a[k]));
    let (u, v) = (edge(triangle.b), edge(triangle.c));
    // The components are compared with 0 rather than their squares, which could underflow.
    (0..3).all(|k| u[k] * v[(k + 1) % 3] == u[(k + 1) % 3] * v[k])
}

/// Number of triangles whose bytes are those of an earlier one.
fn duplicates(triangles: &[Triangle]) -> usize {
    let hash = |bytes: &[u8]| {
        let mut hasher = DefaultHasher::new();
        hasher.write(bytes);
        hasher.finish()
    };
    let bytes = |index: u32| bytemuck::bytes_of(&triangles[index as usize]);
    let mut keys: Vec<(u64, u32)> =
        (0..triangles.len() as u32).into_par_iter().map(|index| (hash(bytes(index)), index)).collect();
    keys.par_sort_unstable();
    let count_run = |run: &[(u64, u32)]| {
        if run.len() < 2 {
            return 0;
        }
        let mut same: Vec<&[u8]> = run.iter().map(|(_, index)| bytes(*index)).collect();
        same.sort_unstable();
        same.windows(2).filter(|pair| pair[0] == pair[1]).count()
    };
    keys.chunk_by(|x, y| x.0 == y.0).map(count_run).sum()
}
