//! `prbvh stats`.

use super::any_tree::AnyTree;
use super::args::StatsArgs;
use super::log::Log;
use super::stdout::print;
use super::{load_scene, print_error};
use anyhow::Context;
use prbvh::bvh::{self, Bvh, Epo, SahModel};
use prbvh::scene::Scene;
use prbvh::wide::{self, PackedTree};
use std::ops::ControlFlow;
use std::process::ExitCode;

/// Faults to print; the others are counted.
const FAULTS_SHOWN: usize = 20;

pub(super) fn run(args: &StatsArgs, log: &Log) -> anyhow::Result<ExitCode> {
    let (tree, scene_hash) = AnyTree::read(&args.tree)?;
    let scene = args.scene.as_deref().map(|path| load_scene(path, args.triangles, &args.read)).transpose()?;
    if let Some(scene) = &scene {
        anyhow::ensure!(
            scene.hash == scene_hash,
            "{} is a tree over the scene with hash {}, but {} has {}",
            args.tree.display(),
            scene_hash,
            scene.source,
            scene.hash
        );
    }
    if let (AnyTree::Binary(tree), None) = (&tree, &scene) {
        let needs = "whose leaves hold pieces of triangles: it needs these, --scene";
        anyhow::ensure!(!tree.has_splits(triangles_of(tree)), "{} is a tree {needs}", args.tree.display());
    }
    if let Err(faults) = tree.validate(scene.as_ref().map(|scene| scene.triangles.as_slice())) {
        return report_faults(args, &faults);
    }
    let file = match tree {
        AnyTree::Wide(tree) => return of_wide(args, &tree, &scene_hash, scene.as_ref()),
        AnyTree::Binary(tree) => TreeFile { tree, scene_hash },
    };
    let (triangles, references) = (triangles_of(&file.tree), file.tree.references());
    let model = SahModel::default();
    let quality = bvh::quality(&file.tree, &model);
    let epo = scene.as_ref().and_then(|scene| overlap(&file.tree, scene, &model, log));
    let hash = bvh::tree_hash(&file.tree);
    let bytes_per_triangle = file_bytes_per_triangle(&file.tree);
    if args.json {
        let mut json = serde_json::to_value(quality).context("quality as JSON")?;
        if let Some(json) = json.as_object_mut() {
            json.insert("valid".into(), true.into());
            json.insert("triangles".into(), triangles.into());
            json.insert("references".into(), references.into());
            json.insert("references_per_triangle".into(), (references as f64 / triangles.max(1) as f64).into());
            json.insert("epo".into(), epo.map(|epo| epo.value).into());
            json.insert("epo_error".into(), epo.map(|epo| epo.error).into());
            json.insert("epo_drawn".into(), epo.map(|epo| epo.drawn).into());
            json.insert("bytes_per_triangle".into(), bytes_per_triangle.into());
            json.insert("tree_hash".into(), hash.into());
            json.insert("scene_hash".into(), file.scene_hash.into());
            let notes = scene.as_ref().map(|scene| &scene.notes);
            json.insert("notes".into(), serde_json::to_value(notes).context("notes as JSON")?);
        }
        print(&serde_json::to_string_pretty(&json)?)?;
    } else {
        let (c_t, c_i) = (model.c_traversal, model.c_intersect);
        let leaf_boxes = if scene.is_some() { "leaf boxes checked" } else { "leaf boxes not checked: no --scene" };
        print(&format!("valid        yes ({leaf_boxes})"))?;
        print(&format!("SAH cost     {:.3} (c_T = {c_t}, c_I = {c_i})", quality.sah_cost))?;
        if quality.is_root_flat {
            print("             the root's box has no area: every node counts as if it were as large")?;
        }
        match epo {
            Some(Epo { value, error, drawn, .. }) if drawn > 0 => print(&format!(
                "EPO          {value:.3} ± {error:.3} (95 %, from {drawn} triangles, c_T = {c_t}, c_I = {c_i})"
            ))?,
            Some(epo) => print(&format!("EPO          {:.3} (c_T = {c_t}, c_I = {c_i})", epo.value))?,
            None => print("EPO          needs the triangles: --scene")?,
        }
        print(&format!("depth        {} (leaves {:.1} on average)", quality.max_depth, quality.mean_leaf_depth))?;
        print(&format!("stack        {} entries of an ordered traversal", quality.stack))?;
        print(&format!("nodes        {}", quality.nodes))?;
        print(&format!("leaves       {}", quality.leaves))?;
        print(&format!("triangles    {triangles}"))?;
        if references > triangles {
            let ratio = references as f64 / triangles as f64;
            print(&format!("references   {references} ({ratio:.3} per triangle)"))?;
        }
        print(&format!("memory       {bytes_per_triangle:.1} B per triangle"))?;
        print(&format!("tree hash    {hash}"))?;
        print(&format!("scene hash   {}", file.scene_hash))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Triangles of a tree of which each is in one leaf at least.
fn triangles_of(tree: &Bvh) -> usize {
    tree.triangle_order.iter().max().map_or(0, |&last| last as usize + 1)
}

/// A tree in a file and its scene.
struct TreeFile {
    tree: Bvh,
    scene_hash: String,
}

/// Nodes of 32 bytes and the triangle order.
fn file_bytes_per_triangle(tree: &Bvh) -> f64 {
    (32 * tree.nodes.len() + 4 * tree.triangle_order.len()) as f64 / triangles_of(tree) as f64
}

fn of_wide(args: &StatsArgs, packed: &PackedTree, scene_hash: &str, scene: Option<&Scene>) -> anyhow::Result<ExitCode> {
    let tree = packed.unpack().map_err(|faults| anyhow::anyhow!(wide::summary(&faults)))?;
    let (width, layout) = (packed.nodes.width(), packed.nodes.layout());
    let model = width.sah();
    // Costs are those of the boxes around the triangles where these are there, so that layouts compare.
    // Pieces have boxes of their own.
    let whole = scene.filter(|scene| scene.triangles.len() == tree.triangle_order.len());
    let exact = whole.map(|scene| tree.clone().with_boxes_of(&scene.triangles));
    let quality = wide::quality(exact.as_ref().unwrap_or(&tree), &model);
    let packed_cost = wide::quality(&tree, &model).sah_cost;
    let (bytes, hash) = (packed.bytes_per_triangle(), packed.hash());
    if args.json {
        let mut json = serde_json::to_value(quality).context("quality as JSON")?;
        if let Some(json) = json.as_object_mut() {
            json.insert("valid".into(), true.into());
            json.insert("width".into(), width.get().into());
            json.insert("layout".into(), layout.to_string().into());
            json.insert("packed_sah_cost".into(), packed_cost.into());
            json.insert("bytes_per_triangle".into(), bytes.into());
            json.insert("tree_hash".into(), hash.into());
            json.insert("scene_hash".into(), scene_hash.into());
        }
        print(&serde_json::to_string_pretty(&json)?)?;
        return Ok(ExitCode::SUCCESS);
    }
    let boxes = if scene.is_some() { "boxes checked" } else { "boxes not checked: no --scene" };
    let (c_t, c_i) = (model.c_traversal, model.c_intersect);
    print(&format!("valid        yes ({boxes})"))?;
    print(&format!("nodes of     {width} children, layout {layout}"))?;
    print(&format!(
        "SAH cost     {:.3} (c_T = {c_t}, c_I = {c_i}; with the boxes of the layout {packed_cost:.3})",
        quality.sah_cost
    ))?;
    print(&format!("levels       {}, as many entries has the stack of a traversal", quality.levels))?;
    print(&format!("nodes        {} ({:.2} children on average)", quality.nodes, quality.children_per_node))?;
    print(&format!("leaves       {}", quality.leaves))?;
    print(&format!("triangles    {}", quality.triangles))?;
    print(&format!("memory       {bytes:.1} B per triangle"))?;
    print(&format!("tree hash    {hash}"))?;
    print(&format!("scene hash   {scene_hash}"))?;
    Ok(ExitCode::SUCCESS)
}

/// The end-point overlap, with progress.
fn overlap(tree: &Bvh, scene: &Scene, model: &SahModel, log: &Log) -> Option<Epo> {
    let bar = log.steps();
    let epo = bvh::epo_watched(tree, &scene.triangles, model, bvh::epo_budget(scene.triangles.len()), &|progress| {
        bar.set_length(progress.of);
        bar.set_position(progress.done);
        bar.set_message(if progress.is_sampled { "end-point overlap, from a sample" } else { "end-point overlap" });
        ControlFlow::Continue(())
    });
    log.end_bar();
    epo
}

fn report_faults(args: &StatsArgs, faults: &[String]) -> anyhow::Result<ExitCode> {
    if args.json {
        print(&serde_json::json!({ "valid": false, "faults": faults }).to_string())?;
    } else {
        print_error(&format!("prbvh: {} is no valid tree, {} faults:", args.tree.display(), faults.len()));
        for fault in faults.iter().take(FAULTS_SHOWN) {
            print_error(&format!("  {fault}"));
        }
        if faults.len() > FAULTS_SHOWN {
            print_error(&format!("  and {} more", faults.len() - FAULTS_SHOWN));
        }
    }
    Ok(ExitCode::FAILURE)
}
