//! `prbvh stability`.

use super::interrupt::Interrupt;
use super::stdout::print;
use super::values::threads;
use anyhow::Context;
use clap::Args;
use prbvh::device::DeviceChoice;
use prbvh_lab::report::{Machine, Program};
use prbvh_lab::stability::{self, CATALOGUE, Lane, Library, Row};
use std::ops::ControlFlow;
use std::process::ExitCode;

#[derive(Debug, Args)]
pub(super) struct StabilityArgs {
    /// Devices with commas between, each auto, cpu, vulkan or vulkan:N; or all: the CPU and every Vulkan device that can run prbvh.
    #[arg(long, default_value = "all", value_name = "DEVICES", value_parser = devices)]
    device: Devices,
    /// Only these methods, with commas between.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    methods: Vec<String>,
    /// Only these cases, with commas between.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    cases: Vec<String>,
    /// The large size of the cases that have one: a million triangles.
    #[arg(long)]
    full: bool,
    /// Print the cases and methods, and run nothing.
    #[arg(long)]
    list: bool,
    /// Threads of the CPU device; 0 for one per core.
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = threads)]
    threads: usize,
    /// Print one JSON object to stdout instead of the table.
    #[arg(long)]
    json: bool,
    /// Turn Vulkan's validation layer on.
    #[arg(long)]
    validate: bool,
}

#[derive(Clone, Debug)]
enum Devices {
    All,
    Named(Vec<DeviceChoice>),
}

fn devices(text: &str) -> Result<Devices, String> {
    if text == "all" {
        return Ok(Devices::All);
    }
    let named = text.split(',').map(|name| name.parse::<DeviceChoice>().map_err(|error| format!("{error}; or all")));
    named.collect::<Result<_, _>>().map(Devices::Named)
}

pub(super) fn run(args: &StabilityArgs, interrupt: &Interrupt) -> anyhow::Result<ExitCode> {
    let cases = chosen("--cases", &args.cases, CATALOGUE.to_vec(), |case| case.name)?;
    let mut methods = chosen("--methods", &args.methods, stability::methods(), |method| method.name)?;
    if args.list {
        print(stability::listing(&cases, &methods, args.full).trim_end())?;
        return Ok(ExitCode::SUCCESS);
    }
    let stop = interrupt.stop();
    let mut lanes: Vec<Lane> = open(args)?.into_iter().map(|lane| lane.stoppable(&stop)).collect();
    for method in &mut methods {
        method.settings.limits_mut().stop = Some(stop.clone());
    }
    for lane in &lanes {
        tracing::info!("{}: {}", lane.name, lane.info().name);
    }
    let held = interrupt.hold();
    let mut done = 0;
    let per_case = methods.len() * lanes.len();
    let rows = stability::run(&cases, &methods, &mut lanes, args.full, &Library, &mut |rows: &[Row]| {
        if interrupt.pressed() {
            return ControlFlow::Break(());
        }
        done += rows.len();
        for row in rows.iter().filter(|row| !row.is_green()) {
            tracing::warn!("{}, {}, {}: red", row.case, row.method, row.device);
        }
        if done.is_multiple_of(per_case) {
            let case = rows.first().map_or("", |row| &row.case);
            tracing::info!("{case}: case {} of {}", done / per_case, cases.len());
        }
        ControlFlow::Continue(())
    })?;
    drop(held);
    let red = rows.iter().filter(|row| !row.is_green()).count();
    let is_whole = rows.len() == cases.len() * per_case;
    if args.json {
        let devices: Vec<_> = lanes.iter().map(|lane| (&lane.name, lane.info())).collect();
        let json = serde_json::json!({
            "schema": stability::SCHEMA,
            "machine": Machine::current(),
            "program": Program::current(),
            "devices": devices,
            "f32_cost_bound": stability::F32_COST_BOUND,
            "axes_bound": stability::AXES_BOUND,
            "dual_axes_bound": stability::DUAL_AXES_BOUND,
            "complete": is_whole,
            "red": red,
            "rows": rows,
        });
        print(&serde_json::to_string_pretty(&json).context("rows as JSON")?)?;
    } else {
        print(stability::table(&rows).trim_end())?;
        print(stability::summary(&rows).trim_end())?;
    }
    anyhow::ensure!(is_whole, "interrupted: {} of {} rows", rows.len(), cases.len() * per_case);
    Ok(exit_code(red))
}

fn exit_code(red: usize) -> ExitCode {
    if red == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Those of `all` that were named, in their own order; all where none was.
fn chosen<T>(
    option: &str,
    names: &[String],
    mut all: Vec<T>,
    name: impl Fn(&T) -> &'static str,
) -> anyhow::Result<Vec<T>> {
    if let Some(unknown) = names.iter().find(|text| all.iter().all(|one| name(one) != text.as_str())) {
        let known: Vec<&str> = all.iter().map(name).collect();
        anyhow::bail!("{option} {unknown}: there are {}", known.join(", "));
    }
    all.retain(|one| names.is_empty() || names.iter().any(|text| text == name(one)));
    Ok(all)
}

fn open(args: &StabilityArgs) -> anyhow::Result<Vec<Lane>> {
    match &args.device {
        Devices::All => {
            let (lanes, unusable) = Lane::all(args.threads, args.validate)?;
            for reason in unusable {
                tracing::warn!("not in the table: {reason}");
            }
            Ok(lanes)
        }
        Devices::Named(choices) => {
            let open = |&choice| Lane::open(choice, args.threads, args.validate);
            Ok(choices.iter().map(open).collect::<Result<_, _>>()?)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_red_row_is_a_failure() {
        assert_eq!(exit_code(0), ExitCode::SUCCESS);
        assert!([1, 256, 594].iter().all(|&red| exit_code(red) == ExitCode::FAILURE));
    }

    #[test]
    fn devices_have_names() {
        let count = |text| match devices(text) {
            Ok(Devices::Named(named)) => Some(named.len()),
            Ok(Devices::All) => None,
            Err(error) => panic!("{error}"),
        };
        assert_eq!((count("all"), count("cpu"), count("cpu,vulkan:1,auto")), (None, Some(1), Some(3)));
        assert!(devices("").is_err() && devices("cpu,").is_err() && devices("cpu,all").is_err());
    }
}
