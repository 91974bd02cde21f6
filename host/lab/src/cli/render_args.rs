//! What can be said to `prbvh render`.

use super::leaves::LeavesArgs;
use super::read_args::ReadArgs;
use super::values::{BUILT_IN, threads};
use super::wide_args::WideArgs;
use clap::{Args, ValueEnum};
use prbvh::device::DeviceChoice;
use prbvh_lab::render::RenderSettings;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct RenderArgs {
    /// OBJ, PLY, STL, glTF or GLB file (also .xz, .gz, .zst), `-` for standard input, or `built-in`.
    #[arg(default_value = BUILT_IN)]
    pub(super) scene: PathBuf,
    /// Size of the built-in scene.
    #[arg(long, value_name = "N")]
    pub(super) triangles: Option<usize>,
    #[command(flatten)]
    pub(super) read: ReadArgs,
    /// A tree of the scene, binary or wide, as `prbvh optimize --out` writes it; of a binary one --width and --layout make a wide one [default: one is built and optimised].
    #[arg(long, value_name = "FILE", conflicts_with_all = ["leaves", "max_leaf", "c_traversal", "c_intersect"])]
    pub(super) tree: Option<PathBuf>,
    #[command(flatten)]
    pub(super) leaves: LeavesArgs,
    #[command(flatten)]
    pub(super) wide: WideArgs,
    /// The picture, a PNG file.
    #[arg(short, long, value_name = "FILE", default_value = "render.png")]
    pub(super) out: PathBuf,
    /// Columns and rows of the picture.
    #[arg(long, value_name = "WxH", default_value = "1024x768", value_parser = size)]
    pub(super) size: [u32; 2],
    /// Paths per pixel.
    #[arg(long, value_name = "N", default_value_t = RenderSettings::default().samples)]
    pub(super) samples: u32,
    /// Times that a path goes on after the first surface.
    #[arg(long, value_name = "N", default_value_t = RenderSettings::default().bounces)]
    pub(super) bounces: u32,
    /// Shadow rays per surface hit.
    #[arg(long, value_name = "N", default_value_t = RenderSettings::default().light_samples)]
    pub(super) light_samples: u32,
    /// Show the number of tests per primary ray instead of light.
    #[arg(long)]
    pub(super) heat_map: bool,
    /// 0: from outside; 1: inside, along the scene; 2: inside, from a corner.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(..3))]
    pub(super) view: u32,
    /// The eye instead of the view's.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    pub(super) eye: Option<[f32; 3]>,
    /// Point in the middle of the picture instead of the view's.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    pub(super) look_at: Option<[f32; 3]>,
    /// Axis that points up.
    #[arg(long, value_enum, default_value_t)]
    pub(super) up: AxisArg,
    /// Angle between left and right edge instead of the view's, degrees.
    #[arg(long, value_name = "DEGREES")]
    pub(super) fov: Option<f32>,
    /// auto, cpu, vulkan or vulkan:N.
    #[arg(long, default_value_t, value_name = "DEVICE")]
    pub(super) device: DeviceChoice,
    /// Threads of the CPU device; 0 for one per core.
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = threads)]
    pub(super) threads: usize,
    /// Print one JSON object to stdout instead of the table.
    #[arg(long)]
    pub(super) json: bool,
    /// Turn Vulkan's validation layer on.
    #[arg(long)]
    pub(super) validate: bool,
}

impl RenderArgs {
    /// The settings that the arguments say.
    pub(super) fn settings(&self) -> RenderSettings {
        let [width, height] = self.size;
        let Self { samples, bounces, light_samples, .. } = *self;
        RenderSettings { width, height, samples, bounces, light_samples }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum AxisArg {
    X,
    #[default]
    Y,
    Z,
}

pub(super) fn size(text: &str) -> Result<[u32; 2], String> {
    let side = |text: &str| text.parse::<u32>().ok().filter(|side| (1..=prbvh_lab::render::MAX_SIDE).contains(side));
    match text.split_once('x').map(|(width, height)| [side(width), side(height)]) {
        Some([Some(width), Some(height)]) => Ok([width, height]),
        _ => Err(format!(
            "not two numbers from 1 to {} with an x between, such as 1024x768",
            prbvh_lab::render::MAX_SIDE
        )),
    }
}

fn point(text: &str) -> Result<[f32; 3], String> {
    let numbers: Vec<f32> =
        text.split(',').filter_map(|x| x.trim().parse().ok()).filter(|x: &f32| x.is_finite()).collect();
    match (numbers[..].try_into(), text.split(',').count()) {
        (Ok(point), 3) => Ok(point),
        _ => Err("not three numbers with commas between, such as 1,0.5,-2".to_owned()),
    }
}
