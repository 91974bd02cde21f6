//! `cargo xtask bench --wide`: binary trees, nodes of four and eight children and compressed ones, with and without presplits, on the same rays of paths, beside the two of obvhs. Every ray
//! must hit what it hits through the binary tree; of obvhs, whose test of a triangle is another one, nearly every ray. With `--costs` nothing is timed: wide SAH costs of
//! the optimal and the greedy collapse, and sizes, for trees of our optimiser, of a full sweep and of obvhs.

mod costs;
mod kinds;
mod peer;
mod traced;

use clap::Parser;
use prbvh::bvh::Bvh;
use prbvh::device::cpu::CpuDevice;
use prbvh::pipeline::{Initial, Optimizer, Settings, optimize};
use prbvh::scene::{Scene, built_in};
use prbvh_tests::bench::machine;
use std::ops::ControlFlow;

/// Measures wide trees.
#[derive(Debug, Parser)]
struct Arguments {
    /// Only shared scenes whose name contains this; `none` for the built-in scene alone.
    #[arg(long, default_value = "")]
    scenes: String,
    /// Triangles of the built-in scene; 0 leaves it out.
    #[arg(long, default_value_t = 1 << 16)]
    triangles: usize,
    /// Primary rays; of the other kinds there are about as many or twice.
    #[arg(long, default_value_t = 200_000)]
    rays: usize,
    /// Repetitions; the median is printed.
    #[arg(long, default_value_t = 5)]
    repeat: usize,
    /// Costs and sizes alone, no times.
    #[arg(long)]
    costs: bool,
    /// Given by `cargo bench`.
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() {
    let arguments = Arguments::parse();
    let own = (arguments.triangles > 0).then(|| built_in(arguments.triangles));
    let scenes = own.into_iter().chain(prbvh_tests::scenes::loaded(&arguments.scenes));
    if arguments.costs {
        println!("{}", costs::table(scenes));
        return;
    }
    println!("{}", machine::line());
    println!("{}", traced::table(scenes, arguments.rays, arguments.repeat));
}

/// The tree of these settings, one triangle per leaf.
fn tree(scene: &Scene, settings: &Settings) -> Bvh {
    let mut device = CpuDevice::new(0).expect("threads");
    optimize(scene, &mut device, settings, &mut |_| ControlFlow::Continue(())).expect("the scene is good").tree
}

/// The tree of a full sweep.
fn sweep(scene: &Scene) -> Bvh {
    let settings = Settings::default().with(|s| {
        s.initial = Initial::SahSweep;
        s.optimizer = Optimizer::None;
    });
    tree(scene, &settings)
}
