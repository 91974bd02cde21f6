//! Transforms of nodes in float64, rounded to float32 once, at the corner.

use super::document::Node;

/// An affine map: three rows of a 3 × 4 matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Transform([[f64; 4]; 3]);

impl Transform {
    pub(super) const IDENTITY: Self = Self([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);

    /// The map of a node, from its own space to that of its parent.
    pub(super) fn of(node: &Node) -> Self {
        if let Some(matrix) = node.matrix {
            // The matrix is stored by columns.
            return Self([0, 1, 2].map(|row| [0, 1, 2, 3].map(|column| matrix[4 * column + row])));
        }
        let rotation = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
        Self::decomposed(node.translation.unwrap_or_default(), rotation, node.scale.unwrap_or([1.0; 3]))
    }

    /// First the scale, then the rotation by a quaternion x, y, z, w, then the translation.
    pub(super) fn decomposed(translation: [f64; 3], rotation: [f64; 4], scale: [f64; 3]) -> Self {
        let rotation = rotation_matrix(rotation);
        Self([0, 1, 2].map(|row| {
            let [x, y, z] = [0, 1, 2].map(|column| rotation[row][column] * scale[column]);
            [x, y, z, translation[row]]
        }))
    }

    /// `self` after `inner`.
    pub(super) fn then(&self, inner: &Self) -> Self {
        Self(self.0.map(|row| {
            [0, 1, 2, 3].map(|column| {
                let sum: f64 = (0..3).map(|k| row[k] * inner.0[k][column]).sum();
                if column == 3 { sum + row[3] } else { sum }
            })
        }))
    }

    pub(super) fn apply(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = [f64::from(x), f64::from(y), f64::from(z)];
        self.0.map(|row| (row[0] * x + row[1] * y + row[2] * z + row[3]) as f32)
    }
}

/// The rotation by a quaternion x, y, z, w of any length but 0; none for 0.
fn rotation_matrix([x, y, z, w]: [f64; 4]) -> [[f64; 3]; 3] {
    let square = x * x + y * y + z * z + w * w;
    let s = if square > 0.0 { 2.0 / square } else { 0.0 };
    [
        [1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
        [s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w)],
        [s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y)],
    ]
}
