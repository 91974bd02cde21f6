//! Pictures of a scene, to measure its tree: a path tracer ([`prbvh_kernel::trace::path`]) and what its rays cost.

mod camera;
mod clear;
mod picture;
mod traced;
mod wave;

pub use camera::Camera;
pub use clear::clear_view;
pub use picture::{Scale, encode_png, heat_map, heat_map_in, shaded, write_png};
pub use traced::TracedTree;

use prbvh::device::{Device, DeviceError, Timing};
use prbvh::scene::Scene;
use prbvh::trace::TraceError;
use serde::Serialize;

/// Largest side of a picture.
pub const MAX_SIDE: u32 = 16_384;

/// What to render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderSettings {
    /// Columns of pixels, 1 to [`MAX_SIDE`].
    pub width: u32,
    /// Rows of pixels, 1 to [`MAX_SIDE`].
    pub height: u32,
    /// Paths per pixel, 1 to 65,536.
    pub samples: u32,
    /// Times that a path goes on after the first surface, at most 64.
    pub bounces: u32,
    /// Shadow rays per surface hit, 1 to 16.
    pub light_samples: u32,
}

impl Default for RenderSettings {
    /// 1024 × 768 and two light samples as in Meister & Bittner 2018; 4 paths of 3 bounces.
    fn default() -> Self {
        Self { width: 1024, height: 768, samples: 4, bounces: 3, light_samples: 2 }
    }
}

/// What rays of one kind cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct RayCost {
    /// Rays traced.
    pub rays: u64,
    /// Those that hit something.
    pub hits: u64,
    /// Tests against boxes per ray.
    pub box_tests_per_ray: f64,
    /// Tests against triangles per ray.
    pub triangle_tests_per_ray: f64,
    /// Time of the tracing kernels, seconds; 0 where the device keeps no time.
    pub seconds: f64,
    /// Rays per microsecond of `seconds`; 0 where the device keeps no time.
    pub mrays_per_s: f64,
}

/// A picture and its cost.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Mean radiance of each pixel, row by row from the top: red, green, blue.
    pub radiance: Vec<[f32; 3]>,
    /// Mean number of tests of each pixel's primary rays, boxes and triangles together.
    pub tests: Vec<f32>,
    /// Rays from the eye.
    pub primary: RayCost,
    /// Rays from a surface to the light.
    pub shadow: RayCost,
    /// Rays from a surface on.
    pub secondary: RayCost,
    /// All rays.
    pub overall: RayCost,
    /// Time of every command.
    pub timings: Vec<Timing>,
}

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The rays could not be traced.
    #[error(transparent)]
    Trace(#[from] TraceError),
    /// A setting is out of range.
    #[error("{name} is {value}, but must be {need}")]
    Setting {
        /// Which setting.
        name: &'static str,
        /// Its value.
        value: String,
        /// What it must be.
        need: &'static str,
    },
}

impl From<DeviceError> for RenderError {
    fn from(error: DeviceError) -> Self {
        Self::Trace(error.into())
    }
}

impl RenderSettings {
    fn check(&self) -> Result<(), RenderError> {
        let ranges = [
            ("width", self.width, 1..=MAX_SIDE, "from 1 to 16384 pixels"),
            ("height", self.height, 1..=MAX_SIDE, "from 1 to 16384 pixels"),
            ("samples", self.samples, 1..=65_536, "from 1 to 65536"),
            ("bounces", self.bounces, 0..=64, "from 0 to 64"),
            ("light samples", self.light_samples, 1..=16, "from 1 to 16"),
        ];
        match ranges.into_iter().find(|(_, value, range, _)| !range.contains(value)) {
            Some((name, value, _, need)) => Err(RenderError::Setting { name, value: value.to_string(), need }),
            None => Ok(()),
        }
    }
}

/// Renders `scene` with `tree` over it. The picture is that of the scene, the same bits for every tree and on every device.
///
/// # Errors
/// If a setting is out of range, the tree is none over the scene's triangles, or the device refuses or fails.
pub fn render<'a>(
    device: &mut dyn Device,
    scene: &Scene,
    tree: impl Into<TracedTree<'a>>,
    camera: &Camera,
    settings: &RenderSettings,
) -> Result<Rendering, RenderError> {
    settings.check()?;
    let frame = camera.frame(settings.width, settings.height)?;
    let mut traced = tree.into().on(device, &scene.triangles, &[camera.eye])?;
    let light = camera::AreaLight::of(camera, &traced::bounds(scene), traced.range());
    let mut result = wave::render(device, &traced, scene, camera, &frame, &light, settings);
    if let Ok((_, unfinished)) = &result
        && *unfinished > 0
    {
        result = traced
            .go_deep(device)
            .and_then(|()| wave::render(device, &traced, scene, camera, &frame, &light, settings));
    }
    traced.free(device);
    Ok(result?.0)
}
