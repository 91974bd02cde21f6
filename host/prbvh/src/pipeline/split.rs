//! References that are pieces of triangles: where they come from, and back to the triangles.
//!
//! The pipeline runs over references as over triangles: the scene of a run is that of their boxes.

use super::PipelineError;
use crate::build;
use crate::bvh::{self, Bvh, Quality, SahModel};
use crate::device::{Device, DeviceError, Timing, on_host};
use crate::plan::Plan;
use crate::presplit::{is_on_device, presplit};
use crate::references::{Pieces, References};
use crate::scene::{Primitives, Scene, SceneError};
use crate::settings::{Initial, SettingError, Settings};
use std::time::Instant;

/// What became of the triangles that were split.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Splits {
    /// References that the tree was built and optimised over.
    pub built: u32,
    /// Those that were siblings of one triangle when the tree was optimised, and became one with another.
    pub merged: u32,
    /// References of the tree handed out, each triangle of a leaf counted once.
    pub references: u32,
    /// SAH cost before siblings were merged, unitless.
    pub cost_before: f64,
}

/// What a run starts from.
#[derive(Default)]
pub(super) struct Start {
    /// The tree that is there, with a reference in each leaf.
    pub(super) given: Option<References>,
    /// Where a triangle has several references: these.
    pub(super) split: Option<SplitScene>,
    /// Of what has run.
    pub(super) timings: Vec<Timing>,
}

impl Start {
    pub(super) fn of(
        scene: &Scene,
        device: &mut dyn Device,
        settings: &Settings,
        plan: &Plan,
    ) -> Result<Self, PipelineError> {
        let mut start = Self::default();
        let references =
            |tree: &Bvh| References::split(tree, &scene.boxes()).map_err(|faults| PipelineError::GivenTree { faults });
        let mut pieces = None;
        match &settings.initial {
            Initial::Tree(tree) => start.given = Some(on_host(device, || references(tree))?),
            Initial::Sbvh => {
                let (tree, timing) = sbvh_of(scene, device, settings)?;
                start.given = Some(on_host(device, || references(&tree))?);
                start.timings.push(timing);
            }
            _ => {}
        }
        if let Some(asked) = settings.presplit.filter(|_| plan.presplits) {
            if is_on_device(&asked) {
                let (made, timings) = presplit(device, &scene.triangles, &asked)?;
                pieces = made;
                start.timings.extend(timings);
            } else {
                let settings = settings.clone().with(|s| s.sbvh.budget = asked.budget);
                let (tree, timing) = sbvh_of(scene, device, &settings)?;
                pieces = on_host(device, || references(&tree))?.pieces();
                start.timings.push(timing);
            }
        }
        // Those of a tree that somebody gives stay what they are.
        let merges = !matches!(settings.initial, Initial::Tree(_));
        if let Some(pieces) = pieces.or_else(|| start.given.as_ref()?.pieces()) {
            let split = on_host(device, || SplitScene::new(&scene.name, pieces, merges))?;
            settings.max_depth.check(split.scene.triangles.len())?;
            start.split = Some(split);
        }
        Ok(start)
    }
}

fn sbvh_of(scene: &Scene, device: &dyn Device, settings: &Settings) -> Result<(Bvh, Timing), PipelineError> {
    if scene.primitives == Primitives::Boxes {
        let need = "another one for a scene of boxes, which are not cut";
        return Err(SettingError { name: "initial", value: "sbvh".to_owned(), need }.into());
    }
    let start = Instant::now();
    let stop = settings.limits().stop.as_ref();
    let tree = on_host(device, || build::sbvh(&scene.triangles, &settings.sbvh, stop)).ok_or(DeviceError::Stopped)?;
    Ok((tree, Timing { label: "sbvh", seconds: start.elapsed().as_secs_f64() }))
}

/// The references as a scene of boxes, and the triangle of each.
pub(super) struct SplitScene {
    pub(super) scene: Scene,
    primitives: Vec<u32>,
    merges: bool,
    splits: Splits,
}

impl SplitScene {
    fn new(name: &str, Pieces { boxes, primitives }: Pieces, merges: bool) -> Result<Self, SceneError> {
        let scene = Scene::from_boxes(name, &boxes)?;
        let built = u32::try_from(boxes.len()).unwrap_or(u32::MAX);
        let splits = Splits { built, merged: 0, references: built, cost_before: 0.0 };
        Ok(Self { scene, primitives, merges, splits })
    }

    /// The optimised tree of one reference per leaf, and its quality, with siblings of one triangle merged.
    pub(super) fn merged(&mut self, (tree, quality): (Bvh, Quality)) -> Result<(Bvh, Quality), PipelineError> {
        self.splits.cost_before = quality.sah_cost;
        let merged = if self.merges { bvh::merge_siblings(&tree, &self.primitives) } else { None };
        let Some(merged) = merged else { return Ok((tree, quality)) };
        self.splits.merged = (self.primitives.len() - merged.primitives.len()) as u32;
        self.scene = Scene::from_boxes(&*self.scene.name, &merged.boxes)?;
        self.primitives = merged.primitives;
        let quality = bvh::quality(&merged.tree, &SahModel::default());
        Ok((merged.tree, quality))
    }

    /// Whether there are other references than the device knows.
    pub(super) fn has_merged(&self) -> bool {
        self.splits.merged > 0
    }

    /// The tree over the triangles, and what became of them.
    pub(super) fn given_back(
        self,
        mut tree: Bvh,
        triangles: &Scene,
        device: &dyn Device,
    ) -> Result<(Bvh, Splits), PipelineError> {
        tree.triangle_order.iter_mut().for_each(|reference| *reference = self.primitives[*reference as usize]);
        let mut splits = self.splits;
        if self.merges {
            tree = bvh::without_repeats(tree);
            let name = &device.info().name;
            on_host(device, || bvh::validate_tree(&tree, &triangles.triangles))
                .map_err(|faults| PipelineError::InvalidTree { stage: "splits", device: name.clone(), faults })?;
        }
        splits.references = u32::try_from(tree.references()).unwrap_or(u32::MAX);
        Ok((tree, splits))
    }
}
