//! A scene in motion: the same triangles, bent a little further in each frame.

use prbvh::scene::{Scene, Triangle};
use std::f32::consts::PI;

/// Twist from the foot to the head in the last frame, radians.
const TWIST: f32 = PI;
/// Height of the waves in the last frame, as a part of the distance from the axis.
const WAVES: f32 = 0.3;

/// The scene at `time` between 0, where it is as it was, and 1: twisted about its upright axis, with waves that run up it.
#[must_use]
pub fn at(scene: &Scene, time: f32) -> Vec<Triangle> {
    let (min, max) = (scene.census.min, scene.census.max);
    let middle = [0, 1, 2].map(|k| 0.5 * (min[k] + max[k]));
    let height = (max[1] - min[1]).max(f32::MIN_POSITIVE);
    let bend = |p: [f32; 3]| {
        let up = (p[1] - min[1]) / height;
        let (sin, cos) = (TWIST * time * up).sin_cos();
        let wide = 1.0 + WAVES * time * (2.0 * PI * (3.0 * up - 2.0 * time)).sin();
        let [x, z] = [p[0] - middle[0], p[2] - middle[2]].map(|x| x * wide);
        [middle[0] + cos * x - sin * z, p[1], middle[2] + sin * x + cos * z]
    };
    scene.triangles.iter().map(|t| Triangle { a: bend(t.a), b: bend(t.b), c: bend(t.c) }).collect()
}
