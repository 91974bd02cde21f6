//! What every builder on the device starts from: boxes of the triangles, Morton codes, and the order by them.

use super::codes::{Codes, MortonBits, morton_params};
use super::sort::Sorter;
use super::{Input, Scratch, check_limits};
use crate::device::{Buffer, Device, DeviceError, DeviceKind, Recording, Timing};
use crate::scene::{SafeRange, is_finite};
use bytemuck::Zeroable;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::lbvh::{HierarchyParams, LeavesParams};
use prbvh_kernel::setup::{BOUNDS_CHUNK, BoundsParams, BoxesParams, Triangle};
use prbvh_kernel::sort::GatherParams;
use prbvh_kernel::{Kernel, grid};
use rayon::prelude::*;
use std::time::Instant;

const EVERYWHERE: Aabb = Aabb { min: [f32::NEG_INFINITY; 3], max: [f32::INFINITY; 3] };

/// Boxes that are worth a thread.
const AT_ONCE: usize = 1 << 12;

/// The references in Morton order. All but `boxes` is there when the recording has run.
#[derive(Debug)]
pub(super) struct MortonOrder {
    /// References, `n`.
    pub(super) references: u32,
    /// Around all references.
    pub(super) scene_box: Aabb,
    /// Boxes of the references, `[n]`.
    pub(super) boxes: Buffer,
    /// References by their codes, `[n]`.
    pub(super) order: Buffer,
    /// Upper words of the sorted codes, `[n]`.
    pub(super) high: Buffer,
    /// Lower words of the sorted codes, `[n]`; the same buffer as `high` if a code has one word.
    pub(super) low: Buffer,
    scratch: Scratch,
    codes: Scratch,
}

impl MortonOrder {
    /// Computes the boxes and records codes and sort. Triangles that are handed over are freed in between. Returns the times of what has run.
    ///
    /// The boxes of triangles of the host are made on their way to the device: they are two thirds of the bytes, and the box of the scene, on which the codes
    /// depend, is known without waiting for the device.
    ///
    /// # Errors
    /// If there are no triangles, they do not fit the device or are out of range, or the device fails.
    pub(super) fn record(
        recording: &mut Recording,
        device: &mut dyn Device,
        triangles: Input<'_>,
        plan: Codes,
    ) -> Result<(Self, Vec<Timing>), DeviceError> {
        let length = triangles.len()?;
        check_limits(device.info(), length)?;
        let references = u32::try_from(length).expect("checked against the limit of indices");
        let (mut scratch, mut codes) = (Scratch::default(), Scratch::default());
        let boxes = scratch.allocate(device, "boxes", length, size_of::<Aabb>())?;
        let (scene_box, timings) = match triangles {
            Input::Host(triangles) => upload_boxes(device, &triangles, &boxes)?,
            Input::Device(triangles) => setup(device, &triangles, references, &boxes)?,
        };
        SafeRange::check(&scene_box)?;
        let order = scratch.allocate(device, "order", length, 4)?;
        let (high, low) = record_codes(recording, &mut codes, device, references, (&boxes, &order), plan, scene_box)?;
        Ok((Self { references, scene_box, boxes, order, high, low, scratch, codes }, timings))
    }

    /// Records the leaves of a tree in this order.
    pub(super) fn record_leaves(&self, recording: &mut Recording, label: &'static str, nodes: &Buffer) {
        let params = LeavesParams { count: self.references };
        let buffers = [&self.order, &self.boxes, nodes];
        recording.dispatch(label, Kernel::LbvhLeaves, params.count, &params, &buffers);
    }

    /// Records the links of the radix tree of the codes.
    pub(super) fn record_hierarchy(&self, recording: &mut Recording, nodes: &Buffer) {
        let params = HierarchyParams { count: self.references - 1 };
        let buffers = [&self.high, &self.low, nodes];
        recording.dispatch("hierarchy", Kernel::LbvhHierarchy, params.count, &params, &buffers);
    }

    /// Gives the memory of the codes and their sort back.
    pub(super) fn free_codes(&mut self, device: &mut dyn Device) {
        std::mem::take(&mut self.codes).free(device);
    }

    /// Gives all memory back.
    pub(super) fn free(mut self, device: &mut dyn Device) {
        self.free_codes(device);
        self.scratch.free(device);
    }
}

/// Puts the boxes of triangles of the host on the device; returns the scene's.
fn upload_boxes(
    device: &mut dyn Device,
    triangles: &[Triangle],
    boxes: &Buffer,
) -> Result<(Aabb, Vec<Timing>), DeviceError> {
    let start = Instant::now();
    let mut scene_box = None;
    device.upload_with(boxes, size_of::<Aabb>() * triangles.len(), &mut |first, piece| {
        let piece: &mut [Aabb] = bytemuck::cast_slice_mut(piece);
        let from = &triangles[first / size_of::<Aabb>()..][..piece.len()];
        let write = |(to, triangle): (&mut Aabb, &Triangle)| {
            *to = triangle.aabb();
            // A box passes over a corner that is no number, depending on which: it is to be found out of range.
            if is_finite(triangle) { *to } else { EVERYWHERE }
        };
        // Of equal bounds the union takes the later: however it is cut, the bits are the same.
        let united =
            piece.par_iter_mut().zip(from).with_min_len(AT_ONCE).map(write).reduce(|| Aabb::EMPTY, Aabb::union);
        scene_box = Some(scene_box.unwrap_or(Aabb::EMPTY).union(united));
    })?;
    // A device that only counts wants no bytes.
    let scene_box = scene_box.unwrap_or_else(Aabb::zeroed);
    let timing = Timing { label: "setup", seconds: start.elapsed().as_secs_f64() };
    // What the host does beside a GPU is no time of the device.
    Ok((scene_box, Vec::from_iter((device.info().kind == DeviceKind::Cpu).then_some(timing))))
}

/// Boxes of triangles on the device, and the scene's.
fn setup(
    device: &mut dyn Device,
    triangles: &Buffer,
    mut count: u32,
    boxes: &Buffer,
) -> Result<(Aabb, Vec<Timing>), DeviceError> {
    let mut scratch = Scratch::default();
    let mut recording = Recording::new();
    recording.dispatch("setup", Kernel::SetupBoxes, count, &BoxesParams { count }, &[triangles, boxes]);
    let mut from = boxes.clone();
    while count > 1 {
        let groups = count.div_ceil(BOUNDS_CHUNK);
        let params = BoundsParams { count: grid::invocations(groups), boxes: count };
        count = groups;
        let united = scratch.allocate(device, "scene box", count as usize, size_of::<Aabb>())?;
        recording.dispatch("setup", Kernel::SetupBounds, params.count, &params, &[&from, &united]);
        from = united;
    }
    recording.fetch("setup", &from, size_of::<Aabb>());
    let timings = device.run(&recording)?;
    let mut scene_box = Aabb::EMPTY;
    device.download(&from, bytemuck::bytes_of_mut(&mut scene_box))?;
    scratch.free(device);
    Ok((scene_box, timings))
}

/// Records Morton codes and their sort, which turns `order` from the identity into the Morton order. Returns the sorted words of the
/// codes, upper first; the same buffer twice if a code has one word.
fn record_codes(
    recording: &mut Recording,
    scratch: &mut Scratch,
    device: &mut dyn Device,
    n: u32,
    (boxes, order): (&Buffer, &Buffer),
    plan: Codes,
    scene_box: Aabb,
) -> Result<(Buffer, Buffer), DeviceError> {
    let length = n as usize;
    let sorter = Sorter::new(scratch, device, n)?;
    let keys = scratch.allocate(device, "codes", length, 4)?;
    match plan.bits {
        MortonBits::Thirty => {
            let params = morton_params(n, scene_box, 10);
            recording.dispatch("morton", Kernel::Morton30, n, &params, &[boxes, &keys, order]);
            sorter.record(recording, &keys, order, plan.high);
            Ok((keys.clone(), keys))
        }
        MortonBits::Sixty => {
            let params = morton_params(n, scene_box, 20);
            let high = scratch.allocate(device, "upper codes", length, 4)?;
            let low = scratch.allocate(device, "lower codes", length, 4)?;
            recording.dispatch("morton", Kernel::Morton60, n, &params, &[boxes, &high, &low, order]);
            // The lower word first: the sort is stable, so that sorting by the upper word then keeps its order among equals.
            sorter.record_from(recording, &low, &keys, order, plan.low);
            let gather = GatherParams { count: n };
            recording.dispatch("sort", Kernel::SortGather, n, &gather, &[order, &high, &keys]);
            sorter.record(recording, &keys, order, plan.high);
            let sorted_low = sorter.spare_words().clone();
            recording.dispatch("sort", Kernel::SortGather, n, &gather, &[order, &low, &sorted_low]);
            Ok((keys, sorted_low))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::lbvh;
    use crate::device::cpu::CpuDevice;
    use crate::scene::built_in;

    #[test]
    fn a_corner_that_is_no_number_is_out_of_range_wherever_it_is() {
        let triangles = built_in(100).triangles;
        for (place, corner) in [(0, 0), (50, 1), (50, 2), (99, 2)] {
            for bad in [f32::NAN, f32::INFINITY] {
                let mut triangles = triangles.clone();
                let Triangle { a, b, c } = &mut triangles[place];
                [a, b, c][corner][1] = bad;
                let refused = lbvh(&mut CpuDevice::new(2).unwrap(), &triangles, MortonBits::default());
                assert!(matches!(refused, Err(DeviceError::Range(_))), "{place} {corner} {bad}");
            }
        }
    }
}
