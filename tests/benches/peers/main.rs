//! `cargo xtask bench --peers`: anytime curves, cost against wall time, of prbvh on the CPU and of obvhs on the same triangles and threads.

mod experiment;
mod ours;
mod table;
mod theirs;

use clap::Parser;
use experiment::{Effort, Experiment, Outcome};
use prbvh::bvh::SahModel;
use prbvh::device::cpu::CpuDevice;
use prbvh::scene::{self, Scene};
use prbvh_lab::reference::ReferenceCosts;
use prbvh_lab::report::Program;
use prbvh_tests::bench::machine;
use prbvh_tests::bench::obvhs::PROGRAM;
use prbvh_tests::bench::targets::SceneResult;
use serde::Serialize;
use std::path::PathBuf;

/// Measures anytime curves beside a peer.
#[derive(Debug, Parser)]
struct Arguments {
    /// Smallest built-in scene: 2^N triangles. Without --from and --to there is none.
    #[arg(long)]
    from: Option<u32>,
    /// Largest built-in scene: 2^N triangles.
    #[arg(long)]
    to: Option<u32>,
    /// Only shared scenes whose name contains this; `none` for none of them.
    #[arg(long, default_value = "")]
    scenes: String,
    /// Repetitions; medians are printed.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    repeat: u32,
    /// Repetitions of RBVH; 0 leaves it out.
    #[arg(long, default_value_t = 1)]
    repeat_slow: u32,
    /// Threads of both programs; 0: one per core.
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// Our runs end after the time of the slowest peer times this.
    #[arg(long, default_value_t = 2.0)]
    limit: f64,
    /// Our runs end by themselves, however long that takes: RBVH with undo takes minutes on a million triangles.
    #[arg(long, conflicts_with = "limit")]
    long: bool,
    /// Only this experiment.
    #[arg(long)]
    experiment: Option<Experiment>,
    /// Only our configurations whose name contains this.
    #[arg(long, default_value = "")]
    ours: String,
    /// Also write every point to this file, as JSON.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Given by `cargo bench`.
    #[arg(long, hide = true)]
    bench: bool,
}

/// A point of a curve.
#[derive(Debug, Serialize)]
struct Row<'a> {
    scene: &'a str,
    scene_hash: &'a str,
    triangles: usize,
    experiment: &'static str,
    program: String,
    setting: String,
    /// Runs that `time_s` is the median of.
    runs: usize,
    time_s: f64,
    cost: f64,
}

fn main() {
    let arguments = Arguments::parse();
    let mut device = CpuDevice::new(arguments.threads).expect("threads");
    let threads = prbvh::device::on_host(&device, rayon::current_num_threads);
    println!("{}, {threads} threads; peer: {PROGRAM}\n\n{}", machine::line(), table::METHOD);
    let effort = Effort {
        repeat: arguments.repeat as usize,
        repeat_slow: arguments.repeat_slow as usize,
        limit: (!arguments.long).then_some(arguments.limit),
        ours: arguments.ours.clone(),
    };
    let known = ReferenceCosts::embedded().unwrap_or_else(|error| panic!("{error}"));
    let experiments = match arguments.experiment {
        Some(experiment) => vec![experiment],
        None => vec![Experiment::SameTree, Experiment::Pipelines],
    };
    let mut results: Vec<(Experiment, SceneResult)> = Vec::new();
    let mut json = Vec::new();
    for scene in scenes(&arguments) {
        let scene = scene();
        for &experiment in &experiments {
            eprintln!("{}: {}", scene.name, experiment.name());
            let outcome = experiment::run(experiment, &scene, &mut device, &effort);
            println!("{}", table::outcome(&scene, &outcome, known.get(&scene.hash, &SahModel::default())));
            json.extend(rows(&scene, &outcome).map(|row| serde_json::to_value(row).expect("a row is plain data")));
            results.push((experiment, outcome.result));
        }
        // After each scene: a long run that is interrupted keeps what it has.
        if let Some(path) = &arguments.json {
            let text = serde_json::to_string_pretty(&json).expect("rows are plain data");
            std::fs::write(path, text).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        }
    }
    println!("{}", table::targets(&results));
}

/// The scenes, each made when its turn comes.
fn scenes(arguments: &Arguments) -> Vec<Box<dyn Fn() -> Scene>> {
    let mut scenes: Vec<Box<dyn Fn() -> Scene>> = Vec::new();
    if let Some(last) = arguments.to.or(arguments.from) {
        for exponent in arguments.from.unwrap_or(last)..=last {
            scenes.push(Box::new(move || {
                let mut scene = scene::built_in(1 << exponent);
                scene.name = format!("{} 2^{exponent}", scene.name);
                scene
            }));
        }
    }
    for path in prbvh_tests::scenes::shared() {
        if path.file_name().unwrap_or_default().to_string_lossy().contains(&arguments.scenes) {
            scenes.push(Box::new(move || scene::load(&path).unwrap_or_else(|error| panic!("{error}"))));
        }
    }
    scenes
}

/// Every point of both programs.
fn rows<'a>(scene: &'a Scene, outcome: &'a Outcome) -> impl Iterator<Item = Row<'a>> {
    let Program { name, version, commit, .. } = Program::current();
    let row = |program: String, setting: &str, runs, point: prbvh_tests::bench::curve::Point| Row {
        scene: &scene.name,
        scene_hash: &scene.hash,
        triangles: scene.triangles.len(),
        experiment: outcome.experiment.name(),
        program,
        setting: setting.to_owned(),
        runs,
        time_s: point.time_s,
        cost: point.cost,
    };
    let theirs = outcome.theirs.iter();
    let theirs = theirs.map(move |(setting, point, _)| row(PROGRAM.to_owned(), setting, outcome.repeat, *point));
    let ours = outcome.ours.iter().flat_map(move |ours| {
        let program = format!("{name} {version} ({commit})");
        let points = ours.curve.points.iter();
        points.map(move |point| row(program.clone(), &ours.curve.name, ours.repetitions, *point))
    });
    theirs.chain(ours)
}
