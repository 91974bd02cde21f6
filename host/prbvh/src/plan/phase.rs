//! The phases of a run, dry.

use super::Plan;
use super::bytes::PhaseBytes;
use super::dry::{DryDevice, Taken};
use crate::device::{DeviceError, DeviceInfo};
use crate::optimize::{Order, PrbvhSettings, Strategy};
use crate::presplit::is_on_device;
use crate::scene::Scene;
use crate::settings::{Optimizer, Settings};
use crate::wide::CollapseMethod;
use bytemuck::Zeroable;
use prbvh_kernel::setup::Triangle;

/// The phases, and what each took.
pub(super) type Phases = (Vec<PhaseBytes>, Vec<Taken>);

/// Iterations that are counted: more than one, for what is done in later ones only.
pub(super) const ITERATIONS: u32 = 3;

/// Places of phases in what [`phases`] makes.
pub(super) const BUILD: usize = 0;
pub(super) const WORST_FIRST: usize = 1;
pub(super) const AGGRESSIVE: usize = 2;
pub(super) const CONSERVATIVE: usize = 3;
pub(super) const COLLAPSE: usize = 4;

/// The place of what these settings optimise by.
pub(super) fn optimizer_of(settings: &PrbvhSettings) -> usize {
    match (settings.order, settings.strategy) {
        (Order::WorstFirst, _) => WORST_FIRST,
        (Order::Published, Strategy::Aggressive) => AGGRESSIVE,
        (Order::Published, Strategy::Conservative) => CONSERVATIVE,
    }
}

/// The phases of the run, and those of other settings beside them. Tracing is without rays and without stacks for deep trees.
pub(super) fn phases(
    plan: &Plan,
    scene: &Scene,
    info: &DeviceInfo,
    settings: &Settings,
) -> Result<Phases, DeviceError> {
    let references = plan.references;
    // What comes after the optimiser knows nothing of folded triangles.
    let most = scene.triangles.len().max(references);
    let stand_ins = vec![Triangle::zeroed(); if references > scene.triangles.len() { references } else { 0 }];
    let triangles = scene.triangles.get(..references).unwrap_or(&stand_ins);
    let phase = |name: String, runs, stage: &dyn Fn(&mut DryDevice) -> Result<(), DeviceError>| {
        let mut dry = DryDevice::new(info);
        stage(&mut dry)?;
        Ok::<_, DeviceError>((dry.phase(name, runs), dry.taken()))
    };
    let mut phases: Vec<(PhaseBytes, Taken)> =
        vec![phase(format!("build, {}", settings.initial.method()), true, &|dry| {
            dry.build(&settings.initial, plan.codes, triangles)
        })?];
    let published = |strategy| PrbvhSettings { order: Order::Published, strategy, ..settings.prbvh.clone() };
    for (name, prbvh) in [
        ("worst first", PrbvhSettings { order: Order::WorstFirst, ..settings.prbvh.clone() }),
        ("published, aggressive", published(Strategy::Aggressive)),
        ("published, conservative", published(Strategy::Conservative)),
    ] {
        let runs = settings.optimizer == Optimizer::Prbvh && optimizer_of(&prbvh) == optimizer_of(&settings.prbvh);
        let name = format!("optimise, {name}");
        phases.push(phase(name, runs, &|dry| dry.optimize(references, prbvh.clone(), ITERATIONS))?);
    }
    phases.push(phase("collapse".to_owned(), plan.collapses, &|dry| dry.collapse(most))?);
    phases.push(phase("trace".to_owned(), false, &|dry| dry.trace(most))?);
    if let Optimizer::Rotations(rotations) = &settings.optimizer {
        let name = "optimise, rotations".to_owned();
        phases.push(phase(name, true, &|dry| dry.rotate(references, rotations, ITERATIONS))?);
    }
    if let Some(wide) = &settings.wide {
        if wide.method == CollapseMethod::Optimal {
            phases.push(phase(format!("nodes of {}", wide.width), true, &|dry| dry.widen(most, wide))?);
        }
        let (width, layout) = (wide.width, wide.layout);
        phases.push(phase(format!("trace, {layout} of {width}"), false, &|dry| dry.trace_wide(most, width, layout))?);
    }
    let on_device = settings.presplit.filter(|presplit| plan.presplits && is_on_device(presplit));
    if on_device.is_some() {
        let triangles = scene.triangles.len();
        phases.push(phase("presplit".to_owned(), true, &|dry| dry.presplit(triangles, references))?);
    }
    Ok(phases.into_iter().unzip())
}
