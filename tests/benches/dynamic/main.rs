//! `cargo xtask bench --dynamic`: a scene that is bent a little further in each frame. Its tree is refitted and made better within a budget, on every
//! device, beside obvhs on the same frames. Each tree is checked after the last frame, and its cost is set against that of a tree built for that frame.

mod peer;
mod stages;

use clap::Parser;
use prbvh::bvh::{Bvh, SahModel, quality, validate};
use prbvh::device::cpu::CpuDevice;
use prbvh::device::vulkan::VulkanDevice;
use prbvh::device::{Device, Selection};
use prbvh::optimize::{Budget, Reoptimizer};
use prbvh::pipeline::{self, Settings};
use prbvh::scene::{self, Scene, Triangle};
use prbvh_tests::bench::stats::median;
use prbvh_tests::bench::{frames, machine};
use stages::Stages;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// Measures a scene in motion.
#[derive(Debug, Parser)]
struct Arguments {
    /// Shared scenes whose name contains this; without one that is there, the built-in scene.
    #[arg(long, default_value = "bunny")]
    scenes: String,
    /// Frames.
    #[arg(long, default_value_t = 60)]
    frames: u32,
    /// Milliseconds of a step.
    #[arg(long, default_value_t = 1.0)]
    budget_ms: f64,
    /// Nodes that a step looks at, in place of a time: the same trees on every machine.
    #[arg(long)]
    visits: Option<u32>,
    /// Threads; 0 for one per core.
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// Leave Vulkan out.
    #[arg(long)]
    no_vulkan: bool,
    /// Leave obvhs out.
    #[arg(long)]
    no_peer: bool,
    /// Given by `cargo bench`.
    #[arg(long, hide = true)]
    bench: bool,
}

/// What became of a tree over the frames.
struct Measured {
    name: String,
    /// Medians of a frame, seconds.
    refit_s: f64,
    step_s: f64,
    /// The longest frame, seconds.
    most_s: f64,
    /// Cost after the last frame.
    cost: f64,
}

fn main() {
    let arguments = Arguments::parse();
    println!("{}", machine::line());
    let mut scenes: Vec<Scene> = prbvh_tests::scenes::loaded(&arguments.scenes).collect();
    if scenes.is_empty() {
        scenes.push(scene::built_in(70_000));
    }
    for scene in &scenes {
        measure(scene, &arguments);
    }
}

fn measure(scene: &Scene, arguments: &Arguments) {
    let time = |frame: u32| frame as f32 / arguments.frames.max(1) as f32;
    let frames: Vec<Vec<Triangle>> =
        (1..=arguments.frames.max(1)).map(|frame| frames::at(scene, time(frame))).collect();
    let last = &frames[frames.len() - 1];
    let mut cpu = CpuDevice::new(arguments.threads).expect("threads");
    let first_tree = built(scene, &mut cpu);
    let start = Instant::now();
    let rebuilt = cost_of(&built(&Scene::from_triangles("last frame", last.clone()).expect("finite"), &mut cpu), last);
    let rebuild_s = start.elapsed().as_secs_f64();
    let refitted = cost_of(&first_tree.clone().with_boxes_of(last), last);

    let budget =
        arguments.visits.map_or(Budget::Time(Duration::from_secs_f64(1e-3 * arguments.budget_ms)), Budget::Visits);
    let mut rows = vec![follow(&first_tree, scene, &frames, &mut cpu, budget)];
    if !arguments.no_vulkan {
        match VulkanDevice::open(Selection::Automatic, false) {
            Ok(mut vulkan) => rows.push(follow(&first_tree, scene, &frames, &mut vulkan, budget)),
            Err(error) => eprintln!("no Vulkan: {error}"),
        }
    }
    if !arguments.no_peer {
        rows.push(peer::follow(scene, &frames, arguments.threads));
    }
    let (triangles, count) = (scene.triangles.len(), frames.len());
    println!("\n{}: {triangles} triangles, {count} frames, {budget:?} a step", scene.name);
    println!(
        "rebuilt for the last frame: cost {rebuilt:.3} in {:.1} ms; refitted alone: {:.3}",
        1e3 * rebuild_s,
        refitted / rebuilt
    );
    println!(
        "\n| on | refit, ms | step, ms | a frame at most, ms | cost | to the rebuilt |\n|---|--:|--:|--:|--:|--:|"
    );
    for Measured { name, refit_s, step_s, most_s, cost } in rows {
        let ms = |seconds: f64| format!("{:.2}", 1e3 * seconds);
        let to = cost / rebuilt;
        println!("| {name} | {} | {} | {} | {cost:.3} | {to:.3} |", ms(refit_s), ms(step_s), ms(most_s));
    }
}

/// The best tree that the library makes.
fn built(scene: &Scene, device: &mut dyn Device) -> Bvh {
    let done = pipeline::optimize(scene, device, &Settings::default(), &mut |_| ControlFlow::Continue(()));
    done.unwrap_or_else(|error| panic!("{error}")).tree
}

/// Cost of a tree over the triangles, once it is known to be one.
fn cost_of(tree: &Bvh, triangles: &[Triangle]) -> f64 {
    validate(tree, Some(triangles)).unwrap_or_else(|faults| panic!("{}", prbvh::bvh::summary(&faults)));
    quality(tree, &SahModel::default()).sah_cost
}

fn follow(tree: &Bvh, scene: &Scene, frames: &[Vec<Triangle>], device: &mut dyn Device, budget: Budget) -> Measured {
    let name = device.info().name.clone();
    let device = &mut Stages::new(device);
    let mut run = || {
        let (mut refits, mut steps) = (Vec::new(), Vec::new());
        let mut moving = Reoptimizer::new(&mut *device as &mut dyn Device, tree, &scene.triangles)?;
        let bytes = moving.device().memory();
        for frame in frames {
            let start = Instant::now();
            moving.refit(frame)?;
            let refitted = start.elapsed();
            moving.step(budget)?;
            refits.push(refitted.as_secs_f64());
            steps.push((start.elapsed() - refitted).as_secs_f64());
        }
        assert_eq!(moving.device().memory(), bytes, "a frame allocates nothing");
        Ok::<_, prbvh::optimize::ReoptimizeError>((refits, steps, moving.tree()?))
    };
    let (refits, steps, tree) = run().unwrap_or_else(|error| panic!("{name}: {error}"));
    println!("{name}, ms of a frame: {}", device.line(frames.len()));
    let most_s = refits.iter().zip(&steps).map(|(refit, step)| refit + step).fold(0.0, f64::max);
    let cost = cost_of(&tree, &frames[frames.len() - 1]);
    Measured { name, refit_s: median(&refits), step_s: median(&steps), most_s, cost }
}
