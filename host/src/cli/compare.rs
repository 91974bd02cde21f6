//! `prbvh compare`, and the process that it runs another library in.

use super::compare_args::{CompareArgs, DevicesChoice, PeerArgs};
use super::interrupt::Interrupt;
use super::log::Log;
use super::optimize::{DEFAULT_COLUMNS, check_folder};
use super::{load_scene, print, print_error};
use anyhow::Context;
use prbvh::compare::peers::{self, ServeError};
use prbvh::compare::{self, CompareSettings, Comparison, MethodRow, NOT_RUN, PeerHost, Step};
use prbvh::device::{self, Device, DeviceChoice, vulkan};
use prbvh::report::page;
use prbvh::report::write::WriteError;
use prbvh::scene::Scene;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

/// Exit code of a program of Rust that panicked.
const PANICKED: u8 = 101;

pub(super) fn run(args: &CompareArgs, log: &Log) -> anyhow::Result<ExitCode> {
    let jobs = compare::jobs(&args.methods, &args.methods()).map_err(with_hint)?;
    let interrupt = Interrupt::listen();
    let mut devices = open(args)?;
    let triangles = |path| args.triangles.filter(|_| path == Path::new(super::BUILT_IN));
    anyhow::ensure!(
        args.triangles.is_none() || args.scenes.iter().any(|path| triangles(path).is_some()),
        "--triangles is for the built-in scene, which is not among those to compare"
    );
    let scenes: Vec<Scene> =
        args.scenes.iter().map(|path| load_scene(path, triangles(path), &args.read)).collect::<anyhow::Result<_>>()?;
    if let Some(folder) = &args.out {
        check_folder(folder)?;
    }
    let settings = CompareSettings {
        jobs,
        repeat: args.repeat,
        threads: args.threads,
        rays: args.rays(),
        up: args.up as usize,
        pictures: args.out.is_some(),
        figures: args.figures,
        peers: Some(PeerHost {
            program: std::env::current_exe().context("the path of this program")?,
            timeout: Duration::try_from_secs_f64(args.peer_timeout).unwrap_or(Duration::MAX),
        }),
    };

    let bar = log.steps();
    let comparison = compare::compare(&scenes, &mut devices, &settings, &mut |step| {
        bar.set_length(step.of as u64);
        bar.set_position(step.done as u64);
        tell(step, &bar);
        if interrupt.pressed() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    log.end_bar();
    if interrupt.pressed() {
        tracing::warn!("interrupted: what was measured before is all there is");
    }
    let written = args.out.as_deref().map_or(Ok(Vec::new()), |folder| write(&comparison, folder));
    if args.json {
        print(&rows_as_json(&comparison).context("rows as JSON")?);
    } else {
        print_tables(&comparison);
    }
    // Not before: where the disk is full the user has at least the tables.
    for path in written? {
        tracing::info!("wrote {}", path.display());
    }
    let is_well = comparison.rows().all(|row| row.status == "ok" || row.status == NOT_RUN);
    Ok(if is_well { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The numbers first: the page is made of them.
fn write(comparison: &Comparison, folder: &Path) -> Result<Vec<PathBuf>, WriteError> {
    let mut paths = comparison.write(folder)?;
    paths.extend(page::write(comparison, folder)?);
    Ok(paths)
}

/// Runs another library; the comparison reads the file that it leaves, or its last words.
pub(super) fn run_peer(args: &PeerArgs) -> ExitCode {
    // Ctrl-C reaches this process too: the first one is for the comparison, which waits for the tree.
    let _ignored = Interrupt::listen();
    match peers::serve(&args.method, &args.scene_file, &args.out, args.threads) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let panicked = matches!(error, ServeError::Panicked(_));
            print_error(&super::told_once(&error.into()));
            if panicked { ExitCode::from(PANICKED) } else { ExitCode::FAILURE }
        }
    }
}

fn with_hint(error: compare::NoSuchMethod) -> anyhow::Error {
    let needs_peers = ["obvhs", "bvh"].contains(&error.name.as_str());
    let hint = if needs_peers { "; other libraries need a build with `--features peers`" } else { "" };
    anyhow::anyhow!("--methods: {error}{hint}")
}

/// The devices in the order of the arguments, each once.
fn open(args: &CompareArgs) -> anyhow::Result<Vec<Box<dyn Device>>> {
    let mut choices: Vec<DeviceChoice> = Vec::new();
    for choice in &args.device {
        match choice {
            DevicesChoice::One(choice) => choices.push(*choice),
            DevicesChoice::All => {
                choices.push(DeviceChoice::Cpu);
                match vulkan::list_devices() {
                    Ok(found) => choices.extend(
                        found
                            .iter()
                            .filter(|device| device.is_usable())
                            .map(|device| DeviceChoice::Vulkan(vulkan::Selection::Index(device.index))),
                    ),
                    Err(error) => tracing::warn!("only the CPU: {error}"),
                }
            }
        }
    }
    let mut devices: Vec<Box<dyn Device>> = Vec::new();
    for (k, choice) in choices.iter().enumerate() {
        if !choices[..k].contains(choice) {
            devices.push(device::open(*choice, args.threads, args.validate)?);
        }
    }
    Ok(devices)
}

fn tell(step: &Step, bar: &indicatif::ProgressBar) {
    let Step { scene, method, done, of, outcome } = step;
    match outcome {
        None => bar.set_message(format!("{scene}: {method}")),
        Some(Ok(cost)) => tracing::info!("{done:3} of {of}  {scene}: {method}: cost {cost:.3}"),
        Some(Err(why)) => tracing::warn!("{done:3} of {of}  {scene}: {method}: {why}"),
    }
}

fn rows_as_json(comparison: &Comparison) -> serde_json::Result<String> {
    let rows: Vec<&MethodRow> = comparison.rows().collect();
    let notes = comparison.scenes.iter().map(|scene| serde_json::json!({ "scene": scene.name, "notes": scene.notes }));
    serde_json::to_string_pretty(&serde_json::json!({
        "schema": comparison.schema,
        "machine": comparison.machine,
        "program": comparison.program,
        "devices": comparison.devices,
        "repeat": comparison.repeat,
        "rays": comparison.rays,
        "notes": notes.collect::<Vec<_>>(),
        "rows": rows,
    }))
}

fn print_tables(comparison: &Comparison) {
    let columns = console::Term::stdout().size_checked().map_or(DEFAULT_COLUMNS, |(_, columns)| columns);
    for scene in &comparison.scenes {
        print(compare::table(scene, columns).trim_end());
        if let Some(errors) = compare::errors_table(scene, columns) {
            print(&format!("\n{}", errors.trim_end()));
        }
        for note in compare::notes(scene) {
            let text = console::style(note.text);
            print(&(if note.is_fault { text.red() } else { text }).to_string());
        }
        print("");
    }
}
