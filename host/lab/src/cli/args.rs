//! What the command line can say.

use super::compare_args::{CompareArgs, PeerArgs};
use super::optimize_args::OptimizeArgs;
use super::plan::PlanArgs;
use super::read_args::ReadArgs;
use super::render_args::RenderArgs;
use super::stability::StabilityArgs;
use super::values::BUILT_IN;
use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// Makes the bounding volume hierarchy of a triangle scene better, by parallel reinsertion (Meister & Bittner 2018).
///
/// Without a command: optimises the built-in scene on the best device and writes a report to `prbvh-report`.
#[derive(Debug, Parser)]
#[command(name = "prbvh", version, about, long_about)]
pub(super) struct Cli {
    /// Say less: -q only warnings, -qq only errors.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub(super) quiet: u8,
    /// Say more.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub(super) verbose: u8,
    #[command(subcommand)]
    pub(super) command: Option<Command>,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Build a tree over a scene and optimise it; over many scenes one after another.
    Optimize(Box<OptimizeArgs>),
    /// What `optimize` with the same arguments would take and leave out, and why; of several scenes, how that differs.
    Plan(Box<PlanArgs>),
    /// Trace rays through the tree of a scene: a picture, and what its rays cost.
    Render(Box<RenderArgs>),
    /// The methods of the paper against each other: cost, rays per second, time, memory.
    Compare(Box<CompareArgs>),
    /// Build a tree with another library, in a process of its own.
    #[command(hide = true)]
    Peer(PeerArgs),
    /// Run every method on generated scenes that break numbers, on every device, and say what held.
    Stability(StabilityArgs),
    /// Read a `tree.bvh` back, validate it and say what it is worth.
    Stats(StatsArgs),
    /// List the devices and the limits that matter.
    Devices(DevicesArgs),
}

#[derive(Debug, Args)]
pub(super) struct StatsArgs {
    /// The tree.
    pub(super) tree: PathBuf,
    /// The scene that the tree was built over: checks triangles and leaf boxes too.
    #[arg(long)]
    pub(super) scene: Option<PathBuf>,
    /// Size of the built-in scene, if that is the scene.
    #[arg(long, value_name = "N", requires = "scene", allow_negative_numbers = true)]
    pub(super) triangles: Option<usize>,
    #[command(flatten)]
    pub(super) read: ReadArgs,
    /// Print one JSON object.
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
pub(super) struct DevicesArgs {
    /// What each driver makes of the kernels, where it tells: registers, spills, occupancy, instructions.
    #[arg(long)]
    pub(super) kernels: bool,
    /// Print one JSON object.
    #[arg(long)]
    pub(super) json: bool,
}

/// What `prbvh` without a command does.
pub(super) fn main_job() -> OptimizeArgs {
    let Cli { command, .. } = Cli::parse_from(["prbvh", "optimize", BUILT_IN, "--out", "prbvh-report"]);
    match command {
        Some(Command::Optimize(args)) => *args,
        _ => unreachable!("the arguments above say `optimize`"),
    }
}

/// What `prbvh optimize` with these arguments does, for tests.
#[cfg(test)]
pub(super) fn settings(arguments: &str) -> Result<prbvh::pipeline::Settings, String> {
    let arguments = ["prbvh", "optimize"].into_iter().chain(arguments.split_whitespace());
    let cli = Cli::try_parse_from(arguments).map_err(|error| error.to_string())?;
    let Some(Command::Optimize(args)) = cli.command else { panic!("`optimize` was said") };
    args.settings().map_err(|error| error.to_string())
}
