//! Trees of scenes that move: refitted to each frame, and made a little better in each.
//!
//! A refit makes the rotations that lower the cost on its way up, which mends most of what a frame does to the tree, and only near by; searches mend the rest.
//!
//! Rounds are those of worst first, and go on from frame to frame: keys, pool and fringe stay ([`prbvh_kernel::prbvh::worst`]), so that each frame begins
//! where the last one stopped. When every node had its turn, or after some frames, another walk begins at the top: what was searched in vain may have got
//! worse since.

mod edit;
mod error;
mod shapes;
mod working;

pub use error::ReoptimizeError;
pub use shapes::Shapes;

use super::ledger::Report;
use super::session::no_fault;
use super::{OptimizeError, WorstFirst};
use crate::build::{DeviceTree, Input};
use crate::bvh::{Bvh, Content, links_and_leaves};
use crate::device::{Buffer, Device, Held, Lease, Recording, on_host};
use crate::references::References;
use crate::scene::{SafeRange, stand_in};
use edit::Edited;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::status::{APPLIED, FAULTS, FRINGE, SEARCHED, VISITS, WAITING};
use std::ops::Range;
use std::time::{Duration, Instant};
use working::Working;

/// Rounds of one submission.
const ROUNDS: u32 = 3;
/// Frames after which a walk begins again. With rotations it hardly matters: over 60 frames of a bunny that is twisted by half a turn, with 20,000 visits a
/// frame, the last tree cost 1.143 to 1.147 times what a rebuilt one does with walks of 1 to 30 frames.
const FRAMES_OF_A_WALK: u32 = 6;
/// Fewest nodes of a round that is worth its dispatches.
const FEWEST: u32 = 8;
/// Visits of a search before any was counted.
const VISITS_OF_A_SEARCH: f64 = 300.0;
/// Seconds that a visit takes before any was timed.
const SECONDS_OF_A_VISIT: f64 = 5e-8;
/// Part of a budget that submissions aim at: what they take varies.
const AIM: f64 = 0.9;
/// Part of a budget that is not worth another submission.
const REST: f64 = 0.2;

/// How much a [step](Reoptimizer::step) may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Budget {
    /// About so many nodes are looked at: the same on every machine.
    Visits(u32),
    /// About so long.
    Time(Duration),
}

/// What a [step](Reoptimizer::step) did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Step {
    /// Nodes that the searches looked at.
    pub visits: u64,
    /// Nodes that were searched.
    pub searched: u64,
    /// Moves that were made.
    pub applied: u64,
}

/// A tree that follows a scene in motion. It holds its device, the tree and all buffers; a frame is a [refit](Self::refit) and a [step](Self::step), which
/// allocate nothing on the device.
///
/// Coordinates are those of the scene, and the tree on the device has them, too: they must be in the [range](SafeRange::check) in which areas can be relied
/// on. One primitive per leaf.
#[expect(missing_debug_implementations, reason = "devices are opaque")]
pub struct Reoptimizer<'d> {
    device: Held<'d>,
    working: Working,
    settings: WorstFirst,
    /// Whether refits rotate.
    rotates: bool,
    /// Whether the next round begins at the top.
    begins: bool,
    /// Frames since the walk began.
    frames: u32,
    visits_of_a_search: f64,
    seconds_of_a_visit: f64,
}

impl<'d> Reoptimizer<'d> {
    /// Takes a tree over `shapes` with leaves of any size, each primitive in one leaf: the pieces of spatial splits cannot be refitted. Its boxes are made
    /// anew from the shapes.
    ///
    /// # Errors
    /// If the tree is none, or none over the shapes, if these are not finite or out of range, or if the device fails.
    pub fn new<'a>(
        device: impl Into<Held<'d>>,
        tree: &Bvh,
        shapes: impl Into<Shapes<'a>>,
    ) -> Result<Self, ReoptimizeError> {
        let (mut device, shapes) = (device.into(), shapes.into());
        let mut boxes = vec![Aabb::EMPTY; shapes.len()];
        read(device.get(), shapes, &mut boxes)?;
        let faults = links_and_leaves(tree, boxes.len());
        if !faults.is_empty() {
            return Err(faults.into());
        }
        let stand_ins: Vec<Triangle> = boxes.iter().map(stand_in).collect();
        let split = References::split(&tree.clone().with_boxes_of(&stand_ins), &boxes)?.tree;
        let working = on_device(device.get(), &split, &boxes)?;
        Ok(Self {
            device,
            working,
            settings: WorstFirst::default(),
            rotates: true,
            begins: true,
            frames: 0,
            visits_of_a_search: VISITS_OF_A_SEARCH,
            seconds_of_a_visit: SECONDS_OF_A_VISIT,
        })
    }

    /// Other settings of the rounds: [`WorstFirst::climb`], [`WorstFirst::slack`] and [`WorstFirst::lock_rounds`]; the other fields have no meaning here.
    ///
    /// # Errors
    /// If one makes no sense.
    pub fn set(&mut self, settings: WorstFirst) -> Result<(), ReoptimizeError> {
        settings.check().map_err(OptimizeError::from)?;
        self.settings = settings;
        Ok(())
    }

    /// Whether a [refit](Self::refit) makes [rotations](super::rotations()) on its way up (Kopta et al. 2012), which it does unless told otherwise: nearly
    /// for free they undo most of what the motion does to the tree. Without them a refit changes no link.
    pub fn set_rotations(&mut self, rotates: bool) {
        self.rotates = rotates;
    }

    /// The shapes of another frame, as many as before: leaves get their boxes, and all boxes above are made anew, with
    /// [rotations](Self::set_rotations) on the way.
    ///
    /// # Errors
    /// If there are more or fewer shapes, or one is not finite: then the tree is as before. If they are out of range: then the tree is to be refitted to
    /// others before anything else. If the device fails.
    pub fn refit<'a>(&mut self, shapes: impl Into<Shapes<'a>>) -> Result<(), ReoptimizeError> {
        let shapes = shapes.into();
        let (have, need) = (shapes.len(), self.primitives() as usize);
        if have != need {
            return Err(ReoptimizeError::Count { have, need });
        }
        // Leaves keep their boxes until the refit.
        let are_good = self.working.take(self.device.get(), shapes)?;
        are_finite(shapes, are_good)?;
        self.follow(Recording::new())
    }

    /// [`refit`](Self::refit) to triangles that are on the device already, in a buffer of [`Triangle`]s that stays the caller's: nothing comes from the host.
    /// That they are finite is the caller's to see to; a box of the scene that is not, or out of range, is an error.
    ///
    /// # Errors
    /// If there are more or fewer triangles, the buffer is none of triangles of this device, they are out of range, or the device fails.
    pub fn refit_on_device(&mut self, triangles: &Buffer) -> Result<(), ReoptimizeError> {
        let (have, need) = (Input::from(triangles).len()?, self.primitives() as usize);
        if have != need {
            return Err(ReoptimizeError::Count { have, need });
        }
        let mut recording = Recording::new();
        self.working.record_take(&mut recording, triangles);
        self.follow(recording)
    }

    /// Makes all boxes anew after what was recorded.
    fn follow(&mut self, recording: Recording) -> Result<(), ReoptimizeError> {
        self.frames += 1;
        self.begins |= self.frames >= FRAMES_OF_A_WALK;
        let root = self.working.refit(self.device.get(), recording, self.rotates)?;
        Ok(SafeRange::check(&root)?)
    }

    /// Rounds of moves, about as many as the budget pays for; a budget of nothing buys none. What a search takes is known from the steps before.
    ///
    /// # Errors
    /// If the device fails or a kernel reports a fault.
    pub fn step(&mut self, budget: Budget) -> Result<Step, ReoptimizeError> {
        let begin = Instant::now();
        let mut step = Step::default();
        let visits = |done: u64, seconds_of_a_visit: f64| match budget {
            Budget::Visits(visits) => f64::from(visits) - done as f64,
            Budget::Time(limit) => limit.saturating_sub(begin.elapsed()).as_secs_f64() / seconds_of_a_visit,
        };
        let whole = visits(0, self.seconds_of_a_visit);
        loop {
            let left = visits(step.visits, self.seconds_of_a_visit);
            let searches = AIM * left / self.visits_of_a_search;
            if searches < 1.0 || (step.visits > 0 && left < REST * whole) {
                return Ok(step);
            }
            let rounds = ((searches / f64::from(FEWEST)) as u32).clamp(1, ROUNDS);
            let wanted = ((searches / f64::from(rounds)) as u32).max(1);
            let done = self.rounds(rounds, wanted)?;
            step.visits += done.visits;
            step.searched += done.searched;
            step.applied += done.applied;
            // Children of the root are on the list, too, and are not looked at: a small tree may have no others.
            if done.visits == 0 {
                return Ok(step);
            }
        }
    }

    /// Runs rounds, and learns from them what a search takes.
    fn rounds(&mut self, rounds: u32, wanted: u32) -> Result<Step, ReoptimizeError> {
        let begin = Instant::now();
        let device = self.device.get();
        let begins = std::mem::replace(&mut self.begins, false);
        if begins {
            self.frames = 0;
        }
        let reports = self.working.rounds(device, &self.settings, begins, (rounds, wanted))?;
        let mut done = Step::default();
        for report in &reports {
            no_fault(device, report[FAULTS])?;
            done.visits += u64::from(report[VISITS]);
            done.searched += u64::from(report[SEARCHED]);
            done.applied += u64::from(report[APPLIED]);
        }
        let is_over = |report: &Report| report[SEARCHED] + report[WAITING] + report[FRINGE] == 0;
        self.begins = reports.last().is_some_and(is_over);
        if done.visits > 0 {
            let mix = |have: &mut f64, new: f64| *have = 0.5 * (*have + new);
            mix(&mut self.visits_of_a_search, done.visits as f64 / done.searched.max(1) as f64);
            mix(&mut self.seconds_of_a_visit, begin.elapsed().as_secs_f64() / done.visits as f64);
        }
        Ok(done)
    }

    /// SAH cost of the tree as it is, one primitive per leaf; unitless, from f32 areas.
    ///
    /// # Errors
    /// If the device fails.
    pub fn cost(&mut self) -> Result<f64, ReoptimizeError> {
        let areas = self.working.areas(self.device.get())?;
        Ok(areas.cost(self.working.tree.references))
    }

    /// The tree as it is, copied to the host.
    ///
    /// # Errors
    /// If the device fails.
    pub fn tree(&mut self) -> Result<Bvh, ReoptimizeError> {
        Ok(self.working.tree.decode(self.device.get(), 0)??)
    }

    /// The tree where the device has it; another buffer after [`Reoptimizer::insert`] and [`Reoptimizer::remove`].
    #[must_use]
    pub fn device_tree(&self) -> &DeviceTree {
        &self.working.tree
    }

    /// The device, to work with the tree on it.
    pub fn device(&mut self) -> &mut (dyn Device + 'd) {
        self.device.get()
    }

    /// Primitives.
    #[must_use]
    pub fn primitives(&self) -> u32 {
        self.working.tree.references
    }

    /// Adds primitives, each where it costs least, one after another; returns their numbers, which follow those there are. The tree is copied to the host and
    /// back: many at once cost little more than one.
    ///
    /// # Errors
    /// If one is not finite or the device fails; the tree is then as it was.
    pub fn insert<'a>(&mut self, shapes: impl Into<Shapes<'a>>) -> Result<Range<u32>, ReoptimizeError> {
        let shapes = shapes.into();
        let mut more = vec![Aabb::EMPTY; shapes.len()];
        read(self.device.get(), shapes, &mut more)?;
        let tree = self.tree()?;
        let first = self.primitives();
        let boxes = [&boxes_of(&tree), &more[..]].concat();
        let mut edited = Edited::new(tree);
        more.iter().for_each(|&aabb| edited.insert(aabb));
        self.replace(&edited.finish(), &boxes)?;
        Ok(first..self.primitives())
    }

    /// Removes primitives by their numbers, in any order; one at least must stay. The others keep their order, as in a `Vec` from which these are removed.
    /// The tree is copied to the host and back.
    ///
    /// # Errors
    /// If one is not there, none would stay, or the device fails; the tree is then as it was.
    pub fn remove(&mut self, primitives: &[u32]) -> Result<(), ReoptimizeError> {
        let mut is_out = vec![false; self.primitives() as usize];
        for &primitive in primitives {
            let unknown = ReoptimizeError::Remove { primitive, primitives: is_out.len() };
            *is_out.get_mut(primitive as usize).ok_or(unknown)? = true;
        }
        if let (true, Some(&primitive)) = (is_out.iter().all(|&is_out| is_out), primitives.last()) {
            return Err(ReoptimizeError::Remove { primitive, primitives: is_out.len() });
        }
        let tree = self.tree()?;
        let boxes = boxes_of(&tree);
        let stay = boxes.iter().zip(&is_out).filter(|(_, is_out)| !**is_out);
        let boxes: Vec<Aabb> = stay.map(|(aabb, _)| *aabb).collect();
        let mut edited = Edited::new(tree);
        edited.remove(&is_out);
        self.replace(&edited.finish(), &boxes)
    }

    /// Another tree in place of this one.
    fn replace(&mut self, tree: &Bvh, boxes: &[Aabb]) -> Result<(), ReoptimizeError> {
        let device = self.device.get();
        let working = on_device(device, tree, boxes)?;
        std::mem::replace(&mut self.working, working).free(device);
        self.begins = true;
        Ok(())
    }
}

/// A lent device gets its memory back.
impl Drop for Reoptimizer<'_> {
    fn drop(&mut self) {
        self.working.free(self.device.get());
    }
}

/// Takes the boxes of the shapes, if these are all finite.
fn read(device: &dyn Device, shapes: Shapes<'_>, boxes: &mut [Aabb]) -> Result<(), ReoptimizeError> {
    are_finite(shapes, on_host(device, || shapes.write(0, boxes)))
}

/// What is wrong with shapes that are no good.
fn are_finite(shapes: Shapes<'_>, are_good: bool) -> Result<(), ReoptimizeError> {
    if are_good {
        return Ok(());
    }
    // Finite after all, but so large that they are out of range.
    shapes.fault().map_or(Ok(()), |fault| Err(fault.into()))
}

/// Boxes of the primitives of a tree of one per leaf.
fn boxes_of(tree: &Bvh) -> Vec<Aabb> {
    let mut boxes = vec![Aabb::EMPTY; tree.triangle_order.len()];
    for node in &tree.nodes {
        if let Content::Leaf { first, .. } = node.content {
            boxes[tree.triangle_order[first as usize] as usize] = node.aabb;
        }
    }
    boxes
}

/// A tree of one primitive per leaf with all that frames need.
fn on_device(device: &mut dyn Device, tree: &Bvh, boxes: &[Aabb]) -> Result<Working, ReoptimizeError> {
    let nodes = tree.to_device()?;
    let lease = &mut Lease::new(device);
    let mut working = Working::new(lease, &nodes, ROUNDS)?;
    working.take(lease, boxes.into())?;
    let root = working.refit(lease, Recording::new(), false)?;
    SafeRange::check(&root)?;
    lease.keep();
    Ok(working)
}
