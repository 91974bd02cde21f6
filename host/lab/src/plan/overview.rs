//! The plans of several scenes beside each other.

use crate::terminal::{empty, right};
use comfy_table::Cell;
use prbvh::format;
use prbvh::plan::{Item, Omission, Plan, Status};

/// Plans that decide the same are one kind: the numbers of the kinds, from 1 on in the order of the plans.
#[must_use]
pub fn kinds(plans: &[&Plan]) -> Vec<usize> {
    let mut seen: Vec<Vec<(Omission, Status)>> = Vec::new();
    let mut kind = |plan: &&Plan| {
        let decisions = plan.decisions();
        seen.iter().position(|other| *other == decisions).unwrap_or_else(|| {
            seen.push(decisions);
            seen.len() - 1
        }) + 1
    };
    plans.iter().map(&mut kind).collect()
}

/// A row per scene, then what each kind of plan decides, at most `width` columns wide.
#[must_use]
pub fn overview(plans: &[(String, Plan)], width: u16) -> String {
    let kinds = kinds(&plans.iter().map(|(_, plan)| plan).collect::<Vec<_>>());
    let mut scenes = empty(width);
    scenes.set_header([
        Cell::new("scene"),
        right("triangles"),
        right("peak"),
        right("buffers left out"),
        Cell::new("device code"),
        right("plan"),
    ]);
    for ((name, plan), kind) in plans.iter().zip(&kinds) {
        let peak = plan.phases.iter().filter(|phase| phase.runs).map(|phase| phase.peak_bytes).max().unwrap_or(0);
        scenes.add_row([
            Cell::new(name),
            right(&format::count(plan.triangles as u64)),
            right(&format::bytes(peak)),
            right(&format::bytes(plan.bytes_left_out())),
            Cell::new(plan.code.to_string()),
            right(&kind.to_string()),
        ]);
    }
    let mut decisions = empty(width);
    let most = kinds.iter().copied().max().unwrap_or(0);
    decisions.set_header([right("plan"), right("scenes"), Cell::new("left out"), Cell::new("not left out")]);
    for kind in 1..=most {
        let of_kind = || plans.iter().zip(&kinds).filter(|(_, other)| **other == kind);
        let Some(((_, plan), _)) = of_kind().next() else { continue };
        let named = |is_left_out: bool| {
            let items = plan.items.iter().filter(|item| (item.status == Status::LeftOut) == is_left_out);
            let name = |item: &Item| match item.status {
                Status::LeftOut => item.what.clone(),
                status => format!("{} ({status})", item.what),
            };
            items.map(name).collect::<Vec<_>>().join("; ")
        };
        decisions.add_row([
            right(&kind.to_string()),
            right(&of_kind().count().to_string()),
            Cell::new(named(true)),
            Cell::new(named(false)),
        ]);
    }
    let plural = |count: usize, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
    format!(
        "{}\n{}\n{} for {}",
        scenes.trim_fmt(),
        decisions.trim_fmt(),
        plural(most, "different plan"),
        plural(plans.len(), "scene")
    )
}
