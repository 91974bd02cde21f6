//! `prbvh render`.

use super::interrupt::Interrupt;
use super::load_scene;
use super::log::Log;
use super::overwrite::refuse_overwrite;
use super::render_args::RenderArgs;
use super::stdout::print;
use anyhow::{Context, ensure};
use prbvh::bvh::{self, Bvh};
use prbvh::device::{self, Device};
use prbvh::pipeline::{self, Settings};
use prbvh::scene::Scene;
use prbvh::write::is_written_through;
use prbvh_lab::render::{RayCost, Rendering, clear_view, heat_map, render, shaded, write_png};
use std::ops::ControlFlow;
use std::path::Path;
use std::process::ExitCode;

/// A signal ends it at once: of a picture there is all or nothing.
pub(super) fn run(args: &RenderArgs, log: &Log, interrupt: &Interrupt) -> anyhow::Result<ExitCode> {
    refuse_overwrite([&*args.scene].into_iter().chain(args.tree.as_deref()), [args.out.clone()])?;
    let mut device = device::open(args.device, args.threads, args.validate)?;
    let scene = load_scene(&args.scene, args.triangles, &args.read)?;
    let tree = match &args.tree {
        Some(path) => read_tree(path, &scene)?,
        None => {
            let settings = Settings::default().with(|s| s.adaptive = args.leaves.settings());
            let bar = log.bar(settings.prbvh.limits.max_iterations);
            let result = pipeline::optimize(&scene, &mut *device, &settings, &mut |row| {
                bar.set_position(u64::from(row.iteration));
                ControlFlow::Continue(())
            });
            log.end_bar();
            result?.tree
        }
    };
    tracing::info!("{}: {} triangles, rendering on {}", scene.name, scene.triangles.len(), device.info().name);
    let rendering = picture(args, &mut *device, &scene, &tree)?;
    if rendering.primary.hits == 0 {
        tracing::warn!("no triangle is in view: the picture shows the sky alone");
    }
    let pixels = if args.heat_map {
        let (pixels, scale) = heat_map(&rendering);
        tracing::info!("heat map: black is no test, white {:.0} tests and more per primary ray", scale.most);
        pixels
    } else {
        shaded(&rendering)
    };
    // A file has a temporary name until it is whole. A pipe may wait for its reader.
    let held = (!is_written_through(&args.out)).then(|| interrupt.hold());
    write_png(&args.out, rendering.width, rendering.height, &pixels)?;
    drop(held);
    tracing::info!("wrote {}", args.out.display());
    if args.json {
        print(&json(&scene, &*device, &tree, &rendering).context("rays as JSON")?)?;
    } else {
        print(&table(&rendering))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn picture(args: &RenderArgs, device: &mut dyn Device, scene: &Scene, tree: &Bvh) -> anyhow::Result<Rendering> {
    let mut camera = clear_view(args.view, device, scene, tree, args.up as usize)?;
    if let Some(eye) = args.eye {
        camera.eye = eye;
    }
    if let Some(look_at) = args.look_at {
        camera.look_at = look_at;
    }
    if let Some(fov) = args.fov {
        camera.fov_degrees = fov;
    }
    Ok(render(device, scene, tree, &camera, &args.settings())?)
}

/// The tree of a file, if it is one over this scene.
fn read_tree(path: &Path, scene: &Scene) -> anyhow::Result<Bvh> {
    let file = bvh::file::read(path)?;
    ensure!(
        file.scene_hash == scene.hash,
        "{} was made for the scene with hash {}, but {} has {}",
        path.display(),
        file.scene_hash,
        scene.source,
        scene.hash
    );
    if let Err(faults) = bvh::validate_tree(&file.tree, &scene.triangles) {
        anyhow::bail!("{}: no tree over {}: {}", path.display(), scene.source, bvh::summary(&faults));
    }
    Ok(file.tree)
}

fn json(scene: &Scene, device: &dyn Device, tree: &Bvh, rendering: &Rendering) -> serde_json::Result<String> {
    serde_json::to_string_pretty(&serde_json::json!({
        "scene": scene.name,
        "triangles": scene.triangles.len(),
        "notes": scene.notes,
        "device": device.info().name,
        "tree_hash": bvh::tree_hash(tree),
        "width": rendering.width,
        "height": rendering.height,
        "primary": rendering.primary,
        "shadow": rendering.shadow,
        "secondary": rendering.secondary,
        "overall": rendering.overall,
    }))
}

fn table(rendering: &Rendering) -> String {
    let mut lines = vec![format!(
        "{:<10} {:>12} {:>12} {:>10} {:>12} {:>16}",
        "rays", "traced", "that hit", "MRays/s", "boxes / ray", "triangles / ray"
    )];
    let kinds = [
        ("primary", &rendering.primary),
        ("shadow", &rendering.shadow),
        ("secondary", &rendering.secondary),
        ("overall", &rendering.overall),
    ];
    for (name, cost) in kinds {
        let RayCost { rays, hits, box_tests_per_ray, triangle_tests_per_ray, mrays_per_s, .. } = *cost;
        let speed = if mrays_per_s > 0.0 { format!("{mrays_per_s:.3}") } else { "-".to_owned() };
        lines.push(format!(
            "{name:<10} {rays:>12} {hits:>12} {speed:>10} {box_tests_per_ray:>12.2} {triangle_tests_per_ray:>16.2}"
        ));
    }
    lines.join("\n")
}
