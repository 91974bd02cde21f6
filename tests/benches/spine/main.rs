//! `cargo xtask bench`: time, memory and cost of the spine on the built-in scene from 2^14 triangles up and on the shared scenes, on every
//! device, beside obvhs on the same triangles. Each run checks its answer: the tree hash is the same in every repetition and on every
//! device, the tree is valid, and the device's cost agrees with the f64 referee.

mod peer;
mod table;

use clap::Parser;
use peer::PeerMeasured;
use prbvh::build::check_limits;
use prbvh::device::Selection;
use prbvh::device::vulkan::VulkanDevice;
use prbvh::device::{Device, cpu::CpuDevice};
use prbvh::pipeline::Settings;
use prbvh::scene::{self, Scene};
use prbvh_tests::bench::machine;
use prbvh_tests::bench::runs::{self, Measured};
use serde::Serialize;
use std::path::PathBuf;

/// Measures the spine.
#[derive(Debug, Parser)]
struct Arguments {
    /// Smallest built-in scene: 2^N triangles.
    #[arg(long, default_value_t = 14)]
    from: u32,
    /// Largest built-in scene: 2^N triangles.
    #[arg(long, default_value_t = 20)]
    to: u32,
    /// Only shared scenes whose name contains this; `none` for none of them.
    #[arg(long, default_value = "")]
    scenes: String,
    /// Repetitions on the CPU; the median is printed.
    #[arg(long, default_value_t = 5)]
    repeat: usize,
    /// Repetitions on Vulkan; 0 leaves it out.
    #[arg(long, default_value_t = 3)]
    repeat_vulkan: usize,
    /// Leave obvhs out.
    #[arg(long)]
    no_peer: bool,
    /// Also write the rows to this file, as JSON.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Given by `cargo bench`.
    #[arg(long, hide = true)]
    bench: bool,
}

/// All that was measured on a scene.
#[derive(Debug, Serialize)]
struct Row {
    scene: String,
    scene_hash: String,
    triangles: usize,
    devices: Vec<Measured>,
    obvhs: Option<PeerMeasured>,
}

fn main() {
    let arguments = Arguments::parse();
    println!("{}", machine::line());
    let mut rows = Vec::new();
    for exponent in arguments.from..=arguments.to {
        rows.push(measure(&scene::built_in(1 << exponent), &arguments));
    }
    let built_in = rows.len();
    for scene in prbvh_tests::scenes::loaded(&arguments.scenes) {
        rows.push(measure(&scene, &arguments));
    }
    println!("\n{}", table::spine(&rows));
    println!("{}", table::phases(&rows));
    println!("{}", table::peers(&rows));
    println!("{}", table::growth(&rows[..built_in]));
    if let Some(path) = &arguments.json {
        let json = serde_json::to_string_pretty(&rows).expect("rows are plain data");
        std::fs::write(path, json).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
}

fn measure(scene: &Scene, arguments: &Arguments) -> Row {
    eprintln!("{} ({} triangles)", scene.name, scene.triangles.len());
    let mut cpu = CpuDevice::new(0).expect("threads");
    let settings = Settings::default();
    let mut devices = vec![runs::measure(&mut cpu, scene, &settings, arguments.repeat)];
    if arguments.repeat_vulkan > 0 {
        match VulkanDevice::open(Selection::Automatic, false) {
            Ok(mut vulkan) => match check_limits(vulkan.info(), scene.triangles.len()) {
                Ok(()) => {
                    let measured = runs::measure(&mut vulkan, scene, &settings, arguments.repeat_vulkan);
                    assert_eq!(devices[0].tree_hash, measured.tree_hash, "{} on {}", scene.name, vulkan.info().name);
                    devices.push(measured);
                }
                Err(error) => eprintln!("  {error}"),
            },
            Err(error) => eprintln!("  no Vulkan: {error}"),
        }
    }
    let obvhs = (!arguments.no_peer).then(|| peer::measure(scene, arguments.repeat));
    Row { scene: scene.name.clone(), scene_hash: scene.hash.clone(), triangles: scene.triangles.len(), devices, obvhs }
}
