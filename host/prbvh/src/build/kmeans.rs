//! k-means (Meister & Bittner 2016, *Parallel BVH Construction Using k-means Clustering*): from the top down each part becomes up to `k` clusters of boxes
//! that are alike, and these become a binary subtree by agglomeration. What the kernels do is in [`prbvh_kernel::kmeans`].

use super::codes::Codes;
use super::order::MortonOrder;
use super::sort::Sorter;
use super::{DeviceTree, Input, Scratch, arrivals_length, record_refit};
use crate::check::{SettingError, must};
use crate::device::{Buffer, Device, DeviceError, Lease, Recording, Timing};
use crate::parameters::parameters;
use crate::random::Random;
use prbvh_kernel::kmeans::{
    AssignParams, CHUNK, CentresParams, Frame, HalveParams, JoinParams, MOST_CANDIDATES, MOST_CLUSTERS, MeansParams,
    PER_CLUSTER, Part, Point, RelabelParams, TALLY_WORDS, TallyParams,
};
use prbvh_kernel::{Kernel, grid};

/// Settings of [`kmeans`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default))]
#[non_exhaustive]
pub struct KMeansSettings {
    /// Clusters of a part, 2 to 64.
    pub k: u32,
    /// References that are drawn for each centre after the first: the one farthest from the centres before it is taken. 1 to 30.
    pub p: u32,
    /// Rounds in which the centres become the means of their clusters, 200 at most; 0: the clusters are those of the first centres.
    pub i: u32,
    /// Seed of the draws.
    pub seed: u64,
}

impl KMeansSettings {
    /// As published, the fastest first.
    pub const Q1: Self = Self { k: 8, p: 5, i: 0, seed: 1 };
    /// See [`Self::Q1`].
    pub const Q2: Self = Self { i: 2, ..Self::Q1 };
    /// See [`Self::Q1`].
    pub const Q3: Self = Self { k: 16, i: 5, ..Self::Q1 };
    /// See [`Self::Q1`].
    pub const Q4: Self = Self { k: 32, p: 20, i: 10, ..Self::Q1 };
    /// See [`Self::Q1`].
    pub const Q5: Self = Self { k: 64, p: 30, i: 15, ..Self::Q1 };

    /// Whether every value makes sense.
    ///
    /// # Errors
    /// The first that makes none.
    pub fn check(&self) -> Result<(), SettingError> {
        must("kmeans.k", self.k, (2..=MOST_CLUSTERS).contains(&self.k), "2 to 64")?;
        must("kmeans.p", self.p, (1..=MOST_CANDIDATES).contains(&self.p), "1 to 30")?;
        must("kmeans.i", self.i, self.i <= MOST_ROUNDS, "200 or less")
    }
}

impl Default for KMeansSettings {
    fn default() -> Self {
        Self::Q3
    }
}

parameters!(
    KMeansSettings,
    known "q1, q2, q3, q4, q5, k=N, p=N, i=N, seed=N",
    presets { "q1" => Self::Q1, "q2" => Self::Q2, "q3" => Self::Q3, "q4" => Self::Q4, "q5" => Self::Q5, "" => Self::default() },
    k, p, i, seed
);

/// Most rounds: a small part is split within the loops that a device lets a kernel make.
const MOST_ROUNDS: u32 = 200;

/// Rounds of all loops of a kernel, with room to 65,535, after which lavapipe leaves them.
const LOOPS: u32 = 60_000;
const _: () = assert!(PER_CLUSTER * MOST_CLUSTERS * (MOST_ROUNDS + 3) + MOST_CANDIDATES <= LOOPS);

/// Levels of clusters after which large parts are halved. Only made-up inputs come so far.
const MOST_LEVELS: u32 = 64;

/// Halvings that make every part small.
const MOST_HALVINGS: u32 = 31;

/// Why there is no tree by [`kmeans`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum KMeansError {
    /// A setting makes no sense. Nothing has run.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// The device refused or failed.
    #[error(transparent)]
    Device(#[from] DeviceError),
}

/// Builds a tree over `triangles`, whose coordinates are in the safe range (`crate::scene::SafeRange`). Returns it with the times of its stages. Triangles that are
/// handed over are freed as soon as the device has them.
///
/// References begin in Morton order. Of equally near centres the first is taken. A part of which all references come to one cluster is halved in its order.
///
/// # Errors
/// If a setting makes no sense, there are no triangles, they do not fit the device or [are out of range](crate::scene::SafeRange::check), or the device fails.
pub fn kmeans<'a>(
    device: &mut dyn Device,
    triangles: impl Into<Input<'a>>,
    codes: impl Into<Codes>,
    settings: &KMeansSettings,
) -> Result<(DeviceTree, Vec<Timing>), KMeansError> {
    settings.check()?;
    Ok(kmeans_unchecked(device, triangles, codes, settings)?)
}

/// [`kmeans`] with settings that make sense.
pub(crate) fn kmeans_unchecked<'a>(
    device: &mut dyn Device,
    triangles: impl Into<Input<'a>>,
    codes: impl Into<Codes>,
    settings: &KMeansSettings,
) -> Result<(DeviceTree, Vec<Timing>), DeviceError> {
    let device = &mut Lease::new(device);
    let mut recording = Recording::new();
    let (mut sorted, mut timings) = MortonOrder::record(&mut recording, device, triangles.into(), codes.into())?;
    timings.extend(device.run(&recording)?);
    sorted.free_codes(device);
    let n = sorted.references;
    let tree = DeviceTree::allocate(device, n)?;
    let mut recording = Recording::new();
    if n > 1 {
        let mut scratch = Scratch::default();
        let clustering = Clustering::new(&mut scratch, device, &sorted, &tree, *settings)?;
        clustering.run(device, &mut timings)?;
        scratch.free(device);
    }
    sorted.record_leaves(&mut recording, "leaves", &tree.nodes);
    let mut scratch = Scratch::default();
    let arrivals = scratch.allocate(device, "arrivals", arrivals_length(n), 4)?;
    record_refit(&mut recording, n, &tree.nodes, &arrivals);
    timings.extend(device.run(&recording)?);
    scratch.free(device);
    sorted.free(device);
    device.keep();
    Ok((tree, timings))
}

/// What is between the order of the references and the links of the tree.
struct Clustering<'a> {
    sorted: &'a MortonOrder,
    tree: &'a DeviceTree,
    settings: KMeansSettings,
    /// What draws are made of.
    seed: u32,
    /// Large parts of a level, and of the next.
    parts: [Buffer; 2],
    /// First places of small parts, and how far each is.
    small: Buffer,
    cursors: Buffer,
    /// Large parts of the next level, small parts so far.
    progress: Buffer,
    /// Of places: the first one of their part, and the cluster in it.
    starts: Buffer,
    labels: Buffer,
    /// By first place.
    sizes: Buffer,
    /// By slot.
    frames: Buffer,
    centres: Buffer,
    tallies: Buffer,
    targets: Buffer,
    sorter: Sorter,
}

impl<'a> Clustering<'a> {
    fn new(
        scratch: &mut Scratch,
        device: &mut dyn Device,
        sorted: &'a MortonOrder,
        tree: &'a DeviceTree,
        settings: KMeansSettings,
    ) -> Result<Self, DeviceError> {
        let n = sorted.references as usize;
        let slots = n.div_ceil(PER_CLUSTER as usize) + 1;
        let most_parts = n / (PER_CLUSTER * settings.k) as usize + 1;
        let mut allocate = |label, length, bytes| scratch.allocate(device, label, length, bytes);
        let clustering = Self {
            sorted,
            tree,
            settings,
            seed: (Random::new(settings.seed).bits() >> 32) as u32,
            parts: [
                allocate("parts", most_parts, size_of::<Part>())?,
                allocate("next parts", most_parts, size_of::<Part>())?,
            ],
            small: allocate("small parts", n / 2 + 1, 4)?,
            cursors: allocate("cursors", n / 2 + 1, 4)?,
            progress: allocate("progress", 2, 4)?,
            starts: allocate("starts", n, 4)?,
            labels: allocate("labels", n, 4)?,
            sizes: allocate("sizes", n, 4)?,
            frames: allocate("frames", slots, size_of::<Frame>())?,
            centres: allocate("centres", slots, size_of::<Point>())?,
            tallies: allocate("tallies", slots * TALLY_WORDS as usize, 4)?,
            targets: allocate("targets", slots, 4)?,
            sorter: Sorter::new(scratch, device, sorted.references)?,
        };
        Ok(clustering)
    }

    /// References from which on a part is large.
    fn large(&self) -> u32 {
        PER_CLUSTER * self.settings.k
    }

    fn run(&self, device: &mut dyn Device, timings: &mut Vec<Timing>) -> Result<(), DeviceError> {
        let n = self.sorted.references;
        let mut recording = Recording::new();
        for buffer in [&self.starts, &self.tallies, &self.small, &self.cursors] {
            recording.clear("clusters", buffer);
        }
        let mut sizes = vec![0u32; n as usize];
        sizes[0] = n;
        device.upload(&self.sizes, bytemuck::cast_slice(&sizes))?;
        drop(sizes);
        let mut progress = [0, 1];
        if n >= self.large() {
            let mut parts = vec![Part { min: [0.0; 3], start: 0, max: [0.0; 3], size: 0 }; self.parts[0].length];
            let scene = self.sorted.scene_box;
            parts[0] = Part { min: scene.min, start: 0, max: scene.max, size: n };
            device.upload(&self.parts[0], bytemuck::cast_slice(&parts))?;
            progress = [1, 0];
        }
        device.upload(&self.progress, bytemuck::cast_slice(&[0u32, progress[1]]))?;
        timings.extend(device.run(&recording)?);
        let mut level = 0;
        while progress[0] > 0 && level < MOST_LEVELS + MOST_HALVINGS {
            let mut recording = Recording::new();
            self.record_level(&mut recording, progress[0].min(self.parts[0].length as u32), level);
            recording.fetch("tally", &self.progress, size_of_val(&progress));
            timings.extend(device.run(&recording)?);
            device.download(&self.progress, bytemuck::bytes_of_mut(&mut progress))?;
            device.upload(&self.progress, bytemuck::cast_slice(&[0, progress[1]]))?;
            level += 1;
        }
        tracing::debug!("k-means: {level} levels, {} small parts", progress[1]);
        self.halve(device, progress[1], timings)
    }

    /// Records a level of so many parts.
    fn record_level(&self, recording: &mut Recording, count: u32, level: u32) {
        let KMeansSettings { k: clusters, p: candidates, i: rounds, .. } = self.settings;
        let (n, order, boxes) = (self.sorted.references, &self.sorted.order, &self.sorted.boxes);
        let turn = level as usize % 2;
        let (parts, next) = (&self.parts[turn], &self.parts[1 - turn]);
        let Self { starts, labels, sizes, frames, centres, tallies, targets, .. } = self;
        let params = CentresParams { count, clusters, candidates, seed: self.seed };
        let buffers = [parts, order, boxes, frames, centres, tallies];
        recording.dispatch("centres", Kernel::KmeansCentres, count, &params, &buffers);
        let invocations = grid::invocations(n.div_ceil(CHUNK));
        for round in 0..=rounds {
            let adds = u32::from(round < rounds);
            let params = AssignParams { count: invocations, references: n, clusters, round, adds };
            let buffers = [order, boxes, starts, sizes, frames, centres, labels, tallies];
            recording.dispatch("assign", Kernel::KmeansAssign, invocations, &params, &buffers);
            if round < rounds {
                let params = MeansParams { count: count * clusters, clusters, round };
                recording.dispatch("means", Kernel::KmeansMeans, params.count, &params, &[parts, tallies, centres]);
            }
        }
        let buffers = [order, boxes, starts, labels, tallies];
        recording.dispatch("tally", Kernel::KmeansTally, n, &TallyParams { count: n }, &buffers);
        let groups = grid::invocations(count);
        let halves = u32::from(level >= MOST_LEVELS);
        let params = JoinParams { count: groups, references: n, clusters, halves };
        let buffers = [parts, tallies, targets, sizes, &self.tree.nodes, next, &self.small, &self.progress];
        recording.dispatch("join", Kernel::KmeansJoin, groups, &params, &buffers);
        let buffers = [labels, targets, sizes, starts];
        recording.dispatch("relabel", Kernel::KmeansRelabel, n, &RelabelParams { count: n }, &buffers);
        self.sorter.record(recording, starts, order, u32::MAX >> (n - 1).leading_zeros());
    }

    /// Splits the small parts.
    fn halve(&self, device: &mut dyn Device, parts: u32, timings: &mut Vec<Timing>) -> Result<(), DeviceError> {
        let KMeansSettings { p: candidates, i: rounds, .. } = self.settings;
        // A device that only counts has none.
        let count = parts.clamp(1, self.small.length as u32);
        let steps = LOOPS / (self.large() * (rounds + 3) + candidates);
        let params =
            HalveParams { count, references: self.sorted.references, steps, candidates, rounds, seed: self.seed };
        let waiting = &self.progress;
        let buffers = [
            &self.small,
            &self.starts,
            &self.sorted.boxes,
            &self.sorted.order,
            &self.sizes,
            &self.cursors,
            &self.tree.nodes,
            waiting,
        ];
        let mut recording = Recording::new();
        // A step for each part that is split, and one for each reference that is passed.
        for _ in 0..(2 * self.large()).div_ceil(steps) {
            recording.clear("halve", waiting);
            recording.dispatch("halve", Kernel::KmeansHalve, count, &params, &buffers);
        }
        let mut waiting_parts = [0u32; 2];
        recording.fetch("halve", waiting, size_of_val(&waiting_parts));
        timings.extend(device.run(&recording)?);
        device.download(waiting, bytemuck::bytes_of_mut(&mut waiting_parts))?;
        if waiting_parts[0] > 0 {
            let problem =
                format!("{} parts are not done after as many steps as they have references", waiting_parts[0]);
            let kernel = Kernel::KmeansHalve.info().name;
            return Err(DeviceError::Kernel { kernel, problem, device: device.info().name.clone() });
        }
        Ok(())
    }
}
