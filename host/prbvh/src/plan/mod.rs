//! What a run leaves out because scene, device or settings do not need it, and what it takes.
//!
//! A plan is made before anything runs, from the scene's census, what the device can do, and the settings; The pipeline follows it. No
//! omission changes the resulting tree but that of duplicates, which is made where it is asked for.

mod bytes;
mod code;
mod decide;
mod dry;
mod item;
mod phase;

pub use bytes::PhaseBytes;
pub use code::{CodeSize, DeviceCode};
pub use item::{Item, Omission, Saving, Status};

use crate::build::{self, CodeCensus, Codes};
use crate::device::{DeviceError, DeviceInfo};
use crate::fold::Fold;
use crate::presplit::PresplitCensus;
use crate::scene::Scene;
use crate::settings::{Initial, Optimizer, Settings};
use prbvh_kernel::Kernel;
use std::collections::BTreeSet;
use std::sync::Arc;

/// What a run will do.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Plan {
    /// Triangles that it was made for.
    pub triangles: usize,
    /// The decisions.
    pub items: Vec<Item>,
    /// Device memory of the phases.
    pub phases: Vec<PhaseBytes>,
    /// What the Morton codes of the scene tell; none if the initial tree needs no codes.
    pub code_census: Option<CodeCensus>,
    /// What is computed and sorted of the Morton codes.
    pub codes: Codes,
    /// Whether kernels make adaptive leaves.
    pub collapses: bool,
    /// Kernels that the run may take.
    pub code: DeviceCode,
    /// Hash of the scene that it was made for.
    pub scene_hash: String,
    /// References that the tree is built and optimised over: triangles, less those folded; with splits as many as there may be.
    pub references: usize,
    /// What splits of the triangles promise; none where nobody asked for them.
    pub presplit_census: Option<PresplitCensus>,
    /// Whether triangles are split before the tree is built.
    pub presplits: bool,
    /// Classes of triangles with equal boxes, where they are folded.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub(crate) fold: Option<Arc<Fold>>,
}

/// A plan that was made for something else, or was changed since.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PlanMismatch {
    /// Another scene.
    #[error("the plan was made for another scene: its hash is {planned}, not {scene}")]
    Scene {
        /// Hash of the scene that it was made for.
        planned: String,
        /// Hash of the scene.
        scene: String,
    },
    /// Something that the settings need is left out.
    #[error("the plan leaves out what the settings need: {what}")]
    Needed {
        /// What it is.
        what: Omission,
    },
}

impl Plan {
    /// Plans a run of `settings` over `scene` on a device with `info`. What is in `keep` is not left out even if nothing needs it; this is
    /// for measuring ([`Omission::Codes`] and those that come from the device or the settings stay as they are).
    ///
    /// # Errors
    /// If the scene has more triangles than any tree.
    pub fn of(scene: &Scene, info: &DeviceInfo, settings: &Settings, keep: &[Omission]) -> Result<Self, DeviceError> {
        let triangles = scene.triangles.len();
        build::check_limits(&DeviceInfo { max_buffer_bytes: u64::MAX, ..info.clone() }, triangles)?;
        let presplit_census = settings.presplit.map(|presplit| PresplitCensus::of(scene, &presplit));
        let presplits = presplit_census.is_some_and(|census| census.promises() || keep.contains(&Omission::Presplit));
        // The codes are those of references that are not there yet.
        let has_census = settings.initial.has_codes() && !presplits;
        let code_census = has_census.then(|| CodeCensus::of(&scene.triangles, scene.census.min, scene.census.max));
        let references = triangles + most_splits(triangles, settings, presplits);
        build::check_limits(&DeviceInfo { max_buffer_bytes: u64::MAX, ..info.clone() }, references)?;
        let asked = Codes::from(settings.morton_bits);
        let enough = code_census.map_or(asked, |census| census.enough(settings.morton_bits));
        let codes = dry::codes_with(enough, asked, keep);
        let collapses =
            settings.adaptive.is_some() && (needs_collapse(references, settings) || keep.contains(&Omission::Collapse));
        let fold = folds(settings).then(|| Fold::of(&scene.triangles)).filter(|fold| fold.folded() > 0);
        let mut plan = Self {
            references: fold.as_ref().map_or(references, Fold::len),
            presplit_census,
            presplits,
            fold: fold.map(Arc::new),
            triangles,
            items: Vec::new(),
            phases: Vec::new(),
            code_census,
            codes,
            collapses,
            code: DeviceCode::of(&BTreeSet::new(), info),
            scene_hash: scene.hash.clone(),
        };
        let (phases, taken) = phase::phases(&plan, scene, info, settings)?;
        let run = phases.iter().zip(&taken).filter(|(phase, _)| phase.runs);
        let kernels: BTreeSet<Kernel> = run.flat_map(|(_, taken)| taken.kernels.iter().copied()).collect();
        plan.code = DeviceCode::of(&kernels, info);
        plan.phases = phases;
        plan.items = decide::items(&plan, &taken, &kernels, scene, info, settings)?;
        Ok(plan)
    }

    /// Refuses a plan that was not made for this scene, or that leaves out what the settings need.
    ///
    /// # Errors
    /// [`PlanMismatch`] with what does not fit.
    pub fn check_purpose(&self, scene: &Scene, settings: &Settings) -> Result<(), PlanMismatch> {
        if self.scene_hash != scene.hash {
            return Err(PlanMismatch::Scene { planned: self.scene_hash.clone(), scene: scene.hash.clone() });
        }
        let asked = Codes::from(settings.morton_bits);
        let needed = |what| Err(PlanMismatch::Needed { what });
        if self.fold.is_some() && !folds(settings) {
            return needed(Omission::Duplicates);
        }
        let has_room = self.fold.is_some()
            || self.references >= self.triangles + most_splits(self.triangles, settings, self.presplits);
        if settings.presplit.is_some() != self.presplit_census.is_some() || !has_room {
            return needed(Omission::Presplit);
        }
        if needs_collapse(self.references, settings) && !self.collapses {
            return needed(Omission::Collapse);
        }
        let is_all = self.codes == asked;
        if !settings.initial.has_codes() || (self.presplits && is_all) {
            return Ok(());
        }
        let enough = self.code_census.map(|census| census.enough(settings.morton_bits));
        let enough = enough.ok_or(PlanMismatch::Needed { what: Omission::Codes })?;
        if self.codes.bits != asked.bits && self.codes.bits != enough.bits {
            return needed(Omission::LowerCodes);
        }
        let lacks = |planned: u32, enough: u32| enough & !planned != 0;
        if lacks(self.codes.high, enough.high) || lacks(self.codes.low, enough.low) {
            return needed(Omission::EqualBits);
        }
        Ok(())
    }

    /// Kernels that ran though the plan does not have them.
    #[must_use]
    pub fn unplanned(&self, ran: &BTreeSet<Kernel>) -> Vec<&'static str> {
        ran.iter().map(|kernel| kernel.info().name).filter(|name| !self.code.kernels.contains(name)).collect()
    }

    /// Refuses a run that does not fit the device, before anything is allocated.
    ///
    /// # Errors
    /// [`DeviceError::Limit`] with the limit's name, what is needed and what there is, of the first phase that runs and does not fit.
    pub fn check(&self, info: &DeviceInfo) -> Result<(), DeviceError> {
        build::check_limits(info, self.triangles)?;
        self.phases.iter().filter(|phase| phase.runs).try_for_each(|phase| phase.check(info, self.triangles))
    }

    /// Buffers that are not allocated, bytes: the sum over the decisions, which are of different phases.
    #[must_use]
    pub fn bytes_left_out(&self) -> u64 {
        self.items.iter().filter(|item| item.status == Status::LeftOut).map(|item| item.saved.bytes).sum()
    }

    /// What it decides, without reasons and numbers.
    #[must_use]
    pub fn decisions(&self) -> Vec<(Omission, Status)> {
        self.items.iter().map(|item| (item.omission, item.status)).collect()
    }

    /// What is left out, a line each.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        self.items.iter().filter(|item| item.status == Status::LeftOut).map(ToString::to_string).collect()
    }
}

/// Whether triangles of equal boxes are asked to be one reference.
fn folds(settings: &Settings) -> bool {
    settings.fold_duplicates && settings.optimizer != Optimizer::None && !settings.initial.is_given()
}

/// References beyond the triangles, at most.
fn most_splits(triangles: usize, settings: &Settings, presplits: bool) -> usize {
    match (&settings.presplit, &settings.initial) {
        (Some(presplit), _) if presplits => presplit.most_splits(triangles),
        (_, Initial::Sbvh) => settings.sbvh.most_splits(triangles),
        _ => 0,
    }
}

/// Whether a leaf may get a second triangle.
fn needs_collapse(references: usize, settings: &Settings) -> bool {
    references > 1 && settings.adaptive.is_some_and(|leaves| leaves.max_leaf != Some(1))
}
