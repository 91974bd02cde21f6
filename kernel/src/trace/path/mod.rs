//! A small path tracer with next-event estimation, as a wavefront of kernels.
//!
//! Source: Kajiya 1986; wavefront: Laine, Karras & Aila 2013. All surfaces are diffuse; light comes from one rectangle, which is
//! sampled and not seen itself, and from the sky, which is seen. Every kernel is a map over paths:
//!
//! ```text
//! camera → ( trace → shade → trace shadow rays → gather ) per bounce → film
//! ```
//! Random numbers are hashes of pixel, sample and bounce, and no function is used whose bits a driver may choose: every device
//! makes the same picture.

mod camera;
mod shade;
mod surface;

pub use camera::{CameraParams, camera, pixel};
pub use shade::{FilmParams, GatherParams, ShadeParams, film, gather, shade};
pub use surface::Surface;

use bytemuck::{Pod, Zeroable};

/// A path under way, 32 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Path {
    /// What part of light from here on reaches the eye: red, green, blue.
    pub throughput: [f32; 3],
    /// The pixel, `y · width + x`.
    pub pixel: u32,
    /// Light that reached the eye so far.
    pub radiance: [f32; 3],
    /// Tests against boxes and triangles of the primary ray.
    pub tests: u32,
}

/// Light that a shadow ray lets through if nothing is in its way, 16 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Light {
    /// Red, green, blue.
    pub radiance: [f32; 3],
    /// 0.
    pub unused: u32,
}

/// Sums over the samples of a pixel, 16 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Pixel {
    /// Red, green, blue.
    pub radiance: [f32; 3],
    /// Tests against boxes and triangles of the primary rays.
    pub tests: u32,
}
