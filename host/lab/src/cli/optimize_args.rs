//! The arguments of `prbvh optimize`, and the settings that they say.

use super::leaves::LeavesArgs;
use super::optimizer::{Beside, OptimizerArgs};
use super::preset::{self, PRESET_SETS};
use super::scenes::ScenesArgs;
use super::splits_args::SplitsArgs;
use super::target::TargetArgs;
use super::values::{not_negative, threads};
use super::wide_args::WideArgs;
use clap::builder::{OsStringValueParser, TypedValueParser};
use clap::{Args, ValueEnum};
use prbvh::build::{Bins, MortonBits, TreeletSize};
use prbvh::bvh::MaxDepth;
use prbvh::device::DeviceChoice;
use prbvh::optimize::{Epsilon, Order, Strategy};
use prbvh::pipeline::{Initial, Settings};
use prbvh_lab::presets::Preset;
use std::ffi::OsString;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};
use std::time::Duration;

#[derive(Debug, Args)]
pub(super) struct OptimizeArgs {
    #[command(flatten)]
    pub(super) scenes: ScenesArgs,
    /// Where the initial tree comes from: lbvh, ploc, atrbvh, trbvh, hploc, sah-sweep, sah-binned, sbvh, agglomerative, aac[:fast|:hq],
    /// kmeans[:q1 to :q5], insertion[:greedy], online, hunt, phr[:fast|:hq], or a tree.bvh over the same scene. Parameters
    /// may stand in place of a preset: aac:delta=8,epsilon=0.15, kmeans:k=16,p=5,i=5,seed=1, hunt:cut=50.
    #[arg(long, default_value = "lbvh", value_name = "BUILDER|FILE.bvh", value_parser = OsStringValueParser::new().try_map(initial))]
    pub(super) initial: Initial,
    /// Places in the list that a cluster of ploc or hploc looks to either side [default: 16; hploc: 8].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub(super) radius: Option<u32>,
    /// Leaves of the treelets that atrbvh restructures, 4 to 32 [default: 20].
    #[arg(long, value_name = "N", value_parser = treelet, allow_negative_numbers = true)]
    pub(super) treelet: Option<TreeletSize>,
    /// Most passes of trbvh over the treelets [default: 3].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub(super) passes: Option<u32>,
    /// Bins of an axis for sah-binned, 8 to 32 [default: 32].
    #[arg(long, value_name = "N", value_parser = bins, allow_negative_numbers = true)]
    pub(super) bins: Option<Bins>,
    /// Bits of the Morton codes that the initial tree is built from.
    #[arg(long, value_enum, default_value_t)]
    pub(super) morton_bits: MortonBitsArg,
    /// Of the published order: when a reinsertion may run beside others [default: aggressive].
    #[arg(long, value_enum)]
    pub(super) strategy: Option<StrategyArg>,
    /// Which nodes PRBVH searches first.
    #[arg(long, value_enum, default_value_t)]
    pub(super) order: OrderArg,
    /// Settings that were chosen by measurement, in place of those of the initial tree and the optimiser.
    #[arg(long, value_enum, conflicts_with_all = PRESET_SETS)]
    pub(super) preset: Option<Preset>,
    #[command(flatten)]
    pub(super) target: TargetArgs,
    #[command(flatten)]
    pub(super) optimizer: OptimizerArgs,
    /// Of the published order: search every µ-th node in an iteration; falls to 1 as the cost settles [default: 9].
    #[arg(long, value_name = "µ", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub(super) mu: Option<u32>,
    /// Of the published order: change of the cost that counts as none, as a part of the initial cost [default: 0.0001].
    #[arg(long, value_name = "PART", value_parser = not_negative, allow_negative_numbers = true)]
    pub(super) epsilon: Option<f64>,
    /// The same in the unit of the cost; the paper has 0.1.
    #[arg(long, value_name = "COST", value_parser = not_negative, allow_negative_numbers = true, conflicts_with = "epsilon")]
    pub(super) epsilon_absolute: Option<f64>,
    /// Start no iteration after this many seconds.
    #[arg(long, value_name = "SECONDS", value_parser = not_negative, allow_negative_numbers = true)]
    pub(super) max_time: Option<f64>,
    /// Most iterations, which are batches of RBVH [default: 1000; RBVH: 100000].
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(super) max_iterations: Option<u32>,
    /// Take triangles of equal boxes for one until the tree is optimised: faster, another tree of about the same cost.
    #[arg(long)]
    pub(super) fold_duplicates: bool,
    /// Most levels below the root, with one triangle per leaf: what is deeper is built anew; off or 0: no bound.
    #[arg(long, value_name = "LEVELS|off", default_value_t, allow_negative_numbers = true)]
    pub(super) max_depth: MaxDepth,
    #[command(flatten)]
    splits: SplitsArgs,
    #[command(flatten)]
    pub(super) leaves: LeavesArgs,
    #[command(flatten)]
    pub(super) wide: WideArgs,
    /// auto, cpu, vulkan or vulkan:N.
    #[arg(long, default_value_t, value_name = "DEVICE")]
    pub(super) device: DeviceChoice,
    /// Threads of the CPU device, and of what the host does for it; 0 for one per core.
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = threads, allow_negative_numbers = true)]
    pub(super) threads: usize,
    /// Write report.json, iterations.csv, convergence.svg and tree.bvh to this folder; with --width 4 or 8 wide.bvh, too.
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    /// Print one JSON object to stdout instead of the table; of many scenes one in a line for each.
    #[arg(long)]
    pub(super) json: bool,
    /// Compare the numbers of every iteration with f64: cost, predicted decrease, drift of the search. Takes a multiple of the time.
    #[arg(long)]
    pub(super) check_numerics: bool,
    /// Turn Vulkan's validation layer on.
    #[arg(long)]
    pub(super) validate: bool,
}

impl OptimizeArgs {
    /// The settings that the arguments say.
    ///
    /// # Errors
    /// If two arguments contradict each other.
    pub(super) fn settings(&self) -> anyhow::Result<Settings> {
        let mut asked = Settings::default();
        asked.optimizer = self.optimizer.settings(Beside {
            mu: self.mu.is_some(),
            epsilon: self.epsilon.is_some(),
            epsilon_absolute: self.epsilon_absolute.is_some(),
            strategy: self.strategy.is_some(),
            is_worst_first: self.order == OrderArg::WorstFirst,
        })?;
        asked.initial = self.initial()?;
        asked.morton_bits = match self.morton_bits {
            MortonBitsArg::Thirty => MortonBits::Thirty,
            MortonBitsArg::Sixty => MortonBits::Sixty,
        };
        asked.adaptive = self.leaves.settings();
        asked.wide = self.wide.settings()?;
        asked.fold_duplicates = self.fold_duplicates;
        asked.max_depth = self.max_depth;
        let prbvh = &mut asked.prbvh;
        prbvh.order = match self.order {
            OrderArg::WorstFirst => Order::WorstFirst,
            OrderArg::Published => Order::Published,
        };
        prbvh.strategy = match self.strategy.unwrap_or_default() {
            StrategyArg::Aggressive => Strategy::Aggressive,
            StrategyArg::Conservative => Strategy::Conservative,
        };
        prbvh.mu = self.mu.unwrap_or(prbvh.mu);
        prbvh.epsilon = match (self.epsilon, self.epsilon_absolute) {
            (_, Some(change)) => Epsilon::Absolute(change),
            (Some(part), None) => Epsilon::Relative(part),
            (None, None) => prbvh.epsilon,
        };
        let mut settings = match self.preset {
            Some(preset) => preset::applied(preset, asked),
            None => asked,
        };
        self.splits.apply(&mut settings)?;
        settings.check()?;
        if self.check_numerics && settings.splits() {
            anyhow::bail!("--check-numerics is for trees without splits, not with --presplit or --initial sbvh");
        }
        let limits = settings.limits_mut();
        limits.max_iterations = self.max_iterations.unwrap_or(limits.max_iterations);
        limits.max_time = self.max_time.map(|seconds| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX));
        Ok(settings)
    }

    fn initial(&self) -> anyhow::Result<Initial> {
        let mut initial = self.initial.clone();
        match (&mut initial, self.radius.and_then(NonZeroU32::new)) {
            (Initial::Ploc { radius } | Initial::Hploc { radius }, Some(asked)) => *radius = asked,
            (other, Some(_)) => anyhow::bail!("--radius is for --initial ploc or hploc, not for {other}"),
            (_, None) => {}
        }
        match (&mut initial, self.treelet) {
            (Initial::Atrbvh { treelet }, Some(asked)) => *treelet = asked,
            (other, Some(_)) => anyhow::bail!("--treelet is for --initial atrbvh, not for {other}"),
            (_, None) => {}
        }
        match (&mut initial, self.passes.and_then(NonZeroU32::new)) {
            (Initial::Trbvh { passes }, Some(asked)) => *passes = asked,
            (other, Some(_)) => anyhow::bail!("--passes is for --initial trbvh, not for {other}"),
            (_, None) => {}
        }
        match (&mut initial, self.bins) {
            (Initial::SahBinned { bins }, Some(asked)) => *bins = asked,
            (other, Some(_)) => anyhow::bail!("--bins is for --initial sah-binned, not for {other}"),
            (_, None) => {}
        }
        initial.check()?;
        Ok(initial)
    }
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum StrategyArg {
    /// If their links do not overlap.
    #[default]
    Aggressive,
    /// If their boxes do not overlap either: the cost never rises.
    Conservative,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum OrderArg {
    /// Those that look worst, few at first and then ever more of them; both children of each move.
    #[default]
    WorstFirst,
    /// All in turn, as published (Meister & Bittner 2018); single subtrees move.
    Published,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum MortonBitsArg {
    #[value(name = "30")]
    Thirty,
    #[default]
    #[value(name = "60")]
    Sixty,
}

fn initial(text: OsString) -> Result<Initial, String> {
    if let Some(named) = text.to_str().and_then(Initial::of_name) {
        return named.map_err(|error| error.to_string());
    }
    if Path::new(&text).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("bvh")) {
        return Ok(Initial::File { path: text.into() });
    }
    Err(format!("neither {} nor a tree file that ends in .bvh", Initial::NAMES))
}

fn treelet(text: &str) -> Result<TreeletSize, String> {
    let leaves = text.parse::<u32>().map_err(|error| error.to_string())?;
    TreeletSize::new(leaves).map_err(|error| error.to_string())
}

fn bins(text: &str) -> Result<Bins, String> {
    let bins = text.parse::<u32>().map_err(|error| error.to_string())?;
    Bins::new(bins).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::super::args::{Cli, settings};
    use super::*;
    use prbvh::build::{DEFAULT_HPLOC_RADIUS, DEFAULT_PASSES, DEFAULT_RADIUS};
    use prbvh::optimize::{PrbvhSettings, RbvhSettings};

    #[test]
    fn an_initial_tree_has_a_name_or_a_file() {
        let initial = |arguments: &str| settings(arguments).map(|settings| settings.initial);
        let ploc = |radius| Ok(Initial::Ploc { radius: NonZeroU32::new(radius).unwrap() });
        assert_eq!(initial(""), Ok(Initial::Lbvh));
        assert_eq!(initial("--initial lbvh"), Ok(Initial::Lbvh));
        assert_eq!(initial("--initial ploc"), ploc(DEFAULT_RADIUS.get()));
        assert_eq!(initial("--initial ploc --radius 10000"), ploc(10_000));
        // A program without the method refuses it here.
        let atrbvh = |leaves| {
            let initial = Initial::Atrbvh { treelet: TreeletSize::new(leaves).unwrap() };
            initial.check().map(|()| initial).map_err(|error| error.to_string())
        };
        assert_eq!(initial("--initial atrbvh"), atrbvh(20));
        assert_eq!(initial("--initial atrbvh --treelet 32"), atrbvh(32));
        let trbvh = |passes| {
            let initial = Initial::Trbvh { passes: NonZeroU32::new(passes).unwrap() };
            initial.check().map(|()| initial).map_err(|error| error.to_string())
        };
        assert_eq!(initial("--initial trbvh"), trbvh(3));
        assert_eq!(initial("--initial trbvh --passes 7"), trbvh(7));
        let hploc = |radius| Ok(Initial::Hploc { radius: NonZeroU32::new(radius).unwrap() });
        assert_eq!(initial("--initial hploc"), hploc(8));
        assert_eq!(initial("--initial hploc --radius 31"), hploc(31));
        let binned = |bins| Ok(Initial::SahBinned { bins: Bins::new(bins).unwrap() });
        assert_eq!(initial("--initial sah-sweep"), Ok(Initial::SahSweep));
        assert_eq!(initial("--initial sah-binned"), binned(32));
        assert_eq!(initial("--initial sah-binned --bins 8"), binned(8));
        assert_eq!(initial("--initial out/tree.BVH"), Ok(Initial::File { path: "out/tree.BVH".into() }));
        for name in [
            "lbvh",
            "ploc",
            "hploc",
            "sah-sweep",
            "sah-binned",
            "sbvh",
            "agglomerative",
            "aac:fast",
            "kmeans:q2",
            "hunt:cut=9",
            "a.bvh",
        ] {
            let arguments = format!("--initial {name}");
            assert_eq!(initial(&arguments).unwrap().to_string(), name);
        }
    }

    #[test]
    fn what_is_no_initial_tree_is_refused() {
        for (arguments, part) in [
            ("--initial kd", "sah-binned"),
            ("--initial aak", "agglomerative, aac, kmeans"),
            ("--initial aac:delta=0", "aac.delta is 0, but must be 2 to 65536"),
            ("--initial tree.obj", "ends in .bvh"),
            ("--initial ploc --radius 0", "0 is not in 1.."),
            ("--initial ploc --radius many", "many"),
            ("--radius 5", "--radius is for --initial ploc or hploc, not for lbvh"),
            ("--initial a.bvh --radius 5", "not for a.bvh"),
            ("--initial atrbvh --treelet 3", "a treelet has 4 to 32 leaves, not 3"),
            ("--initial atrbvh --treelet 33", "a treelet has 4 to 32 leaves, not 33"),
            ("--initial atrbvh --treelet -1", "invalid digit"),
            ("--passes 7", "--passes is for --initial trbvh, not for lbvh"),
            ("--initial trbvh --passes 0", "0 is not in 1.."),
            ("--initial sah-sweep --bins 8", "--bins is for --initial sah-binned, not for sah-sweep"),
            ("--initial sah-binned --bins 7", "an axis has 8 to 32 bins, not 7"),
            ("--treelet 7", "--treelet is for --initial atrbvh, not for lbvh"),
        ] {
            let error = settings(arguments).unwrap_err();
            assert!(error.contains(part), "{arguments}: {error}");
        }
    }

    #[test]
    fn the_help_names_the_defaults() {
        use clap::CommandFactory;
        let mut command = Cli::command();
        let help = command.find_subcommand_mut("optimize").unwrap().render_long_help().to_string();
        let radius = format!("[default: {DEFAULT_RADIUS}; hploc: {DEFAULT_HPLOC_RADIUS}]");
        assert!(help.contains(&radius), "{help}");
        let mu = PrbvhSettings::default().mu;
        for default in [TreeletSize::DEFAULT.get(), DEFAULT_PASSES.get(), Bins::DEFAULT.get(), mu] {
            assert!(help.contains(&format!("[default: {default}]")), "{help}");
        }
        let (prbvh, rbvh) = (PrbvhSettings::default(), RbvhSettings::default());
        let most = format!("[default: {}; RBVH: {}]", prbvh.limits.max_iterations, rbvh.limits.max_iterations);
        assert!(help.contains(&most), "{help}");
    }
}
