//! What a scene is made of: counts and measures that later stages plan by.

use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;
use std::hash::{DefaultHasher, Hasher};

/// Counts and measures of a scene of at least one triangle, all of finite coordinates.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
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
    /// Extent per axis, scene units.
    pub extent: [f64; 3],
    /// Largest extent per axis over the smallest that is not 0; 1 where all are 0.
    pub extent_ratio: f64,
    /// Largest magnitude of a coordinate.
    pub largest_coordinate: f32,
    /// Largest extent of the box of a triangle along an axis.
    pub largest_extent: f64,
    /// Smallest extent above 0 of the box of a triangle along an axis; 0 where all triangles are points.
    pub smallest_extent: f64,
    /// Largest area of a triangle, scene units².
    pub largest_area: f64,
    /// Smallest area above 0 of a triangle, scene units²; 0 where none has an area.
    pub smallest_area: f64,
}

impl Census {
    /// Decades between the extents of the largest triangle and of the smallest one that is no point.
    #[must_use]
    pub fn extent_decades(&self) -> f64 {
        decades(self.largest_extent, self.smallest_extent)
    }

    /// Decades between the areas of the largest triangle and of the smallest one that has an area.
    #[must_use]
    pub fn area_decades(&self) -> f64 {
        decades(self.largest_area, self.smallest_area)
    }

    /// Takes the census of finite `triangles`.
    #[must_use]
    pub fn of(triangles: &[Triangle]) -> Self {
        Self::by(triangles, |triangle| (!has_zero_area(triangle)).then(|| area(triangle)))
    }

    /// The same of triangles that stand for boxes, whose areas are those of the boxes' surfaces.
    pub(super) fn of_boxes(triangles: &[Triangle]) -> Self {
        Self::by(triangles, |triangle| {
            let Aabb { min, max } = triangle.aabb();
            let [x, y, z] = [0, 1, 2].map(|k| f64::from(max[k]) - f64::from(min[k]));
            Some(2.0 * (x * y + y * z + z * x)).filter(|&area| area > 0.0)
        })
    }

    /// `area_of`: none where there is no area.
    fn by(triangles: &[Triangle], area_of: impl Fn(&Triangle) -> Option<f64> + Sync) -> Self {
        let add = |sums: Sums, triangle: &Triangle| sums.add(triangle, area_of(triangle));
        let sum = triangles.par_iter().fold(Sums::default, add).reduce(Sums::default, Sums::merge);
        let (min, max) = if triangles.is_empty() { ([0.0; 3], [0.0; 3]) } else { (sum.min, sum.max) };
        let extent = [0, 1, 2].map(|k| f64::from(max[k]) - f64::from(min[k]));
        let extents = || extent.into_iter().filter(|&extent| extent > 0.0);
        let (least, most) = (extents().fold(f64::INFINITY, f64::min), extents().fold(0.0, f64::max));
        Self {
            extent,
            extent_ratio: if most > 0.0 { most / least } else { 1.0 },
            largest_area: sum.largest_area,
            smallest_area: if sum.smallest_area.is_finite() { sum.smallest_area } else { 0.0 },
            triangles: triangles.len(),
            zero_area: sum.zero_area,
            duplicates: repeated(triangles, |triangle| *triangle),
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
    largest_area: f64,
    smallest_area: f64,
}

impl Default for Sums {
    fn default() -> Self {
        Self {
            zero_area: 0,
            min: [f32::INFINITY; 3],
            max: [f32::NEG_INFINITY; 3],
            largest_extent: 0.0,
            smallest_extent: f64::INFINITY,
            largest_area: 0.0,
            smallest_area: f64::INFINITY,
        }
    }
}

impl Sums {
    fn add(mut self, triangle: &Triangle, area: Option<f64>) -> Self {
        let aabb = triangle.aabb();
        match area {
            None => self.zero_area += 1,
            Some(area) => {
                self.largest_area = self.largest_area.max(area);
                self.smallest_area = self.smallest_area.min(area);
            }
        }
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
        self.largest_area = self.largest_area.max(other.largest_area);
        self.smallest_area = self.smallest_area.min(other.smallest_area);
        self
    }
}

fn decades(largest: f64, smallest: f64) -> f64 {
    if smallest > 0.0 { (largest / smallest).log10() } else { 0.0 }
}

fn edges(triangle: &Triangle) -> [[f64; 3]; 2] {
    [triangle.b, triangle.c].map(|to| [0, 1, 2].map(|k| f64::from(to[k]) - f64::from(triangle.a[k])))
}

fn has_zero_area(triangle: &Triangle) -> bool {
    let [u, v] = edges(triangle);
    // The components are compared with 0 rather than their squares, which could underflow.
    (0..3).all(|k| u[k] * v[(k + 1) % 3] == u[(k + 1) % 3] * v[k])
}

fn area(triangle: &Triangle) -> f64 {
    let [u, v] = edges(triangle);
    let cross = [0, 1, 2].map(|k| u[k] * v[(k + 1) % 3] - u[(k + 1) % 3] * v[k]);
    // Squares of the components could overflow.
    let largest = cross.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    if largest > 0.0 { 0.5 * largest * cross.iter().map(|x| (x / largest).powi(2)).sum::<f64>().sqrt() } else { 0.0 }
}

/// Number of triangles whose boxes are, byte for byte, those of earlier ones.
#[must_use]
pub fn duplicate_boxes(triangles: &[Triangle]) -> usize {
    repeated(triangles, Triangle::aabb)
}

/// Number of triangles whose keys are, byte for byte, those of earlier ones.
fn repeated<K: bytemuck::Pod>(triangles: &[Triangle], key: impl Fn(&Triangle) -> K + Sync) -> usize {
    let hash = |triangle: &Triangle| {
        let mut hasher = DefaultHasher::new();
        hasher.write(bytemuck::bytes_of(&key(triangle)));
        hasher.finish()
    };
    let mut keys: Vec<(u64, u32)> =
        (0..triangles.len() as u32).into_par_iter().map(|index| (hash(&triangles[index as usize]), index)).collect();
    keys.par_sort_unstable();
    let count_run = |run: &[(u64, u32)]| {
        if run.len() < 2 {
            return 0;
        }
        let of_run: Vec<K> = run.iter().map(|(_, index)| key(&triangles[*index as usize])).collect();
        let mut same: Vec<&[u8]> = of_run.iter().map(bytemuck::bytes_of).collect();
        same.sort_unstable();
        same.windows(2).filter(|pair| pair[0] == pair[1]).count()
    };
    keys.chunk_by(|x, y| x.0 == y.0).map(count_run).sum()
}
