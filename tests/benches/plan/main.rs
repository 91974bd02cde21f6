//! `cargo xtask bench --plan`: every omission that keeps the tree, with and without it in turn, and what each is worth over all scenes. Fails if
//! two trees are not the same, bit for bit.

use clap::Parser;
use prbvh::bvh::tree_hash;
use prbvh::collapse::CollapseSettings;
use prbvh::device::{self, Device, DeviceChoice};
use prbvh::optimize::{Limits, PrbvhSettings};
use prbvh::pipeline::{Optimized, Settings, optimize_by};
use prbvh::plan::{Omission, Plan, Status};
use prbvh::scene::{self, Scene};
use prbvh_lab::report::{Machine, Program};
use prbvh_tests::bench::stats::median;
use prbvh_tests::fixtures::{flat, grid, soup};
use prbvh_tests::hidden::Hidden;
use prbvh_tests::omissions::{Measured, summary};
use std::ops::ControlFlow;
use std::process::ExitCode;
use std::time::Instant;

/// Measures what is left out.
#[derive(Debug, Parser)]
struct Arguments {
    /// Triangles of the built-in scene; 0 leaves it out.
    #[arg(long, default_value_t = 250_000)]
    triangles: usize,
    /// Only shared scenes whose name contains this; `none` for none of them.
    #[arg(long, default_value = "")]
    scenes: String,
    /// Repetitions of either way; the median is printed.
    #[arg(long, default_value_t = 5)]
    repeat: usize,
    /// auto, cpu, vulkan or vulkan:N.
    #[arg(long, default_value_t)]
    device: DeviceChoice,
    /// Given by `cargo bench`.
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let mut device = device::open(arguments.device, 0, false).unwrap_or_else(|error| panic!("{error}"));
    let (machine, program) = (Machine::current(), Program::current());
    println!("prbvh {} ({}), {} cores, on {}", program.version, program.commit, machine.cores, device.info().name);
    println!("\nBuild and collapse of the initial tree, iterations for locks; medians of {}.", arguments.repeat.max(1));
    println!(
        "\n| scene | triangles | left out | without it, ms | with it, ms | saved, ms | bytes without | with | tree |"
    );
    println!("|---|--:|---|--:|--:|--:|--:|--:|---|");
    let made = [
        ("soup of 1,000", soup(1000, 0.1, 1)),
        ("flat soup", flat(50_000)),
        ("grid", grid(200)),
        ("copies", soup(1, 0.1, 1).repeat(100_000)),
    ];
    let mut scenes: Vec<Box<dyn Fn() -> Scene>> = Vec::new();
    for (name, triangles) in made {
        scenes.push(Box::new(move || {
            Scene::from_triangles(name, triangles.clone()).unwrap_or_else(|error| panic!("{error}"))
        }));
    }
    if arguments.triangles > 0 {
        scenes.push(Box::new(|| scene::built_in(arguments.triangles)));
    }
    for path in prbvh_tests::scenes::shared() {
        if path.file_name().unwrap_or_default().to_string_lossy().contains(&arguments.scenes) {
            scenes.push(Box::new(move || scene::load(&path).unwrap_or_else(|error| panic!("{error}"))));
        }
    }
    let mut rows = Vec::new();
    let mut plans = Vec::new();
    for scene in scenes {
        let scene = scene();
        let (measured, plan_seconds) = measure(&scene, &mut *device, arguments.repeat);
        let of_scene: f64 = measured.iter().map(|row| row.seconds[1] - row.seconds[0]).sum();
        rows.extend(measured);
        plans.push((scene.name.clone(), plan_seconds, of_scene));
    }
    println!("\n| scene | plan, ms | saved by it, ms |\n|---|--:|--:|");
    for (name, plan, saved) in plans {
        println!("| {name} | {:.3} | {:.3} |", plan * 1e3, saved * 1e3);
    }
    let (text, is_same) = summary(&rows);
    println!("\n{text}");
    if is_same { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// What is measured with and without. Other omissions change the algorithm, or cost nothing but bytes, which a plan says.
const MEASURED: [Omission; 4] = [Omission::LowerCodes, Omission::EqualBits, Omission::Collapse, Omission::LockWord];

/// Iterations for locks.
const ITERATIONS: u32 = 9;

/// The initial tree and its collapse to leaves of one triangle; iterations for the locks, which are in nothing else.
fn settings(omission: Omission) -> Settings {
    let adaptive = CollapseSettings::default().with(|s| s.max_leaf = Some(1));
    let iterations = if omission == Omission::LockWord { ITERATIONS } else { 0 };
    let prbvh = PrbvhSettings::default().with(|s| s.limits = Limits::iterations(iterations));
    Settings::default().with(|s| {
        s.adaptive = Some(adaptive);
        s.prbvh = prbvh;
    })
}

/// One way of a comparison.
struct Way {
    omission: Omission,
    is_kept: bool,
    seconds: Vec<f64>,
    plan_seconds: Vec<f64>,
    last: Option<Optimized>,
}

impl Way {
    fn new(omission: Omission, is_kept: bool) -> Self {
        Self { omission, is_kept, seconds: Vec::new(), plan_seconds: Vec::new(), last: None }
    }

    fn run(&mut self, scene: &Scene, device: &mut dyn Device) {
        if self.is_kept && self.omission == Omission::LockWord {
            self.run_on(scene, &mut Hidden::narrow(device));
        } else {
            self.run_on(scene, device);
        }
    }

    fn run_on(&mut self, scene: &Scene, device: &mut dyn Device) {
        let settings = settings(self.omission);
        let keep = if self.is_kept { vec![self.omission] } else { Vec::new() };
        let start = Instant::now();
        let plan = Plan::of(scene, device.info(), &settings, &keep).expect("it fits");
        self.plan_seconds.push(start.elapsed().as_secs_f64());
        let made = optimize_by(plan, scene, device, &settings, &mut |_| ControlFlow::Continue(()))
            .unwrap_or_else(|error| panic!("{}: {error}", scene.name));
        let collapse: f64 = made.collapse_timings.iter().map(|timing| timing.seconds).sum();
        let seconds = if self.omission == Omission::LockWord { made.optimize_s } else { made.build_s + collapse };
        self.seconds.push(seconds);
        self.last = Some(made);
    }

    fn last(&self) -> &Optimized {
        self.last.as_ref().expect("it ran")
    }

    fn bytes(&self) -> u64 {
        let phases = self.last().plan.phases.iter().filter(|phase| phase.runs);
        phases.map(|phase| phase.peak_bytes).max().unwrap_or(0)
    }
}

/// Prints a row per omission; returns them and the median time of a plan, seconds.
fn measure(scene: &Scene, device: &mut dyn Device, repetitions: usize) -> (Vec<Measured>, f64) {
    let mut rows = Vec::new();
    let mut plan_seconds = Vec::new();
    for omission in MEASURED {
        let mut ways = [Way::new(omission, false), Way::new(omission, true)];
        for repetition in 0..=repetitions.max(1) {
            for way in &mut ways {
                way.run(scene, device);
                if repetition == 0 {
                    // The first run of either way warms up.
                    way.seconds.clear();
                    way.plan_seconds.clear();
                }
            }
        }
        let [left_out, kept] = &mut ways;
        plan_seconds.append(&mut left_out.plan_seconds);
        let item = left_out.last().plan.items.iter().find(|item| item.omission == omission);
        if item.is_none_or(|item| item.status != Status::LeftOut) {
            println!("| {} | {} | {omission}: needed | | | | | | |", scene.name, scene.triangles.len());
            continue;
        }
        let row = Measured {
            scene: scene.name.clone(),
            triangles: scene.triangles.len(),
            omission,
            seconds: [median(&left_out.seconds), median(&kept.seconds)],
            bytes: [left_out.bytes(), kept.bytes()],
            hashes: [tree_hash(&left_out.last().tree), tree_hash(&kept.last().tree)],
        };
        println!("{}", row.row());
        rows.push(row);
    }
    (rows, median(&plan_seconds))
}
