//! `prbvh plan`.

use super::args::OptimizeArgs;
use super::optimize::DEFAULT_COLUMNS;
use super::{load_scene, print};
use anyhow::Context;
use prbvh::device;
use prbvh::plan::{self, Plan};
use prbvh::scene;
use std::process::ExitCode;

/// Takes the arguments of `prbvh optimize`, and says what that would do with them.
pub(super) fn run(args: &OptimizeArgs) -> anyhow::Result<ExitCode> {
    anyhow::ensure!(args.out.is_none(), "--out is for `prbvh optimize`: a plan writes no files");
    let settings = args.settings()?;
    let device = device::open(args.device, args.threads, args.validate)?;
    let scene = load_scene(&args.scene, args.triangles)?;
    let plan = Plan::of(&scene, device.info(), &settings, &[])?;
    let duplicate_boxes = scene::duplicate_boxes(&scene.triangles);
    let refused = plan.check(device.info());
    if args.json {
        let census = &scene.census;
        let json = serde_json::json!({
            "scene": scene.name,
            "hash": scene.hash,
            "device": device.info().name,
            "census": census,
            "duplicate_boxes": duplicate_boxes,
            "extent_decades": census.extent_decades(),
            "area_decades": census.area_decades(),
            "plan": plan,
            "fits": refused.is_ok(),
        });
        print(&serde_json::to_string_pretty(&json).context("plan as JSON")?);
    } else {
        let columns = console::Term::stdout().size_checked().map_or(DEFAULT_COLUMNS, |(_, columns)| columns);
        print(&format!("{} on {}", scene.name, device.info().name));
        print(&plan::table(&scene.census, duplicate_boxes, &plan, columns));
    }
    refused?;
    Ok(ExitCode::SUCCESS)
}
