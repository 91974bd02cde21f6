//! Rays through a tree: hits, and what they cost ([`prbvh_kernel::trace`]).
//!
//! Hits are those of the scene, bit for bit the same for every tree over it and on every device ([`prbvh_kernel::ray`]); the numbers
//! of tests are those of the tree.

mod form;
mod range;
mod scene;
mod wide;

pub use range::TraceRange;
pub use scene::TraceScene;

use crate::build::Scratch;
use crate::bvh::{self, TreeFault};
use crate::device::{Device, DeviceError, Recording, Timing};
use crate::wide::{WideFault, summary as wide_summary};
pub use prbvh_kernel::ray::{Hit, NO_TRIANGLE, Ray, SOME_TRIANGLE, UNFINISHED};

/// What is asked of a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Query {
    /// The hit with the smallest parameter; of equal ones the triangle with the lowest number.
    Closest,
    /// Whether there is a hit.
    Any,
}

/// Why rays were not traced.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TraceError {
    /// The device refused or failed.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The tree is none over the triangles.
    #[error("no rays were traced, because the tree is broken: {}", bvh::summary(.0))]
    InvalidTree(Vec<TreeFault>),
    /// The wide tree is none over the triangles.
    #[error("no rays were traced, because the wide tree is broken: {}", wide_summary(.0))]
    InvalidWideTree(Vec<WideFault>),
    /// A coordinate of a ray is no number, or where the scene was not made for.
    #[error("ray {ray}: {what} is {value}, but must be {need}")]
    Ray {
        /// Number of the ray.
        ray: usize,
        /// What is wrong.
        what: &'static str,
        /// Its value.
        value: f32,
        /// What it must be.
        need: String,
    },
}

/// Traces rays given in scene units: `direction` of any length but 0, `t_min` and `t_max` as distances. Returns the hits, in the order of
/// the rays, with `t` as a distance in scene units, and the times of the device.
///
/// # Errors
/// If a ray has coordinates that are no numbers, or starts where no ray was to start, or the device fails.
pub fn trace(
    device: &mut dyn Device,
    scene: &mut TraceScene,
    rays: &[Ray],
    query: Query,
) -> Result<(Vec<Hit>, Vec<Timing>), TraceError> {
    let working = rays.iter().enumerate().map(|(k, ray)| scene.range().ray(k, ray)).collect::<Result<Vec<_>, _>>()?;
    if working.is_empty() {
        return Ok((Vec::new(), Vec::new()));
    }
    let (mut hits, mut timings) = run(device, scene, &working, query)?;
    if hits.iter().any(|hit| hit.triangle == UNFINISHED) {
        scene.go_deep(device)?;
        (hits, timings) = run(device, scene, &working, query)?;
    }
    for hit in &mut hits {
        hit.t = scene.range().to_scene(hit.t);
    }
    Ok((hits, timings))
}

/// Rays and hits in the trace range.
fn run(
    device: &mut dyn Device,
    scene: &TraceScene,
    working: &[Ray],
    query: Query,
) -> Result<(Vec<Hit>, Vec<Timing>), DeviceError> {
    let mut scratch = Scratch::default();
    let mut run = || -> Result<_, DeviceError> {
        let input = scratch.allocate(device, "rays", working.len(), size_of::<Ray>())?;
        let output = scratch.allocate(device, "hits", working.len(), size_of::<Hit>())?;
        device.upload(&input, bytemuck::cast_slice(working))?;
        let mut recording = Recording::new();
        let count = u32::try_from(working.len()).map_err(|_| DeviceError::Limit {
            what: "tracing".to_owned(),
            name: "32-bit ray indices",
            need: working.len() as u64,
            have: u32::MAX.into(),
            device: device.info().name.clone(),
        })?;
        scene.record(&mut recording, "trace", (&input, &output), count, query);
        let timings = device.run(&recording)?;
        let mut hits: Vec<Hit> = vec![bytemuck::Zeroable::zeroed(); working.len()];
        device.download(&output, bytemuck::cast_slice_mut(&mut hits))?;
        Ok((hits, timings))
    };
    let result = run();
    scratch.free(device);
    result
}
