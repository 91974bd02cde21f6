//! Tests of scenes, whatever they come from.

mod built_in;
mod census;
mod range;

use super::*;

fn triangle(a: [f32; 3], b: [f32; 3], c: [f32; 3]) -> Triangle {
    Triangle { a, b, c }
}
