//! `cargo xtask bench --parts`: time of every builder alone, of the collapse and of tracing, on every device. Each answer is checked: the
//! same tree hash or the same hits in every repetition and on every device, and valid trees only.

mod rays;
mod stages;

use clap::Parser;
use prbvh::build::check_limits;
use prbvh::device::Selection;
use prbvh::device::vulkan::VulkanDevice;
use prbvh::device::{Device, cpu::CpuDevice};
use prbvh::scene::{self, Scene};
use prbvh_lab::report::{Machine, Program};
use serde::Serialize;
use stages::Measured;
use std::path::PathBuf;

/// Measures builders, collapse and tracing.
#[derive(Debug, Parser)]
struct Arguments {
    /// Triangles of the built-in scene; 0 leaves it out.
    #[arg(long, default_value_t = 250_000)]
    triangles: usize,
    /// Only shared scenes whose name contains this; `none` for none of them.
    #[arg(long, default_value = "")]
    scenes: String,
    /// Repetitions on the CPU; the median is printed.
    #[arg(long, default_value_t = 5)]
    repeat: usize,
    /// Repetitions on Vulkan; 0 leaves it out.
    #[arg(long, default_value_t = 3)]
    repeat_vulkan: usize,
    /// Rays of each kind.
    #[arg(long, default_value_t = 1 << 20)]
    rays: usize,
    /// Also write the rows to this file, as JSON.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Given by `cargo bench`.
    #[arg(long, hide = true)]
    bench: bool,
}

/// A part on a scene and a device.
#[derive(Debug, Serialize)]
struct Row {
    scene: String,
    scene_hash: String,
    triangles: usize,
    device: String,
    #[serde(flatten)]
    measured: Measured,
}

fn main() {
    let arguments = Arguments::parse();
    let (machine, program) = (Machine::current(), Program::current());
    println!(
        "prbvh {} ({}), {}, {} cores, {}",
        program.version, program.commit, machine.cpu, machine.cores, machine.os
    );
    println!("\n| scene | triangles | device | part | ms | device ms | million a second | cost | answer |");
    println!("|---|--:|---|---|--:|--:|--:|--:|---|");
    let mut rows = Vec::new();
    if arguments.triangles > 0 {
        measure(&scene::built_in(arguments.triangles), &arguments, &mut rows);
    }
    for scene in prbvh_tests::scenes::loaded(&arguments.scenes) {
        measure(&scene, &arguments, &mut rows);
    }
    if let Some(path) = &arguments.json {
        let json = serde_json::to_string_pretty(&rows).expect("rows are plain data");
        std::fs::write(path, json).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
}

fn measure(scene: &Scene, arguments: &Arguments, rows: &mut Vec<Row>) {
    let mut cpu = CpuDevice::new(0).expect("threads");
    let on_cpu = stages::measure(&mut cpu, scene, arguments.repeat, arguments.rays);
    print(scene, &cpu, &on_cpu, rows);
    if arguments.repeat_vulkan == 0 {
        return;
    }
    let mut vulkan = match VulkanDevice::open(Selection::Automatic, false) {
        Ok(vulkan) => vulkan,
        Err(error) => return eprintln!("no Vulkan: {error}"),
    };
    if let Err(error) = check_limits(vulkan.info(), scene.triangles.len()) {
        return eprintln!("{error}");
    }
    let on_vulkan = stages::measure(&mut vulkan, scene, arguments.repeat_vulkan, arguments.rays);
    for (a, b) in on_cpu.iter().zip(&on_vulkan) {
        assert_eq!((&a.part, &a.answer), (&b.part, &b.answer), "{} on {}", scene.name, vulkan.info().name);
    }
    print(scene, &vulkan, &on_vulkan, rows);
}

fn print(scene: &Scene, device: &dyn Device, measured: &[Measured], rows: &mut Vec<Row>) {
    for m in measured {
        let triangles = scene.triangles.len();
        let device = &device.info().name;
        let rate = m.items as f64 / m.seconds / 1e6;
        let cost = m.cost.map_or(String::new(), |cost| format!("{cost:.3}"));
        println!(
            "| {} | {triangles} | {device} | {} | {:.1} | {:.1} | {rate:.2} | {cost} | {} |",
            scene.name,
            m.part,
            m.seconds * 1e3,
            m.device_s * 1e3,
            m.answer
        );
        let (scene, scene_hash) = (scene.name.clone(), scene.hash.clone());
        rows.push(Row { scene, scene_hash, triangles, device: device.clone(), measured: m.clone() });
    }
}
