//! The kernels of presplitting, in turn.

use super::census::params;
use super::scale::{Interval, Scales, shares, totals};
use super::{PresplitForm, PresplitSettings};
use crate::build::{Scratch, check_limits};
use crate::device::{Buffer, Device, DeviceError, Lease, Recording, Timing, on_host};
use crate::references::Pieces;
use crate::rounded::{at_least, at_most};
use crate::scene::SafeRange;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::presplit::pieces::{NO_PIECE, PiecesParams};
use prbvh_kernel::presplit::places::{ChunkShare, PlacesParams, SumsParams};
use prbvh_kernel::presplit::priority::PrioritiesParams;
use prbvh_kernel::presplit::{CHUNK, SCALES};
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::{Kernel, grid};
use rayon::prelude::*;

/// Label of all its commands.
const LABEL: &str = "presplit";

/// References of `triangles`, at most as many more as the settings say, with boxes in the coordinates of the triangles, in their order. None where no triangle is split.
pub(crate) fn presplit(
    device: &mut dyn Device,
    triangles: &[Triangle],
    settings: &PresplitSettings,
) -> Result<(Option<Pieces>, Vec<Timing>), DeviceError> {
    let range = SafeRange::of(triangles);
    let working = on_host(device, || range.apply(triangles));
    let scene = on_host(device, || working.par_iter().map(Triangle::aabb).reduce(|| Aabb::EMPTY, Aabb::union));
    let budget = settings.most_splits(triangles.len());
    check_limits(device.info(), triangles.len() + budget)?;
    let params = params(triangles.len(), &scene, settings.form);
    let device = &mut Lease::new(device);
    let mut stage = Stage::new(device, triangles.len())?;
    let result = stage.run(device, &working, (&params, budget as u64));
    stage.scratch.free(device);
    let Some((boxes, owners)) = result? else { return Ok((None, stage.timings)) };
    let to_scene = |(piece, &owner): (&Aabb, &u32)| {
        let owner = owner as usize;
        unscaled(piece, &working[owner].aabb(), &triangles[owner].aabb(), range.exponent)
    };
    let pieces = on_host(device, || {
        let is_piece = |(_, owner): &(&Aabb, &u32)| **owner != NO_PIECE;
        let boxes = boxes.par_iter().zip(&owners).filter(is_piece).map(to_scene).collect();
        Pieces { boxes, primitives: owners.par_iter().copied().filter(|&owner| owner != NO_PIECE).collect() }
    });
    let is_split = pieces.boxes.len() > triangles.len();
    Ok((is_split.then_some(pieces), stage.timings))
}

/// Allocates what so many triangles and pieces take, and gives it back: for plans. The passes are those that a search for the scale takes at most.
pub(crate) fn reserve(device: &mut dyn Device, triangles: usize, pieces: usize) -> Result<(), DeviceError> {
    let stage = Stage::new(device, triangles)?;
    let mut scratch = Scratch::default();
    Stage::room(&mut scratch, device, pieces)?;
    scratch.free(device);
    stage.scratch.free(device);
    Ok(())
}

/// Whether the settings run kernels.
pub(crate) fn is_on_device(settings: &PresplitSettings) -> bool {
    settings.form != PresplitForm::Sbvh
}

/// Boxes of the pieces and their triangles, in the working coordinates.
type Made = (Vec<Aabb>, Vec<u32>);

struct Stage {
    count: u32,
    chunks: u32,
    triangles: Buffer,
    priorities: Buffer,
    scales: Buffer,
    sums: Buffer,
    shares: Buffer,
    splits: Buffer,
    places: Buffer,
    scratch: Scratch,
    timings: Vec<Timing>,
}

impl Stage {
    fn new(device: &mut dyn Device, triangles: usize) -> Result<Self, DeviceError> {
        let count = u32::try_from(triangles).expect("checked against the limit of indices");
        let chunks = count.div_ceil(CHUNK);
        let mut scratch = Scratch::default();
        let mut buffer = |label, length, bytes| scratch.allocate(device, label, length, bytes);
        Ok(Self {
            count,
            chunks,
            triangles: buffer("triangles", triangles, size_of::<Triangle>())?,
            priorities: buffer("priorities", triangles, 4)?,
            scales: buffer("scales", SCALES as usize, 4)?,
            sums: buffer("sums", (chunks * SCALES) as usize, 4)?,
            shares: buffer("shares", chunks as usize, size_of::<ChunkShare>())?,
            splits: buffer("splits", triangles, 4)?,
            places: buffer("places", triangles, 4)?,
            scratch,
            timings: Vec::new(),
        })
    }

    /// Boxes and owners of so many pieces.
    fn room(scratch: &mut Scratch, device: &mut dyn Device, pieces: usize) -> Result<[Buffer; 2], DeviceError> {
        Ok([
            scratch.allocate(device, "piece boxes", pieces, size_of::<Aabb>())?,
            scratch.allocate(device, "owners", pieces, 4)?,
        ])
    }

    fn run(
        &mut self,
        device: &mut dyn Device,
        working: &[Triangle],
        (params, budget): (&PrioritiesParams, u64),
    ) -> Result<Option<Made>, DeviceError> {
        device.upload(&self.triangles, bytemuck::cast_slice(working))?;
        let mut recording = Recording::new();
        let buffers = [&self.triangles, &self.priorities];
        recording.dispatch(LABEL, Kernel::PresplitPriorities, self.count, params, &buffers);
        let mut interval = Interval::whole();
        let [_, most] = interval.ends();
        if totals(&self.sums(device, recording, [most; SCALES as usize])?)[0] == 0 {
            return Ok(None);
        }
        while !interval.is_found() {
            interval = interval.narrowed(totals(&self.sums(device, Recording::new(), interval.scales())?), budget);
        }
        let ends = interval.ends();
        let sums = self.sums(device, Recording::new(), std::array::from_fn(|k| ends[k.min(1)]))?;
        let lengths = (0..self.chunks).map(|chunk| CHUNK.min(self.count - chunk * CHUNK));
        let (shares, pieces) = shares(&sums, lengths, budget);
        device.upload(&self.shares, bytemuck::cast_slice(&shares))?;

        let pieces = usize::try_from(pieces).expect("checked against the limit of indices");
        let [boxes, owners] = Self::room(&mut self.scratch, device, pieces)?;
        let mut recording = Recording::new();
        let count = grid::invocations(self.chunks);
        let places = PlacesParams { count, triangles: self.count, scale: ends[0], next_scale: ends[1] };
        let buffers = [&self.priorities, &self.shares, &self.splits, &self.places];
        recording.dispatch(LABEL, Kernel::PresplitPlaces, count, &places, &buffers);
        let cut = PiecesParams { count: self.count, grid: params.grid };
        let buffers = [&self.triangles, &self.splits, &self.places, &boxes, &owners];
        recording.dispatch(LABEL, Kernel::PresplitPieces, self.count, &cut, &buffers);
        self.timings.extend(device.run(&recording)?);
        let mut made = (vec![Aabb::EMPTY; pieces], vec![0u32; pieces]);
        device.download(&boxes, bytemuck::cast_slice_mut(&mut made.0))?;
        device.download(&owners, bytemuck::cast_slice_mut(&mut made.1))?;
        Ok(Some(made))
    }

    /// Splits of each chunk by each of the scales, after what was recorded.
    fn sums(
        &mut self,
        device: &mut dyn Device,
        mut recording: Recording,
        scales: Scales,
    ) -> Result<Vec<u32>, DeviceError> {
        device.upload(&self.scales, bytemuck::cast_slice(&scales))?;
        let count = grid::invocations(self.chunks);
        let params = SumsParams { count, triangles: self.count };
        let buffers = [&self.priorities, &self.scales, &self.sums];
        recording.dispatch(LABEL, Kernel::PresplitSums, count, &params, &buffers);
        recording.fetch(LABEL, &self.sums, self.sums.bytes() as usize);
        self.timings.extend(device.run(&recording)?);
        let mut sums = vec![0u32; self.sums.length];
        device.download(&self.sums, bytemuck::cast_slice_mut(&mut sums))?;
        Ok(sums)
    }
}

/// A piece in the coordinates of the scene: no smaller, and with the faces that it shares with its triangle's box where that has them. `working` and `original` are that box in both
/// coordinates.
fn unscaled(piece: &Aabb, working: &Aabb, original: &Aabb, exponent: i32) -> Aabb {
    let to_scene = |x: f32| f64::from(x) * 2f64.powi(-exponent);
    let mut made = *original;
    for k in 0..3 {
        if piece.min[k] > working.min[k] {
            made.min[k] = at_most(to_scene(piece.min[k])).clamp(original.min[k], original.max[k]);
        }
        if piece.max[k] < working.max[k] {
            made.max[k] = at_least(to_scene(piece.max[k])).clamp(original.min[k], original.max[k]);
        }
    }
    made
}
