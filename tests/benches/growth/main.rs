//! `cargo xtask bench --growth`: how time falls with threads, how time and memory grow with triangles, and what limits the search.

mod limits;
mod process;
mod scaling;
mod table;

use clap::Parser;
use limits::{Memory, Search};
use prbvh::build::{DEFAULT_RADIUS, TreeletSize};
use prbvh::device::cpu::CpuDevice;
use prbvh::pipeline::{Initial, Settings};
use prbvh::scene::{self, Scene};
use prbvh_tests::bench::machine;
use scaling::Row;
use serde::Serialize;
use std::path::PathBuf;

/// Measures scaling, growth and limits.
#[derive(Debug, Parser)]
struct Arguments {
    /// Smallest built-in scene: 2^N triangles.
    #[arg(long, default_value_t = 14)]
    from: u32,
    /// Largest built-in scene: 2^N triangles.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=24))]
    to: u32,
    /// Only shared scenes whose name contains this, for threads and limits; `none` for none of them.
    #[arg(long, default_value = "")]
    scenes: String,
    /// Repetitions; medians are printed.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    repeat: u32,
    /// Builder of the initial tree.
    #[arg(long, value_enum, default_value_t = Builder::Lbvh)]
    initial: Builder,
    /// Leave out what limits the search.
    #[arg(long)]
    no_limits: bool,
    /// Also write all rows to this file, as JSON.
    #[arg(long)]
    json: Option<PathBuf>,
    /// For the processes whose memory is measured.
    #[arg(long, hide = true)]
    peak_of: Option<u32>,
    /// Given by `cargo bench`.
    #[arg(long, hide = true)]
    bench: bool,
}

/// Builder of the initial tree, as it is by default.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Builder {
    Lbvh,
    Ploc,
    Atrbvh,
}

impl Builder {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Lbvh => "lbvh",
            Self::Ploc => "ploc",
            Self::Atrbvh => "atrbvh",
        }
    }

    fn settings(self) -> Settings {
        let initial = match self {
            Self::Lbvh => Initial::Lbvh,
            Self::Ploc => Initial::Ploc { radius: DEFAULT_RADIUS },
            Self::Atrbvh => Initial::Atrbvh { treelet: TreeletSize::default() },
        };
        Settings::default().with(|s| s.initial = initial)
    }
}

/// All that was measured.
#[derive(Debug, Default, Serialize)]
struct Everything {
    rows: Vec<Row>,
    memory: Vec<Memory>,
    searches: Vec<Search>,
}

fn main() {
    let arguments = Arguments::parse();
    let settings = arguments.initial.settings();
    if let Some(exponent) = arguments.peak_of {
        return process::child(exponent, &settings);
    }
    println!("{}; {} and PRBVH as by default\n", machine::line(), arguments.initial.name());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = scaling::thread_counts(cores);
    let mut everything = Everything::default();
    let mut device = CpuDevice::new(0).unwrap_or_else(|error| panic!("{error}"));
    if !arguments.no_limits {
        everything.memory = limits::memory(&device, arguments.repeat as usize);
    }
    let mut measure = |scene: &Scene, exponent: Option<u32>, has_limits: bool| {
        eprintln!("{} ({} triangles)", scene.name, scene.triangles.len());
        let process_bytes = exponent.and_then(|exponent| process::peak_bytes(exponent, arguments.initial));
        for (threads, measured) in scaling::measure(scene, &settings, &threads, arguments.repeat as usize) {
            everything.rows.push(Row {
                scene: scene.name.clone(),
                scene_hash: scene.hash.clone(),
                triangles: scene.triangles.len(),
                is_built_in: exponent.is_some(),
                threads,
                process_bytes: process_bytes.filter(|_| threads == cores),
                measured,
            });
        }
        if has_limits && !arguments.no_limits {
            let searches = limits::searches(scene, &mut device, &everything.memory, arguments.repeat as usize);
            everything.searches.extend(searches);
        }
    };
    for exponent in arguments.from..=arguments.to {
        measure(&scene::built_in(1 << exponent), Some(exponent), exponent == arguments.to);
    }
    for path in prbvh_tests::scenes::shared() {
        if path.file_name().unwrap_or_default().to_string_lossy().contains(&arguments.scenes) {
            measure(&scene::load(&path).unwrap_or_else(|error| panic!("{error}")), None, true);
        }
    }
    let Everything { rows, memory, searches } = &everything;
    println!("### Runs\n\n{}", table::runs(rows));
    println!("### Threads: time on one ÷ time on several\n\n{}", table::speedups(rows));
    println!("### Growth with all threads\n\n{}", table::growth(rows));
    if !arguments.no_limits {
        println!("### Memory of the machine, 32-byte reads by all threads at once\n\n{}", table::memory(memory));
        println!("### Search of all nodes once, beside what the memory allows\n\n{}", table::searches(searches));
    }
    println!("### Targets\n\n{}", table::targets(rows));
    if let Some(path) = &arguments.json {
        let json = serde_json::to_string_pretty(&everything).expect("rows are plain data");
        std::fs::write(path, json).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
}
