//! The arguments of `prbvh compare`, and of the process of a peer.

use super::read_args::ReadArgs;
use super::render_args::{AxisArg, size};
use super::values::{BUILT_IN, not_negative, threads};
use clap::{Args, ValueEnum};
use prbvh::bvh::MaxDepth;
use prbvh::device::DeviceChoice;
use prbvh_lab::compare::{MethodSettings, PAPER_RADIUS, RaySettings};
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::str::FromStr;

#[derive(Debug, Args)]
pub(super) struct CompareArgs {
    /// OBJ, PLY, STL, glTF or GLB files (also .xz, .gz, .zst), or `built-in`.
    #[arg(default_value = BUILT_IN, num_args = 1.., value_name = "SCENE")]
    pub(super) scenes: Vec<PathBuf>,
    /// Size of the built-in scene.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) triangles: Option<usize>,
    #[command(flatten)]
    pub(super) read: ReadArgs,
    /// Methods, with commas between [default: all].
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(super) methods: Vec<String>,
    /// First µ of PRBVH, a row each.
    #[arg(long, value_name = "µ", value_delimiter = ',', default_value = "1,4,9", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub(super) mu: Vec<u32>,
    /// Places in the Morton order that a cluster of ploc looks to either side; the paper has 100.
    #[arg(long, value_name = "N", default_value_t = PAPER_RADIUS.get(), value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub(super) radius: u32,
    /// Most levels below the root of trees that prbvh makes, with one triangle per leaf; off: no bound.
    #[arg(long, value_name = "LEVELS|off", default_value_t, allow_negative_numbers = true)]
    pub(super) max_depth: MaxDepth,
    /// auto, cpu, vulkan or vulkan:N, with commas between, or all: a row for each.
    #[arg(long, value_name = "DEVICES", value_delimiter = ',', default_value = "auto")]
    pub(super) device: Vec<DevicesChoice>,
    /// Runs of each method, which take turns; times are their medians.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000), allow_negative_numbers = true)]
    pub(super) repeat: u32,
    /// Threads of the CPU device, of builders on the host and of other libraries; 0 for one per core.
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = threads, allow_negative_numbers = true)]
    pub(super) threads: usize,
    /// Whether rays are traced.
    #[arg(long, value_enum, default_value_t, value_name = "WHETHER")]
    pub(super) rays: Switch,
    /// Columns and rows of a view; the paper has 1024x768.
    #[arg(long, value_name = "WxH", default_value = "512x384", value_parser = size)]
    pub(super) size: [u32; 2],
    /// Paths per pixel; the paper has 8.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=65_536))]
    pub(super) samples: u32,
    /// Times that a path goes on after the first surface; the paper's paths have depth 8.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(..=64))]
    pub(super) bounces: u32,
    /// Shadow rays per surface hit; the paper has 2.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=16))]
    pub(super) light_samples: u32,
    /// Views of each scene, the first of those of `prbvh render --view`.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=3))]
    pub(super) views: u32,
    /// Axis that points up.
    #[arg(long, value_enum, default_value_t)]
    pub(super) up: AxisArg,
    /// Longest time of another library on a scene.
    #[arg(long, value_name = "SECONDS", default_value = "60", value_parser = not_negative, allow_negative_numbers = true)]
    pub(super) peer_timeout: f64,
    /// Also make the runs that only the figures show: more µ, strategies, initial trees.
    #[arg(long)]
    pub(super) figures: bool,
    /// Write compare.json and compare.csv to this folder.
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    /// Print one JSON object with the rows to stdout instead of the tables.
    #[arg(long)]
    pub(super) json: bool,
    /// Turn Vulkan's validation layer on.
    #[arg(long)]
    pub(super) validate: bool,
}

impl CompareArgs {
    pub(super) fn methods(&self) -> MethodSettings {
        let mut mu = Vec::new();
        for &value in &self.mu {
            if !mu.contains(&value) {
                mu.push(value);
            }
        }
        MethodSettings { mu, radius: NonZeroU32::new(self.radius).unwrap_or(PAPER_RADIUS) }
    }

    /// None where no rays are to be traced.
    pub(super) fn rays(&self) -> Option<RaySettings> {
        let Self { samples, bounces, light_samples, views, size: [width, height], .. } = *self;
        let rays = RaySettings { width, height, samples, bounces, light_samples, views };
        (self.rays == Switch::On).then_some(rays)
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Switch {
    #[default]
    On,
    Off,
}

/// A device, or all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DevicesChoice {
    All,
    One(DeviceChoice),
}

impl FromStr for DevicesChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "all" => Ok(Self::All),
            _ => text.parse().map(Self::One).map_err(|error: prbvh::device::NoSuchChoice| format!("{error}; or all")),
        }
    }
}

/// What [`prbvh_lab::compare::peers::serve`] takes.
#[derive(Debug, Args)]
pub(super) struct PeerArgs {
    pub(super) method: String,
    #[arg(long)]
    pub(super) scene_file: PathBuf,
    #[arg(long)]
    pub(super) out: PathBuf,
    #[arg(long, default_value_t = 0)]
    pub(super) threads: usize,
}
