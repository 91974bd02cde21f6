//! `prbvh plan`.

use super::check_max_depth;
use super::optimize_args::OptimizeArgs;
use super::scenes::Named;
use super::stdout::{columns, print};
use anyhow::Context;
use clap::Args;
use prbvh::device::{self, Device};
use prbvh::pipeline::Settings;
use prbvh::plan::Plan;
use prbvh::scene::{self, Scene};
use prbvh_lab::plan;
use prbvh_lab::stability::CATALOGUE;
use serde_json::{Value, json};
use std::process::ExitCode;

/// The arguments of `prbvh optimize`, of which only those count that a plan follows.
#[derive(Debug, Args)]
pub(super) struct PlanArgs {
    #[command(flatten)]
    optimize: OptimizeArgs,
    /// The scenes of `prbvh stability` too.
    #[arg(long)]
    catalogue: bool,
}

/// Says what `prbvh optimize` would do.
pub(super) fn run(args: &PlanArgs) -> anyhow::Result<ExitCode> {
    let PlanArgs { optimize, catalogue } = args;
    anyhow::ensure!(optimize.out.is_none(), "--out is for `prbvh optimize`: a plan writes no files");
    let settings = optimize.settings()?;
    let device = device::open(optimize.device, optimize.threads, optimize.validate)?;
    let scenes = optimize.scenes.named()?;
    if let ([scene], false) = (&scenes[..], catalogue) {
        return one(optimize, scene, &*device, &settings);
    }
    let mut plans = Vec::new();
    let mut jsons = Vec::new();
    let mut add = |scene: &Scene| -> anyhow::Result<()> {
        check_max_depth(settings.max_depth, scene)?;
        let plan = Plan::of(scene, device.info(), &settings, &[])?;
        if optimize.json {
            jsons.push(to_json(scene, &plan, &*device));
        }
        plans.push((scene.name.clone(), plan));
        Ok(())
    };
    for scene in &scenes {
        add(&scene.load()?)?;
    }
    if *catalogue {
        for case in CATALOGUE {
            add(&Scene::from_finite(case.name, case.triangles(false))?.0)?;
        }
    }
    if optimize.json {
        let kinds = plan::kinds(&plans.iter().map(|(_, plan)| plan).collect::<Vec<_>>());
        let different = kinds.iter().max().copied().unwrap_or(0);
        let json = json!({ "different": different, "kinds": kinds, "plans": jsons });
        print(&serde_json::to_string_pretty(&json).context("plans as JSON")?)?;
    } else {
        print(&format!("on {}", device.info().name))?;
        print(&plan::overview(&plans, columns()))?;
    }
    plans.iter().try_for_each(|(name, plan)| plan.check(device.info()).with_context(|| name.clone()))?;
    Ok(ExitCode::SUCCESS)
}

/// One scene, with its census, its phases, and why each decision is as it is.
fn one(args: &OptimizeArgs, named: &Named, device: &dyn Device, settings: &Settings) -> anyhow::Result<ExitCode> {
    let scene = named.load()?;
    check_max_depth(settings.max_depth, &scene)?;
    let plan = Plan::of(&scene, device.info(), settings, &[])?;
    if args.json {
        print(&serde_json::to_string_pretty(&to_json(&scene, &plan, device)).context("plan as JSON")?)?;
    } else {
        print(&format!("{} on {}", scene.name, device.info().name))?;
        print(&plan::table(&scene.census, scene::duplicate_boxes(&scene.triangles), &plan, columns()))?;
    }
    plan.check(device.info())?;
    Ok(ExitCode::SUCCESS)
}

fn to_json(scene: &Scene, plan: &Plan, device: &dyn Device) -> Value {
    let census = &scene.census;
    json!({
        "scene": scene.name,
        "hash": scene.hash,
        "device": device.info().name,
        "census": census,
        "notes": scene.notes,
        "duplicate_boxes": scene::duplicate_boxes(&scene.triangles),
        "extent_decades": census.extent_decades(),
        "area_decades": census.area_decades(),
        "plan": plan,
        "bytes_left_out": plan.bytes_left_out(),
        "fits": plan.check(device.info()).is_ok(),
    })
}
