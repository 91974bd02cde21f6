//! Polygons as triangles.

use earcut::Earcut;
use prbvh_kernel::setup::Triangle;

/// Parts of a polygon's area that are rounding.
const ROUNDING: f64 = 1e-6;

/// Makes triangles of polygons: a fan around the first corner where that covers the polygon once, as it does if it is convex, else
/// what ear clipping finds.
pub(super) struct Polygons {
    earcut: Earcut<f64>,
    flat: Vec<[f64; 2]>,
    cut: Vec<u32>,
}

impl Default for Polygons {
    fn default() -> Self {
        Self { earcut: Earcut::new(), flat: Vec::new(), cut: Vec::new() }
    }
}

impl Polygons {
    /// Appends the triangles of a polygon of three corners or more. False if it crosses itself, so that no triangles are right: they are
    /// those of the fan.
    pub(super) fn push(&mut self, corners: &[[f32; 3]], triangles: &mut Vec<Triangle>) -> bool {
        let is_simple = match shape(corners) {
            Shape::Fan => true,
            Shape::Crossing => false,
            Shape::Concave(normal) => {
                if self.clip(corners, normal) {
                    let (cut, _) = self.cut.as_chunks::<3>();
                    triangles.extend(cut.iter().map(|indices| {
                        let [a, b, c] = indices.map(|index| corners[index as usize]);
                        Triangle { a, b, c }
                    }));
                    return true;
                }
                false
            }
        };
        triangles.extend(corners.windows(2).skip(1).map(|edge| Triangle { a: corners[0], b: edge[0], c: edge[1] }));
        is_simple
    }

    /// Clips the ears of a polygon with this normal into `cut`. False if they do not make up its area.
    fn clip(&mut self, corners: &[[f32; 3]], normal: [f64; 3]) -> bool {
        let magnitude = normal.map(f64::abs);
        // Seen along the axis next to the normal, and from the side on which it runs anticlockwise.
        let axis = (0..3).fold(0, |most, k| if magnitude[k] > magnitude[most] { k } else { most });
        let (mut u, mut v) = ((axis + 1) % 3, (axis + 2) % 3);
        if normal[axis] < 0.0 {
            (u, v) = (v, u);
        }
        self.flat.clear();
        self.flat.extend(corners.iter().map(|corner| [f64::from(corner[u]), f64::from(corner[v])]));
        self.earcut.earcut(self.flat.iter().copied(), &[], &mut self.cut);
        let flat = &self.flat;
        let (indices, _) = self.cut.as_chunks_mut::<3>();
        let mut covered = 0.0;
        for indices in indices {
            let [a, b, c] = indices.map(|index| flat[index as usize]);
            let twice = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
            covered += twice.abs();
            if twice < 0.0 {
                indices.swap(1, 2);
            }
        }
        (covered - magnitude[axis]).abs() <= ROUNDING * magnitude[axis]
    }
}

enum Shape {
    /// All triangles of the fan around the first corner face the same way.
    Fan,
    /// Some face the other way; the sum of their normals, twice the area long.
    Concave([f64; 3]),
    /// They cancel each other.
    Crossing,
}

fn shape(corners: &[[f32; 3]]) -> Shape {
    if corners.len() == 3 {
        return Shape::Fan;
    }
    let normals = || corners.windows(2).skip(1).map(|edge| cross(corners[0], edge[0], edge[1]));
    let (mut sum, mut lengths) = ([0.0; 3], 0.0);
    for normal in normals() {
        sum = [0, 1, 2].map(|k| sum[k] + normal[k]);
        lengths += length(normal);
    }
    if lengths == 0.0 {
        return Shape::Fan;
    }
    if length(sum) <= ROUNDING * lengths {
        return Shape::Crossing;
    }
    let least = -ROUNDING * length(sum) * lengths;
    if normals().all(|normal| dot(normal, sum) >= least) { Shape::Fan } else { Shape::Concave(sum) }
}

/// Normal of a triangle, twice its area long.
fn cross(a: [f32; 3], b: [f32; 3], c: [f32; 3]) -> [f64; 3] {
    let [u, v] = [b, c].map(|to| [0, 1, 2].map(|k| f64::from(to[k]) - f64::from(a[k])));
    [0, 1, 2].map(|k| u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn length(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}
