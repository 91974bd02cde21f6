//! What a run leaves out because scene, device or settings do not need it, and what it takes.
//!
//! A plan is made before anything runs, from the scene's census, what the device can do, and the settings; [`crate::pipeline`] follows it. No
//! omission changes the resulting tree.

mod decide;
mod dry;
mod item;
mod phase;
mod table;

pub use item::{Item, Omission, Saving, Status};
pub use phase::PhaseBytes;
pub use table::table;

use crate::build::{self, CodeCensus, Codes};
use crate::device::{DeviceError, DeviceInfo};
use crate::pipeline::Settings;
use crate::scene::Scene;
use serde::Serialize;

/// What a run will do.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
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
        let code_census =
            settings.initial.has_codes().then(|| CodeCensus::of(&scene.triangles, scene.census.min, scene.census.max));
        let asked = Codes::from(settings.morton_bits);
        let enough = code_census.map_or(asked, |census| census.enough(settings.morton_bits));
        let codes = dry::codes_with(enough, asked, keep);
        let single = settings.adaptive.is_some_and(|leaves| leaves.max_leaf == Some(1)) || triangles == 1;
        let collapses = settings.adaptive.is_some() && (!single || keep.contains(&Omission::Collapse));
        let mut plan = Self { triangles, items: Vec::new(), phases: Vec::new(), code_census, codes, collapses };
        plan.phases = phase::phases(&plan, scene, info, settings)?;
        plan.items = decide::items(&plan, scene, info, settings)?;
        Ok(plan)
    }

    /// Refuses a run that does not fit the device, before anything is allocated.
    ///
    /// # Errors
    /// [`DeviceError::Limit`] with the limit's name, what is needed and what there is, of the first phase that runs and does not fit.
    pub fn check(&self, info: &DeviceInfo) -> Result<(), DeviceError> {
        build::check_limits(info, self.triangles)?;
        self.phases.iter().filter(|phase| phase.runs).try_for_each(|phase| phase.check(info, self.triangles))
    }

    /// What is left out, a line each.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        self.items.iter().filter(|item| item.status == Status::LeftOut).map(ToString::to_string).collect()
    }
}
