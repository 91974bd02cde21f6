//! `cargo xtask bench --plan`: every omission that keeps the tree, with and without it in turn. The trees must be the same, bit for bit.

use clap::Parser;
use prbvh::bvh::tree_hash;
use prbvh::collapse::CollapseSettings;
use prbvh::compare::median;
use prbvh::device::{self, Device, DeviceChoice};
use prbvh::optimize::{Limits, PrbvhSettings};
use prbvh::pipeline::{Optimized, Settings, optimize_by};
use prbvh::plan::{Omission, Plan};
use prbvh::report::{Machine, Program};
use prbvh::scene::{self, Scene};
use prbvh_tests::fixtures::{flat, grid, soup};
use std::ops::ControlFlow;
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

fn main() {
    let arguments = Arguments::parse();
    let mut device = device::open(arguments.device, 0, false).unwrap_or_else(|error| panic!("{error}"));
    let (machine, program) = (Machine::current(), Program::current());
    println!("prbvh {} ({}), {} cores, on {}", program.version, program.commit, machine.cores, device.info().name);
    println!("\nBuild and collapse of the initial tree, medians of {}.", arguments.repeat.max(1));
    println!(
        "\n| scene | triangles | left out | without it, ms | with it, ms | saved, ms | bytes saved | plan, ms | tree |"
    );
    println!("|---|--:|---|--:|--:|--:|--:|--:|---|");
    let made = [
        ("soup of 1,000", soup(1000, 0.1, 1)),
        ("flat soup", flat(50_000)),
        ("grid", grid(200)),
        ("copies", soup(1, 0.1, 1).repeat(100_000)),
    ];
    for (name, triangles) in made {
        let scene = Scene::from_triangles(name, triangles).unwrap_or_else(|error| panic!("{error}"));
        measure(&scene, &mut *device, arguments.repeat);
    }
    if arguments.triangles > 0 {
        measure(&scene::built_in(arguments.triangles), &mut *device, arguments.repeat);
    }
    for scene in prbvh_tests::scenes::loaded(&arguments.scenes) {
        measure(&scene, &mut *device, arguments.repeat);
    }
}

/// The initial tree, and its collapse to leaves of one triangle: all that the omissions are in.
fn settings() -> Settings {
    let adaptive = CollapseSettings { max_leaf: Some(1), ..CollapseSettings::default() };
    let prbvh = PrbvhSettings { limits: Limits::iterations(0), ..PrbvhSettings::default() };
    Settings { adaptive: Some(adaptive), prbvh, ..Settings::default() }
}

/// One way of a comparison.
struct Way<'a> {
    keep: &'a [Omission],
    seconds: Vec<f64>,
    plan_seconds: Vec<f64>,
    last: Option<Optimized>,
}

impl<'a> Way<'a> {
    fn new(keep: &'a [Omission]) -> Self {
        Self { keep, seconds: Vec::new(), plan_seconds: Vec::new(), last: None }
    }

    fn run(&mut self, scene: &Scene, device: &mut dyn Device) {
        let settings = settings();
        let start = Instant::now();
        let plan = Plan::of(scene, device.info(), &settings, self.keep).expect("it fits");
        self.plan_seconds.push(start.elapsed().as_secs_f64());
        let made = optimize_by(plan, scene, device, &settings, &mut |_| ControlFlow::Continue(()))
            .unwrap_or_else(|error| panic!("{}: {error}", scene.name));
        let collapse: f64 = made.collapse_timings.iter().map(|timing| timing.seconds).sum();
        self.seconds.push(made.build_s + collapse);
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

fn measure(scene: &Scene, device: &mut dyn Device, repetitions: usize) {
    for omission in [Omission::LowerCodes, Omission::EqualBits, Omission::Collapse] {
        let keep = [omission];
        let mut ways = [Way::new(&[]), Way::new(&keep)];
        for repetition in 0..=repetitions.max(1) {
            for way in &mut ways {
                way.run(scene, device);
                if repetition == 0 {
                    // The first run of either way warms up.
                    way.seconds.clear();
                    way.plan_seconds.clear();
                }
            }
            let hashes = ways.each_ref().map(|way| tree_hash(&way.last().tree));
            assert_eq!(hashes[0], hashes[1], "{}: {omission:?} changes the tree", scene.name);
        }
        let [left_out, kept] = &mut ways;
        if left_out.last().plan.codes == kept.last().plan.codes
            && left_out.last().plan.collapses == kept.last().plan.collapses
        {
            println!("| {} | {} | {omission:?}: needed | | | | | | |", scene.name, scene.triangles.len());
            continue;
        }
        let [with, without] =
            [&left_out.seconds, &kept.seconds].map(|seconds| median(seconds).unwrap_or(f64::NAN) * 1e3);
        println!(
            "| {} | {} | {omission:?} | {with:.3} | {without:.3} | {:.3} | {} | {:.3} | {} |",
            scene.name,
            scene.triangles.len(),
            without - with,
            kept.bytes() - left_out.bytes(),
            median(&left_out.plan_seconds).unwrap_or(f64::NAN) * 1e3,
            tree_hash(&left_out.last().tree)
        );
    }
}
