//! `prbvh optimize`, and `prbvh` alone.

use super::in_a_row;
use super::interrupt::Interrupt;
use super::log::Log;
use super::one_run::{Done, OUTPUTS, judge, optimized, other_inputs, settings_for, write};
use super::optimize_args::OptimizeArgs;
use super::out_folder::OutFolder;
use super::overwrite::refuse_overwrite;
use super::scenes::{Named, each_once};
use super::stdout::{columns, print};
use anyhow::Context;
use prbvh::device;
use prbvh::pipeline::Settings;
use prbvh_lab::accuracy;
use prbvh_lab::report::{self, RunReport};
use std::process::ExitCode;

pub(super) fn run(args: &OptimizeArgs, log: &Log, interrupt: &Interrupt) -> anyhow::Result<ExitCode> {
    let settings = args.settings()?;
    let scenes = args.scenes.named()?;
    match &scenes[..] {
        [scene] if !args.scenes.in_a_row() => alone(args, &settings, scene, log, interrupt),
        _ => in_a_row::run(args, &settings, &each_once(scenes), log, interrupt),
    }
}

fn alone(
    args: &OptimizeArgs,
    settings: &Settings,
    named: &Named,
    log: &Log,
    interrupt: &Interrupt,
) -> anyhow::Result<ExitCode> {
    let outputs = args.out.iter().flat_map(|folder| OUTPUTS.map(|name| folder.join(name)));
    refuse_overwrite([&*named.path].into_iter().chain(other_inputs(args, settings)), outputs)?;
    let mut device = device::open(args.device, args.threads, args.validate)?;
    let scene = named.load()?;
    let (settings, known) = settings_for(args, settings, &scene)?;
    let folder = args.out.as_deref().map(OutFolder::open).transpose()?;
    let Done { result, report, held } =
        optimized(args, &settings, &scene, known.as_ref(), &mut *device, (log, interrupt))?;
    let written = folder.as_ref().map_or(Ok(()), |folder| write(folder.path(), &scene, &result, &report));
    // Nothing is lost any more, and who reads may be slow.
    drop((folder, held));
    let printed = show(args, &report);
    // Not before: where the disk is full the user has at least the outcome.
    written?;
    printed?;
    judge(report.accuracy.as_ref())?;
    Ok(ExitCode::SUCCESS)
}

fn show(args: &OptimizeArgs, report: &RunReport) -> anyhow::Result<()> {
    if args.json {
        return print(&serde_json::to_string_pretty(report).context("report as JSON")?);
    }
    let columns = columns();
    print(&report::table(report, columns))?;
    match &report.accuracy {
        Some(accuracy) => print(accuracy::table(accuracy, columns).trim_end()),
        None => Ok(()),
    }
}
