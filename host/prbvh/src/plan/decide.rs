//! The decisions, each with its reason and its saving.

use super::dry::{DryDevice, Taken, saving};
use super::phase::{AGGRESSIVE, BUILD, COLLAPSE, CONSERVATIVE, ITERATIONS, optimizer_of};
use super::{CodeSize, Item, Omission, Plan, Saving, Status};
use crate::build::{Codes, MOST_COMPARED, MortonBits};
use crate::device::{DeviceError, DeviceInfo};
use crate::format;
use crate::optimize::{Order, PrbvhSettings, Strategy, WorstFirst};
use crate::scene::{Primitives, Scene};
use crate::settings::{Initial, Optimizer, Settings};
use bytemuck::Zeroable;
use prbvh_kernel::Kernel;
use prbvh_kernel::setup::Triangle;
use std::collections::BTreeSet;

/// Why duplicates are not folded.
const DUPLICATES: &str = "the tree is another one, of about the same cost: ask with --fold-duplicates";

/// A tree of fewer references has no internal node with a grandparent.
const FEWEST_THAT_MOVE: usize = 4;

/// Kernels of wide trees.
const WIDE: [Kernel; 7] = [
    Kernel::CollapseWiden,
    Kernel::TraceBvh4,
    Kernel::TraceBvh4Deep,
    Kernel::TraceBvh8,
    Kernel::TraceBvh8Deep,
    Kernel::TraceCwbvh,
    Kernel::TraceCwbvhDeep,
];

/// Why µ does not follow the conflicts.
const MU_BY_CONFLICTS: &str = "a µ that falls where few moves collide took more searches to the same cost (docs/plan.md); µ falls when the cost settles";

/// The decisions; `taken` is what the plan's phases took, `kernels` what those that run may take.
pub(super) fn items(
    plan: &Plan,
    taken: &[Taken],
    kernels: &BTreeSet<Kernel>,
    scene: &Scene,
    info: &DeviceInfo,
    settings: &Settings,
) -> Result<Vec<Item>, DeviceError> {
    let decide = Decide { plan, taken, kernels, scene, info, settings };
    let mut items = if settings.initial.has_codes() {
        vec![decide.lower_codes()?, decide.equal_bits()?]
    } else {
        vec![decide.no_codes()?]
    };
    items.extend(decide.presplit());
    items.extend(decide.optimizer()?);
    items.push(decide.collapse());
    items.push(decide.wide());
    items.push(decide.attributes());
    items.push(decide.duplicates()?);
    items.push(decide.kernels());
    Ok(items)
}

fn item(omission: Omission, status: Status, why: impl Into<String>) -> Item {
    Item { omission, status, what: omission.to_string(), why: why.into(), saved: Saving::default() }
}

struct Decide<'a> {
    plan: &'a Plan,
    taken: &'a [Taken],
    kernels: &'a BTreeSet<Kernel>,
    scene: &'a Scene,
    info: &'a DeviceInfo,
    settings: &'a Settings,
}

impl Decide<'_> {
    /// What a builder takes that is not the plan's.
    fn build(&self, initial: &Initial, codes: Codes) -> Result<Taken, DeviceError> {
        let mut dry = DryDevice::new(self.info);
        let references = self.plan.references;
        let stand_ins = vec![Triangle::zeroed(); if references > self.scene.triangles.len() { references } else { 0 }];
        dry.build(initial, codes, self.scene.triangles.get(..references).unwrap_or(&stand_ins))?;
        Ok(dry.taken())
    }

    /// What `without` takes beyond `with`, and the kernels that the run then does not need.
    fn saving(&self, without: &Taken, with: &Taken) -> Saving {
        let mut saved = saving(without, with);
        if self.plan.code.compiled_at_run {
            let CodeSize { kernels, spirv_bytes } = CodeSize::of(without.kernels.difference(self.kernels));
            saved = Saving { kernels, spirv_bytes, ..saved };
        }
        saved
    }

    /// Nothing where nobody asked.
    fn presplit(&self) -> Option<Item> {
        let census = self.plan.presplit_census?;
        let candidates = format::count(census.candidates as u64);
        let excess = format!(
            "a random ray meets {:.2} boxes of triangles without need, {:.2} of them large ones",
            census.excess, census.excess_of_large
        );
        Some(if self.plan.presplits {
            item(Omission::Presplit, Status::Needed, format!("{excess}; {candidates} triangles may be split"))
        } else if self.scene.primitives == Primitives::Boxes {
            item(Omission::Presplit, Status::NoneThere, "the scene is of boxes, which are not cut")
        } else if census.candidates == 0 {
            item(Omission::Presplit, Status::NoneThere, "no triangle's box would get smaller by it")
        } else {
            item(Omission::Presplit, Status::LeftOut, format!("{excess}: too few to pay for more references"))
        })
    }

    fn no_codes(&self) -> Result<Item, DeviceError> {
        let mut item = item(Omission::Codes, Status::LeftOut, format!("the initial tree is {}", self.settings.initial));
        let without = self.build(&Initial::Lbvh, Codes::from(self.settings.morton_bits))?;
        item.saved = self.saving(&without, &self.taken[BUILD]);
        Ok(item)
    }

    fn lower_codes(&self) -> Result<Item, DeviceError> {
        let codes = self.plan.codes;
        let decided = |status, why: String| item(Omission::LowerCodes, status, why);
        if codes.bits == MortonBits::Sixty {
            let why = match self.plan.code_census.and_then(|census| census.low_tells_more) {
                _ if self.plan.presplits => "the codes are those of references that are not there yet".to_owned(),
                Some(true) => "two triangles differ in them alone".to_owned(),
                Some(false) => "kept in, though no two triangles differ in them alone".to_owned(),
                None => format!(
                    "the triangles differ in them; whether in them alone is not asked for more than {}, where the question \
                     costs what they do",
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
        item.saved = self.saving(&without, &self.taken[BUILD]);
        Ok(item)
    }

    fn equal_bits(&self) -> Result<Item, DeviceError> {
        let codes = self.plan.codes;
        let words = if codes.bits == MortonBits::Thirty { 1 } else { 2 };
        let differ: u32 = [codes.high, codes.low][..words].iter().map(|word| word.count_ones()).sum();
        let all = Codes::from(codes.bits);
        let is_less = codes.high != all.high || (words == 2 && codes.low != all.low);
        if !is_less {
            if self.plan.presplits {
                let why = "the codes are those of references that are not there yet";
                return Ok(item(Omission::EqualBits, Status::Needed, why));
            }
            let looked_at = self.plan.code_census.map_or(0, |census| census.looked_at);
            let why = format!(
                "of {} codes each pass has bits that differ, or too few have none to pay for a look at all codes",
                format::count(looked_at as u64)
            );
            return Ok(item(Omission::EqualBits, Status::Needed, why));
        }
        let mut item =
            item(Omission::EqualBits, Status::LeftOut, format!("the codes differ in {differ} of {} bits", 30 * words));
        item.saved = self.saving(&self.build(&self.settings.initial, all)?, &self.taken[BUILD]);
        Ok(item)
    }

    /// What PRBVH takes on a device like this one.
    fn optimize(&self, prbvh: PrbvhSettings, atomics_64: bool, iterations: u32) -> Result<Taken, DeviceError> {
        let mut dry = DryDevice::new(&DeviceInfo { atomics_64, ..self.info.clone() });
        dry.optimize(self.plan.references, prbvh, iterations)?;
        Ok(dry.taken())
    }

    fn optimizer(&self) -> Result<Vec<Item>, DeviceError> {
        let prbvh = &self.settings.prbvh;
        let taken = &self.taken[optimizer_of(prbvh)];
        let per_iteration = |dispatches: u64| dispatches / taken.iterations.max(1);
        if self.settings.optimizer != Optimizer::Prbvh {
            let why = format!("the optimiser is {}", self.settings.optimizer);
            let mut item = item(Omission::DeviceOptimizer, Status::LeftOut, why);
            let mut dry = DryDevice::new(self.info);
            match &self.settings.optimizer {
                Optimizer::Rotations(rotations) => dry.rotate(self.plan.references, rotations, ITERATIONS)?,
                _ => dry.hold_tree(self.plan.references)?,
            }
            item.saved = self.saving(taken, &dry.taken());
            let start = self.optimize(prbvh.clone(), self.info.atomics_64, 0)?;
            item.saved.dispatches = start.dispatches;
            item.saved.dispatches_per_iteration = per_iteration(taken.dispatches - start.dispatches);
            return Ok(vec![item]);
        }
        let mut lock = if self.info.atomics_64 {
            let why = "the device has 64-bit atomics; both kinds of locks take 8 bytes a node";
            item(Omission::LockWord, Status::LeftOut, why)
        } else {
            item(Omission::LockWord, Status::Needed, "the device has no 64-bit atomics")
        };
        if self.info.atomics_64 {
            lock.saved = self.saving(&self.optimize(prbvh.clone(), false, ITERATIONS)?, taken);
            let dispatches = std::mem::take(&mut lock.saved.dispatches);
            lock.saved.dispatches_per_iteration = per_iteration(dispatches);
        }
        let boxes = item(Omission::UnchangedBoxes, Status::LeftOut, "only nodes above a move are refitted");
        let mut items = vec![lock, boxes];
        items.extend(match prbvh.order {
            Order::WorstFirst => self.worst_first()?,
            Order::Published => self.published(),
        });
        Ok(items)
    }

    fn published(&self) -> Vec<Item> {
        let (aggressive, conservative) = (&self.taken[AGGRESSIVE], &self.taken[CONSERVATIVE]);
        let paths = match self.settings.prbvh.strategy {
            Strategy::Conservative => item(Omission::Paths, Status::Needed, "the strategy is that"),
            Strategy::Aggressive => Item {
                saved: self.saving(conservative, aggressive),
                ..item(Omission::Paths, Status::LeftOut, "the strategy is aggressive")
            },
        };
        let why = "the ancestors of a node are visited as pivots, but are no candidates: evaluated exactly they changed the final cost \
                   of six scenes by -0.1 % to +0.5 %";
        let ancestors = item(Omission::Ancestors, Status::LeftOut, why);
        let conflicts = item(Omission::Conflicts, Status::NotDone, MU_BY_CONFLICTS);
        vec![paths, ancestors, conflicts, item(Omission::Untouched, Status::Needed, "all nodes are searched in turn")]
    }

    fn worst_first(&self) -> Result<Vec<Item>, DeviceError> {
        let why = "keys are computed from the top of the tree downward, as far as the rounds come";
        let untouched = item(Omission::Untouched, Status::LeftOut, why);
        let worst_first = self.settings.prbvh.worst_first;
        let tail = if self.plan.references < FEWEST_THAT_MOVE {
            item(Omission::Tail, Status::NoneThere, "no internal node has a grandparent: none can move")
        } else if worst_first.tail_part > 0.0 {
            item(Omission::Tail, Status::Needed, "the settings ask for it")
        } else {
            item(Omission::Tail, Status::LeftOut, "the settings are without it")
        };
        let tops = if worst_first.top == 0 {
            item(Omission::Tops, Status::LeftOut, "the settings are without it")
        } else if worst_first.tops(self.plan.references.saturating_sub(1) as u32).is_empty() {
            item(Omission::Tops, Status::NoneThere, "the tree, or the top that was asked for, is too small for it")
        } else {
            item(Omission::Tops, Status::Needed, "where the rounds end is decided near the root")
        };
        Ok(vec![untouched, tops, tail, self.more_locks(worst_first)?])
    }

    fn more_locks(&self, worst_first: WorstFirst) -> Result<Item, DeviceError> {
        if worst_first.lock_rounds > 1 {
            let why = format!("{} over one tree: losers of one may win the next", worst_first.lock_rounds);
            return Ok(item(Omission::MoreLocks, Status::Needed, why));
        }
        let mut item = item(Omission::MoreLocks, Status::LeftOut, "the settings have one round");
        let two =
            PrbvhSettings { worst_first: WorstFirst { lock_rounds: 2, ..worst_first }, ..self.settings.prbvh.clone() };
        let two = self.optimize(two, self.info.atomics_64, ITERATIONS)?;
        let one = &self.taken[optimizer_of(&self.settings.prbvh)];
        item.saved.dispatches_per_iteration = (two.dispatches - one.dispatches) / two.iterations.max(1);
        Ok(item)
    }

    fn collapse(&self) -> Item {
        let why = match &self.settings.adaptive {
            _ if self.plan.collapses => {
                return item(Omission::Collapse, Status::Needed, "adaptive leaves were asked for");
            }
            None => "one triangle per leaf was asked for",
            Some(_) => "no leaf can have a second triangle, so that the collapsed tree is the optimised one",
        };
        let mut item = item(Omission::Collapse, Status::LeftOut, why);
        let taken = &self.taken[COLLAPSE];
        // Beyond what the run takes without it.
        let peak = self.plan.phases.iter().filter(|phase| phase.runs).map(|phase| phase.peak_bytes).max();
        let run = Taken { peak_bytes: peak.unwrap_or(0), ..Taken::default() };
        item.saved = self.saving(taken, &run);
        // Sizes, places, emission; the jumps between them depend on the tree.
        item.saved.dispatches = 3;
        item
    }

    /// The buffers and kernels that trace wide trees belong to no phase of a run.
    fn wide(&self) -> Item {
        let Some(wide) = &self.settings.wide else {
            let mut item = item(Omission::Wide, Status::LeftOut, "nobody asked for them");
            let without = Taken { kernels: WIDE.into(), ..Taken::default() };
            item.saved = self.saving(&without, &Taken::default());
            item.saved.dispatches = 1;
            return item;
        };
        item(
            Omission::Wide,
            Status::Needed,
            format!("{} children in the layout {} were asked for", wide.width, wide.layout),
        )
    }

    fn attributes(&self) -> Item {
        let mut item = item(Omission::Attributes, Status::LeftOut, "only positions are read");
        item.saved.host_bytes = self.scene.attribute_bytes;
        if item.saved.host_bytes == 0 {
            item = Item { status: Status::NoneThere, why: "the scene has none".to_owned(), ..item };
        }
        item
    }

    fn duplicates(&self) -> Result<Item, DeviceError> {
        let (n, equal) = (self.scene.triangles.len(), self.scene.census.duplicates);
        let count = |count: usize| format::count(count as u64);
        if self.plan.fold.is_some() {
            let folded = n - self.plan.references;
            let why = format!(
                "{} of {} triangles have the box of another: they come back when the tree is optimised",
                count(folded),
                count(n)
            );
            let mut dry = DryDevice::new(self.info);
            dry.optimize(n, self.settings.prbvh.clone(), 0)?;
            let run = self.plan.phases.iter().filter(|phase| phase.runs && !phase.phase.starts_with("collapse"));
            let peak_bytes = run.map(|phase| phase.peak_bytes).max().unwrap_or(0);
            let saved = saving(&dry.taken(), &Taken { peak_bytes, ..Taken::default() });
            return Ok(Item {
                saved: Saving { bytes: saved.bytes, ..Saving::default() },
                ..item(Omission::Duplicates, Status::LeftOut, why)
            });
        }
        if self.settings.fold_duplicates {
            let why = match self.settings.optimizer {
                Optimizer::None => "nothing is optimised",
                _ if self.settings.initial.is_given() => "the initial tree is over all triangles",
                _ => return Ok(item(Omission::Duplicates, Status::NoneThere, "no two triangles have equal boxes")),
            };
            return Ok(item(Omission::Duplicates, Status::Needed, why));
        }
        Ok(match equal {
            0 => item(
                Omission::Duplicates,
                Status::NoneThere,
                "no two triangles are equal; --fold-duplicates asks for boxes",
            ),
            equal => {
                let why = format!("{} triangles are equal to others, but without them {DUPLICATES}", count(equal));
                item(Omission::Duplicates, Status::NotDone, why)
            }
        })
    }

    fn kernels(&self) -> Item {
        let code = &self.plan.code;
        let of = format!("{} of {} run", code.runs.kernels, code.all.kernels);
        if !code.compiled_at_run {
            let why = format!("{of}, and all are native code of this program: none is compiled at run time");
            return item(Omission::Kernels, Status::NoneThere, why);
        }
        let mut item =
            item(Omission::Kernels, Status::LeftOut, format!("{of}; a pipeline is made when its kernel is first run"));
        let CodeSize { kernels, spirv_bytes } = code.left_out();
        item.saved = Saving { kernels, spirv_bytes, ..Saving::default() };
        item
    }
}
