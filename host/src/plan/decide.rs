//! The decisions, each with its reason and its saving.

use super::dry::{DryDevice, Taken, saving};
use super::{Item, Omission, Plan, Saving, Status};
use crate::build::{Codes, MOST_COMPARED, MortonBits};
use crate::device::{DeviceError, DeviceInfo};
use crate::optimize::Strategy;
use crate::pipeline::{Initial, Optimizer, Settings};
use crate::report::format;
use crate::scene::Scene;

pub(super) fn items(
    plan: &Plan,
    scene: &Scene,
    info: &DeviceInfo,
    settings: &Settings,
) -> Result<Vec<Item>, DeviceError> {
    let decide = Decide { plan, scene, info, settings };
    let mut items = if settings.initial.has_codes() {
        vec![decide.lower_codes()?, decide.equal_bits()?]
    } else {
        vec![decide.no_codes()?]
    };
    items.extend(decide.optimizer()?);
    items.push(decide.collapse()?);
    items.push(item(
        Omission::Attributes,
        Status::LeftOut,
        "normals, texture coordinates, materials",
        "only positions are read".to_owned(),
    ));
    items.push(decide.duplicates());
    Ok(items)
}

fn item(omission: Omission, status: Status, what: &str, why: String) -> Item {
    Item { omission, status, what: what.to_owned(), why, saved: Saving::default() }
}

struct Decide<'a> {
    plan: &'a Plan,
    scene: &'a Scene,
    info: &'a DeviceInfo,
    settings: &'a Settings,
}

impl Decide<'_> {
    fn build(&self, initial: &Initial, codes: Codes) -> Result<Taken, DeviceError> {
        let mut dry = DryDevice::new(self.info);
        dry.build(initial, codes, &self.scene.triangles)?;
        Ok(dry.taken())
    }

    fn no_codes(&self) -> Result<Item, DeviceError> {
        let why = format!("the initial tree is {}", self.settings.initial);
        let mut item = item(Omission::Codes, Status::LeftOut, "Morton codes and their sort", why);
        let with = self.build(&self.settings.initial, self.plan.codes)?;
        item.saved = saving(self.build(&Initial::Lbvh, Codes::from(self.settings.morton_bits))?, with);
        Ok(item)
    }

    fn lower_codes(&self) -> Result<Item, DeviceError> {
        let codes = self.plan.codes;
        let decided = |status, why: String| item(Omission::LowerCodes, status, "lower words of the Morton codes", why);
        if codes.bits == MortonBits::Sixty {
            let why = match self.plan.code_census.and_then(|census| census.low_tells_more) {
                Some(true) => "two triangles differ in them alone".to_owned(),
                Some(false) => "kept in, though no two triangles differ in them alone".to_owned(),
                None => format!(
                    "the triangles differ in them; whether in them alone is not asked for more than {}",
                    format::count(MOST_COMPARED as u64)
                ),
            };
            return Ok(decided(Status::Needed, why));
        }
        let why = match self.settings.morton_bits {
            MortonBits::Thirty => "30 bits were asked for",
            MortonBits::Sixty => "no two triangles differ in them alone, so that 30 bits give the order of 60",
        };
        let mut item = decided(Status::LeftOut, why.to_owned());
        let without = self.build(&self.settings.initial, Codes { bits: MortonBits::Sixty, ..codes })?;
        item.saved = saving(without, self.build(&self.settings.initial, codes)?);
        Ok(item)
    }

    fn equal_bits(&self) -> Result<Item, DeviceError> {
        let codes = self.plan.codes;
        let without = self.build(&self.settings.initial, Codes::from(codes.bits))?;
        let saved = saving(without, self.build(&self.settings.initial, codes)?);
        let differ = match codes.bits {
            MortonBits::Thirty => codes.high.count_ones(),
            MortonBits::Sixty => codes.high.count_ones() + codes.low.count_ones(),
        };
        let of = if codes.bits == MortonBits::Thirty { 30 } else { 60 };
        let status = if saved.dispatches > 0 { Status::LeftOut } else { Status::Needed };
        let why = match status {
            Status::LeftOut => format!("the codes differ in {differ} of {of} bits"),
            _ => format!("the codes differ in {differ} of {of} bits, some in every pass"),
        };
        Ok(Item { saved, ..item(Omission::EqualBits, status, "passes of the sort over bits that are equal", why) })
    }

    fn iteration(&self, strategy: Strategy, atomics_64: bool) -> Result<[Taken; 2], DeviceError> {
        let info = DeviceInfo { atomics_64, ..self.info.clone() };
        let after = |iterations| {
            let mut dry = DryDevice::new(&info);
            dry.optimize(self.scene.triangles.len(), strategy, self.settings.prbvh.moves, iterations)?;
            Ok(dry.taken())
        };
        Ok([after(0)?, after(1)?])
    }

    fn optimizer(&self) -> Result<Vec<Item>, DeviceError> {
        let strategy = self.settings.prbvh.strategy;
        let [start, end] = self.iteration(strategy, self.info.atomics_64)?;
        if self.settings.optimizer != Optimizer::Prbvh {
            let why = format!("the optimiser is {}", self.settings.optimizer);
            let what = "locks, searches and moves on the device";
            let mut item = item(Omission::DeviceOptimizer, Status::LeftOut, what, why);
            let mut dry = DryDevice::new(self.info);
            dry.hold_tree(self.scene.triangles.len())?;
            item.saved = saving(start, dry.taken());
            item.saved.dispatches_per_iteration = end.dispatches - start.dispatches;
            return Ok(vec![item]);
        }
        let mut lock = if self.info.atomics_64 {
            let why = "the device has 64-bit atomics".to_owned();
            item(Omission::LockWord, Status::LeftOut, "locks of two 32-bit words and their extra dispatch", why)
        } else {
            let why = "the device has no 64-bit atomics".to_owned();
            item(Omission::LockWord, Status::Needed, "locks of two 32-bit words and their extra dispatch", why)
        };
        if self.info.atomics_64 {
            let [words_start, words_end] = self.iteration(strategy, false)?;
            lock.saved.bytes = words_end.peak_bytes.saturating_sub(end.peak_bytes);
            let words = words_end.dispatches - words_start.dispatches;
            lock.saved.dispatches_per_iteration = words - (end.dispatches - start.dispatches);
        }
        let what = "paths of the reinsertions, for the conservative strategy";
        let paths = match strategy {
            Strategy::Conservative => item(Omission::Paths, Status::Needed, what, "the strategy is that".to_owned()),
            Strategy::Aggressive => {
                let [conservative, _] = self.iteration(Strategy::Conservative, self.info.atomics_64)?;
                let why = "the strategy is aggressive".to_owned();
                Item { saved: saving(conservative, start), ..item(Omission::Paths, Status::LeftOut, what, why) }
            }
        };
        Ok(vec![lock, paths])
    }

    fn collapse(&self) -> Result<Item, DeviceError> {
        let what = "collapse to adaptive leaves";
        let why = match &self.settings.adaptive {
            _ if self.plan.collapses => {
                let why = "adaptive leaves were asked for".to_owned();
                return Ok(item(Omission::Collapse, Status::Needed, what, why));
            }
            None => "one triangle per leaf was asked for",
            Some(_) => "no leaf can have a second triangle, so that the collapsed tree is the optimised one",
        };
        let mut item = item(Omission::Collapse, Status::LeftOut, what, why.to_owned());
        let n = self.scene.triangles.len();
        let mut dry = DryDevice::new(self.info);
        dry.collapse(n)?;
        // Beyond what the run takes without it.
        let peak = self.plan.phases.iter().filter(|phase| phase.runs).map(|phase| phase.peak_bytes).max();
        item.saved.bytes = dry.taken().peak_bytes.saturating_sub(peak.unwrap_or(0));
        // Sizes, places, emission; the jumps between them depend on the tree.
        item.saved.dispatches = 3;
        Ok(item)
    }

    fn duplicates(&self) -> Item {
        let what = "all but one of equal triangles";
        match self.scene.census.duplicates {
            0 => item(Omission::Duplicates, Status::NoneThere, what, "no two triangles are equal".to_owned()),
            count => {
                let why = format!(
                    "{} triangles are equal to others, but a leaf of several is not one triangle to the cost, so that the \
                     optimised tree would be another one",
                    format::count(count as u64)
                );
                item(Omission::Duplicates, Status::NotDone, what, why)
            }
        }
    }
}
