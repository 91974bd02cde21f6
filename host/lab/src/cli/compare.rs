//! `prbvh compare`, and the process that it runs another library in.

use super::compare_args::{CompareArgs, DevicesChoice, PeerArgs};
use super::interrupt::Interrupt;
use super::log::Log;
use super::out_folder::OutFolder;
use super::overwrite::{outputs_in, refuse_overwrite};
use super::stdout::{columns, print};
use super::{check_max_depth, load_scene, print_error};
use anyhow::Context;
use prbvh::device::{self, Device, DeviceChoice, Selection, Stoppable, vulkan};
use prbvh::scene::Scene;
use prbvh::stop::Stop;
use prbvh::write::WriteError;
use prbvh_lab::compare::peers::{self, ServeError};
use prbvh_lab::compare::{self, CompareSettings, Comparison, MethodRow, NOT_RUN, PeerHost, Step};
use prbvh_lab::page;
use std::ffi::OsStr;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

/// Exit code of a program of Rust that panicked.
const PANICKED: u8 = 101;

pub(super) fn run(args: &CompareArgs, log: &Log, interrupt: &Interrupt) -> anyhow::Result<ExitCode> {
    let jobs = compare::jobs(&args.methods, &args.methods()).map_err(with_hint)?;
    let outputs = args.out.iter().flat_map(|folder| outputs_in(folder, is_output));
    refuse_overwrite(args.scenes.iter().map(|path| &**path), outputs)?;
    let stop = interrupt.stop();
    let mut devices = open(args, &stop)?;
    let triangles = |path| args.triangles.filter(|_| path == Path::new(super::BUILT_IN));
    anyhow::ensure!(
        args.triangles.is_none() || args.scenes.iter().any(|path| triangles(path).is_some()),
        "--triangles is for the built-in scene, which is not among those to compare"
    );
    let scenes: Vec<Scene> =
        args.scenes.iter().map(|path| load_scene(path, triangles(path), &args.read)).collect::<anyhow::Result<_>>()?;
    scenes.iter().try_for_each(|scene| check_max_depth(args.max_depth, scene).context(scene.name.clone()))?;
    let folder = args.out.as_deref().map(OutFolder::open).transpose()?;
    let settings = CompareSettings {
        jobs,
        repeat: args.repeat,
        threads: args.threads,
        max_depth: args.max_depth,
        rays: args.rays(),
        up: args.up as usize,
        pictures: args.out.is_some(),
        figures: args.figures,
        peers: Some(PeerHost {
            program: std::env::current_exe().context("the path of this program")?,
            timeout: Duration::try_from_secs_f64(args.peer_timeout).unwrap_or(Duration::MAX),
        }),
        stop,
    };

    let held = interrupt.hold();
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
    let written = folder.as_ref().map_or(Ok(Vec::new()), |folder| write(&comparison, folder.path()));
    // Nothing is lost any more, and who reads may be slow.
    drop((folder, held));
    let printed = if args.json {
        rows_as_json(&comparison).context("rows as JSON").and_then(|json| print(&json))
    } else {
        print_tables(&comparison)
    };
    // Not before: where the disk is full the user has at least the tables.
    for path in written? {
        tracing::info!("wrote {}", path.display());
    }
    printed?;
    judge(comparison.rows())
}

/// # Errors
/// If a method failed. That one was not run because of a signal is none.
fn judge<'a>(rows: impl Iterator<Item = &'a MethodRow>) -> anyhow::Result<ExitCode> {
    let (mut all, mut failed) = (0, Vec::new());
    for row in rows {
        all += 1;
        if row.status != "ok" && row.status != NOT_RUN {
            failed.push(row);
        }
    }
    let Some(first) = failed.first() else { return Ok(ExitCode::SUCCESS) };
    let MethodRow { scene, method, device, status, .. } = first;
    anyhow::bail!("{} of {all} rows failed, first {scene}: {method} on {device}: {status}", failed.len())
}

/// Whether a comparison may write a file of this name.
fn is_output(name: &OsStr) -> bool {
    let extension = Path::new(name).extension().and_then(OsStr::to_str);
    extension.is_some_and(|extension| ["json", "csv", "html", "svg", "png"].contains(&extension))
}

/// The numbers first: the page is made of them.
fn write(comparison: &Comparison, folder: &Path) -> Result<Vec<PathBuf>, WriteError> {
    let mut paths = comparison.write(folder)?;
    paths.extend(page::write(comparison, folder)?);
    Ok(paths)
}

/// Runs another library; the comparison reads the file that it leaves, or its last words.
pub(super) fn run_peer(args: &PeerArgs, interrupt: &Interrupt) -> ExitCode {
    // Ctrl-C reaches this process too: the first one is for the comparison, which waits for the tree.
    let _ignored = interrupt.hold();
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

/// The devices in the order of the arguments, each once. They run nothing once an end is asked for.
fn open(args: &CompareArgs, stop: &Stop) -> anyhow::Result<Vec<Box<dyn Device>>> {
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
                            .map(|device| DeviceChoice::Vulkan(Selection::Index(device.index))),
                    ),
                    Err(error) => tracing::warn!("only the CPU: {error}"),
                }
            }
        }
    }
    let mut devices: Vec<Box<dyn Device>> = Vec::new();
    for (k, choice) in choices.iter().enumerate() {
        if !choices[..k].contains(choice) {
            let device = device::open(*choice, args.threads, args.validate)?;
            devices.push(Box::new(Stoppable::new(device, stop)));
        }
    }
    Ok(devices)
}

fn tell(step: &Step, bar: &indicatif::ProgressBar) {
    let Step { scene, method, done, of, outcome } = step;
    match outcome {
        None => {
            tracing::debug!("{scene}: {method} begins");
            bar.set_message(format!("{scene}: {method}"));
        }
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

fn print_tables(comparison: &Comparison) -> anyhow::Result<()> {
    let columns = columns();
    for scene in &comparison.scenes {
        print(compare::table(scene, columns).trim_end())?;
        if let Some(errors) = compare::errors_table(scene, columns) {
            print(&format!("\n{}", errors.trim_end()))?;
        }
        for note in compare::notes(scene) {
            let text = console::style(note.text);
            print(&(if note.is_fault { text.red() } else { text }).to_string())?;
        }
        print("")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_row_is_told_and_one_that_was_not_run_is_none() {
        let row = |method: &str, status: &str| MethodRow {
            scene: "hall".into(),
            method: method.into(),
            device: "cpu".into(),
            status: status.into(),
            ..MethodRow::default()
        };
        let rows = [row("lbvh", "ok"), row("ploc", NOT_RUN)];
        assert!(judge(rows.iter()).is_ok());
        let rows = [row("lbvh", "ok"), row("ploc", "no memory"), row("rbvh", "no threads")];
        let error = judge(rows.iter()).unwrap_err().to_string();
        assert_eq!(error, "2 of 3 rows failed, first hall: ploc on cpu: no memory");
    }
}
