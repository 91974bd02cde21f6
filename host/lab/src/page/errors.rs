//! The table of times to within an error.

use crate::compare::{LEVELS, SceneComparison, SettingErrors};
use prbvh::format;

/// The table of a scene.
pub(super) struct ErrorsView {
    /// The lowest cost known, and what reached it.
    pub(super) reference: String,
    /// Heads of the columns after the method.
    pub(super) heads: Vec<String>,
    pub(super) rows: Vec<ErrorRow>,
}

pub(super) struct ErrorRow {
    pub(super) name: String,
    pub(super) is_on_front: bool,
    pub(super) cells: Vec<ErrorCell>,
}

pub(super) struct ErrorCell {
    pub(super) text: String,
    /// By which rows are sorted; empty where there is none.
    pub(super) key: String,
}

impl ErrorsView {
    /// None if no cost is known.
    pub(super) fn of(scene: &SceneComparison) -> Option<Self> {
        let errors = scene.errors.as_ref().filter(|errors| !errors.settings.is_empty())?;
        let has_device = errors.settings.iter().any(|setting| setting.time_to.device_s.iter().any(Option::is_some));
        let several = errors.settings.iter().any(|setting| setting.device != errors.settings[0].device);
        let level = |level: f64| format!("{} %", 100.0 * level);
        let mut heads = vec!["error".to_owned()];
        heads.extend(LEVELS.map(|value| format!("to {}", level(value))));
        if has_device {
            heads.extend(LEVELS.map(|value| format!("kernels to {}", level(value))));
        }
        let row = |(k, setting): (usize, &SettingErrors)| {
            let mut cells = vec![cell(Some(setting.error), |error| format!("{:.2} %", 100.0 * error))];
            cells.extend(setting.time_to.wall_s.map(|time| cell(time, format::seconds)));
            if has_device {
                cells.extend(setting.time_to.device_s.map(|time| cell(time, format::seconds)));
            }
            let mu = if setting.mu > 0 { format!(" µ = {}", setting.mu) } else { String::new() };
            let device = if several { format!(", {}", setting.device) } else { String::new() };
            let name = format!("{}{mu}{device}", setting.method);
            ErrorRow { name, is_on_front: errors.pareto_front.contains(&k), cells }
        };
        Some(Self {
            reference: format!("{:.3} ({})", errors.reference.reference_cost, errors.reference.source),
            heads,
            rows: errors.settings.iter().enumerate().map(row).collect(),
        })
    }
}

fn cell(value: Option<f64>, text: fn(f64) -> String) -> ErrorCell {
    ErrorCell { text: value.map_or_else(String::new, text), key: value.map_or_else(String::new, |v| v.to_string()) }
}
