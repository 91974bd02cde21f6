//! The wavefront: all paths of a part of the picture, stage by stage.

use super::camera::{AreaLight, cross, unit};
use super::{Camera, RayCost, RenderSettings, Rendering};
use prbvh::build::Scratch;
use prbvh::device::{Buffer, Device, DeviceError, Recording, Timing};
use prbvh::scene::Scene;
use prbvh::trace::{Hit, Query, Ray, TraceRange, TraceScene};
use prbvh_kernel::Kernel;
use prbvh_kernel::ray::LARGEST;
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::trace::counts::{COUNT_CHUNK, CountParams, RayCounts};
use prbvh_kernel::trace::path::{
    CameraParams, FilmParams, GatherParams, Light, Path, Pixel, ShadeParams, Surface, pixel,
};
use rayon::prelude::*;

/// Most rays of a wave, shadow rays counted: their buffers stay below 64 MiB.
const MOST_RAYS: u32 = 1 << 21;
/// Pixels of a tile.
const TILE: u32 = 64;
/// Farther than any corner from any eye.
const FARTHEST: f32 = 8.0 * LARGEST;

const PRIMARY: &str = "primary rays";
const SHADOW: &str = "shadow rays";
const SECONDARY: &str = "secondary rays";

/// Buffers of a wave.
struct Wave {
    paths: u32,
    rays: Buffer,
    hits: Buffer,
    shadow_rays: Buffer,
    shadow_hits: Buffer,
    lights: Buffer,
    states: Buffer,
    pixels: Buffer,
    surfaces: Buffer,
    /// Primary, shadow, secondary.
    counts: [Buffer; 3],
}

impl Wave {
    fn new(
        device: &mut dyn Device,
        scratch: &mut Scratch,
        settings: &RenderSettings,
        triangles: &[Triangle],
        range: &TraceRange,
    ) -> Result<Self, DeviceError> {
        let all = settings.width.div_ceil(8) * settings.height.div_ceil(8) * TILE;
        let paths = all.min((MOST_RAYS / settings.light_samples / TILE).max(1) * TILE);
        let shadow = (paths * settings.light_samples) as usize;
        let length = paths as usize;
        let mut buffer = |label, length, bytes| scratch.allocate(device, label, length, bytes);
        let chunks = |rays: usize| rays.div_ceil(COUNT_CHUNK as usize);
        let wave = Self {
            paths,
            rays: buffer("rays", length, size_of::<Ray>())?,
            hits: buffer("hits", length, size_of::<Hit>())?,
            shadow_rays: buffer("shadow rays", shadow, size_of::<Ray>())?,
            shadow_hits: buffer("shadow hits", shadow, size_of::<Hit>())?,
            lights: buffer("lights", shadow, size_of::<Light>())?,
            states: buffer("paths", length, size_of::<Path>())?,
            pixels: buffer("pixels", length, size_of::<Pixel>())?,
            surfaces: buffer("surfaces", triangles.len(), size_of::<Surface>())?,
            counts: [
                buffer("ray counts", chunks(length), size_of::<RayCounts>())?,
                buffer("ray counts", chunks(shadow), size_of::<RayCounts>())?,
                buffer("ray counts", chunks(length), size_of::<RayCounts>())?,
            ],
        };
        let surface =
            |t: &Triangle| Surface { a: range.point(t.a), b: range.point(t.b), c: range.point(t.c), normal: normal(t) };
        let surfaces: Vec<Surface> = triangles.par_iter().map(surface).collect();
        device.upload(&wave.surfaces, bytemuck::cast_slice(&surfaces))?;
        Ok(wave)
    }
}

/// The normal at length 1; 0 for a triangle without area.
fn normal(t: &Triangle) -> [f32; 3] {
    let minus = |a: [f32; 3], b: [f32; 3]| [0, 1, 2].map(|k| f64::from(a[k]) - f64::from(b[k]));
    let sides = [unit(minus(t.b, t.a)), unit(minus(t.c, t.a))];
    let [Some(b), Some(c)] = sides else { return [0.0; 3] };
    unit(cross(b, c)).map_or([0.0; 3], |n| n.map(|x| x as f32))
}

/// Sums over rays of one kind.
#[derive(Clone, Copy, Default)]
struct Sums {
    rays: u64,
    hits: u64,
    box_tests: u64,
    triangle_tests: u64,
    unfinished: u64,
}

impl Sums {
    fn add(&mut self, counts: &[RayCounts]) {
        for counts in counts {
            self.rays += u64::from(counts.rays);
            self.hits += u64::from(counts.hits);
            self.box_tests += u64::from(counts.box_tests);
            self.triangle_tests += u64::from(counts.triangle_tests);
            self.unfinished += u64::from(counts.unfinished);
        }
    }

    fn plus(self, other: Self) -> Self {
        Self {
            rays: self.rays + other.rays,
            hits: self.hits + other.hits,
            box_tests: self.box_tests + other.box_tests,
            triangle_tests: self.triangle_tests + other.triangle_tests,
            unfinished: self.unfinished + other.unfinished,
        }
    }

    fn cost(self, seconds: f64) -> RayCost {
        let per_ray = |tests: u64| if self.rays > 0 { tests as f64 / self.rays as f64 } else { 0.0 };
        RayCost {
            rays: self.rays,
            hits: self.hits,
            box_tests_per_ray: per_ray(self.box_tests),
            triangle_tests_per_ray: per_ray(self.triangle_tests),
            seconds,
            mrays_per_s: if seconds > 0.0 { self.rays as f64 * 1e-6 / seconds } else { 0.0 },
        }
    }
}

/// The picture, and the number of rays that took too many steps.
pub(super) fn render(
    device: &mut dyn Device,
    traced: &TraceScene,
    scene: &Scene,
    camera: &Camera,
    frame: &[[f32; 3]; 3],
    light: &AreaLight,
    settings: &RenderSettings,
) -> Result<(Rendering, u64), DeviceError> {
    let mut scratch = Scratch::default();
    let eye = traced.range().point(camera.eye);
    let result = Wave::new(device, &mut scratch, settings, &scene.triangles, traced.range()).and_then(|wave| {
        let stages = Stages { traced, wave: &wave, eye, frame, light, settings };
        stages.all(device)
    });
    scratch.free(device);
    result
}

struct Stages<'a> {
    traced: &'a TraceScene,
    wave: &'a Wave,
    eye: [f32; 3],
    frame: &'a [[f32; 3]; 3],
    light: &'a AreaLight,
    settings: &'a RenderSettings,
}

impl Stages<'_> {
    fn all(&self, device: &mut dyn Device) -> Result<(Rendering, u64), DeviceError> {
        let RenderSettings { width, height, samples, .. } = *self.settings;
        let length = width as usize * height as usize;
        let mut radiance = vec![[0.0f32; 3]; length];
        let mut tests = vec![0.0f32; length];
        let mut sums = [Sums::default(); 3];
        let mut timings = Vec::new();
        let all = width.div_ceil(8) * height.div_ceil(8) * TILE;
        for first in (0..all).step_by(self.wave.paths as usize) {
            let count = self.wave.paths.min(all - first);
            for sample in 0..samples {
                let mut recording = Recording::new();
                if sample == 0 {
                    recording.clear("film", &self.wave.pixels);
                }
                self.record_sample(&mut recording, first, count, sample);
                timings.extend(device.run(&recording)?);
                for (sums, buffer) in sums.iter_mut().zip(&self.wave.counts) {
                    let mut counts = vec![RayCounts::default(); buffer.length];
                    device.download(buffer, bytemuck::cast_slice_mut(&mut counts))?;
                    sums.add(&counts);
                }
            }
            let mut pixels: Vec<Pixel> = vec![bytemuck::Zeroable::zeroed(); count as usize];
            device.download(&self.wave.pixels, bytemuck::cast_slice_mut(&mut pixels))?;
            for (index, sum) in (first..).zip(&pixels) {
                let [x, y] = pixel(index, width);
                if x < width && y < height {
                    let at = y as usize * width as usize + x as usize;
                    radiance[at] = sum.radiance.map(|x| x / samples as f32);
                    tests[at] = (f64::from(sum.tests) / f64::from(samples)) as f32;
                }
            }
        }
        let seconds = |label| timings.iter().filter(|t: &&Timing| t.label == label).map(|t| t.seconds).sum::<f64>();
        let times = [PRIMARY, SHADOW, SECONDARY].map(seconds);
        let together = sums[0].plus(sums[1]).plus(sums[2]);
        let rendering = Rendering {
            width,
            height,
            radiance,
            tests,
            primary: sums[0].cost(times[0]),
            shadow: sums[1].cost(times[1]),
            secondary: sums[2].cost(times[2]),
            overall: together.cost(times.iter().sum()),
            timings,
        };
        Ok((rendering, together.unfinished))
    }

    /// One path for each of `count` pixels from `first` on.
    fn record_sample(&self, recording: &mut Recording, first: u32, count: u32, sample: u32) {
        let wave = self.wave;
        let RenderSettings { width, height, bounces, light_samples, .. } = *self.settings;
        let [forward, right, up] = *self.frame;
        let camera = CameraParams {
            count,
            first,
            width,
            height,
            sample,
            eye: self.eye,
            forward,
            right,
            up,
            per_pixel: [2.0 / width as f32, 2.0 / height as f32],
            t_max: FARTHEST,
        };
        for counts in &wave.counts {
            recording.clear("count", counts);
        }
        recording.dispatch("camera", Kernel::PathCamera, count, &camera, &[&wave.rays, &wave.states]);
        let shadow = count * light_samples;
        for bounce in 0..=bounces {
            let (label, counts) = if bounce == 0 { (PRIMARY, &wave.counts[0]) } else { (SECONDARY, &wave.counts[2]) };
            self.traced.record(recording, label, (&wave.rays, &wave.hits), count, Query::Closest);
            record_count(recording, count, [&wave.rays, &wave.hits, counts]);
            let buffers = [&wave.hits, &wave.surfaces, &wave.rays, &wave.states, &wave.shadow_rays, &wave.lights];
            let params = self.shade_params(count, sample, bounce);
            recording.dispatch("shade", Kernel::PathShade, count, &params, &buffers);
            self.traced.record(recording, SHADOW, (&wave.shadow_rays, &wave.shadow_hits), shadow, Query::Any);
            record_count(recording, shadow, [&wave.shadow_rays, &wave.shadow_hits, &wave.counts[1]]);
            let gather = GatherParams { count, light_samples };
            let buffers = [&wave.shadow_hits, &wave.lights, &wave.states];
            recording.dispatch("gather", Kernel::PathGather, count, &gather, &buffers);
        }
        recording.dispatch("film", Kernel::PathFilm, count, &FilmParams { count }, &[&wave.states, &wave.pixels]);
    }

    fn shade_params(&self, count: u32, sample: u32, bounce: u32) -> ShadeParams {
        let light_samples = self.settings.light_samples;
        ShadeParams {
            count,
            sample,
            bounce,
            ends: u32::from(bounce == self.settings.bounces),
            light_samples,
            t_max: FARTHEST,
            light: self.light.middle,
            light_u: self.light.u,
            light_v: self.light.v,
            light_normal: self.light.normal,
            light_power: self.light.power / light_samples as f32,
            up: self.light.normal,
            sky: self.light.sky,
        }
    }
}

fn record_count(recording: &mut Recording, rays: u32, buffers: [&Buffer; 3]) {
    let count = rays.div_ceil(COUNT_CHUNK);
    recording.dispatch("count", Kernel::CountRays, count, &CountParams { count, rays }, &buffers);
}
