//! The optimiser on triangles as they are, without the power of two that brings them into a safe range.

use super::document::Block;
use super::{case, device, markdown, method, part, stability_rows, texts};
use prbvh::build::{DeviceTree, lbvh};
use prbvh::bvh::{Bvh, SahModel, quality};
use prbvh::device::Device;
use prbvh::optimize::{IterationRow, prbvh_unchecked};
use prbvh::pipeline::{Optimized, Settings};
use prbvh::scene::{SafeRange, Scene};
use prbvh_lab::stability::{Library, Property, Row, RunError, Subject};
use std::ops::ControlFlow;

/// The pipeline on the triangles as they are.
#[derive(Clone, Copy, Debug)]
pub struct Unscaled;

impl Subject for Unscaled {
    fn run(&self, scene: &Scene, settings: &Settings, device: &mut dyn Device) -> Result<Optimized, RunError> {
        // The codes know no scale; only the boxes are as they are.
        let (scaled, _) = lbvh(device, SafeRange::of(&scene.triangles).apply(&scene.triangles), settings.morton_bits)?;
        let nodes = scaled.download(device)?;
        scaled.free(device);
        let built = Bvh::from_device(&nodes).map_err(RunError::InvalidTree)?.with_boxes_of(&scene.triangles);
        let tree = DeviceTree::upload(device, &built.to_device()?)?;
        let measured = |tree: &DeviceTree, device: &mut dyn Device| {
            let nodes = tree.download(device)?;
            let tree = Bvh::from_device(&nodes).map_err(RunError::InvalidTree)?.with_boxes_of(&scene.triangles);
            Ok::<_, RunError>((quality(&tree, &SahModel::default()), tree))
        };
        let (initial, _) = measured(&tree, device)?;
        let go_on = &mut |_: &IterationRow, _: &DeviceTree, _: &mut dyn Device| ControlFlow::Continue(());
        let outcome = prbvh_unchecked(device, &tree, None, &settings.prbvh, go_on)?;
        let (quality, best) = measured(&tree, device)?;
        tree.free(device);
        let mut run = Library.run(scene, settings, device)?;
        (run.tree, run.initial, run.quality, run.outcome) = (best, initial, quality, outcome);
        Ok(run)
    }
}

/// A row per case: without the range and with it.
#[must_use]
pub fn block() -> Block {
    let names = ["scale-1e-30", "denormals", "scale-1e-10", "scale-1", "scale-1e10", "scale-1e20", "scale-1e30"];
    let cases = names.map(|name| *case(name));
    let methods = [method("prbvh-1")];
    let without = stability_rows(&cases, &methods, device(), &Unscaled);
    let with = stability_rows(&cases, &methods, device(), &Library);
    let header = ["case", "f32 cost against f64", "cost", "same tree at 2^k", "with: f32 cost", "cost", "same tree"];
    let mut rows = vec![texts(&header)];
    for (without, with) in without.iter().zip(&with) {
        let mut row = vec![format!("`{}`", without.case)];
        row.extend(cells(without));
        row.extend(cells(with));
        rows.push(row);
    }
    Block::new("safe-range", markdown(&rows))
}

fn cells(row: &Row) -> [String; 3] {
    let cost = |cost: Option<f64>| cost.map_or_else(|| "-".to_owned(), |cost| format!("{cost:.3}"));
    let error = row.f32_error.map_or_else(|| "-".to_owned(), part);
    let is_same = !row.breaches.iter().any(|breach| matches!(breach.property, Property::Scale));
    let same = if is_same { "yes" } else { "no" };
    [error, format!("{} to {}", cost(row.cost_before), cost(row.cost_after)), same.to_owned()]
}
