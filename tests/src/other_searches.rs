//! Searches that the product has no switch for, on the host, and a device that takes one of them for its own: what the optimiser would be
//! with it.

use crate::planted::{Planted, change};
use prbvh::device::{Device, DeviceError, Dispatch};
use prbvh_kernel::Kernel;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::mem::AtomicU32;
use prbvh_kernel::node::{Links, NO_NODE, Node, ROOT};
use prbvh_kernel::prbvh::search::checked_area_decrease;
use prbvh_kernel::prbvh::worst::books::{BOOKS_WORDS, OVER_LIST};
use prbvh_kernel::prbvh::{Move, PrbvhParams};
use prbvh_lab::accuracy::Candidate;
use rayon::prelude::*;

/// A device with another search: for every input node, a reinsertion as it is to be locked.
pub fn with_search(
    device: Box<dyn Device>,
    search: impl Fn(u32, &[Node]) -> Move + Sync,
) -> Planted<impl FnMut(&Dispatch, &mut dyn Device) -> Result<(), DeviceError>> {
    Planted::new(device, move |dispatch, device| {
        if dispatch.kernel != Kernel::PrbvhSearch {
            return Ok(());
        }
        let params: PrbvhParams = bytemuck::pod_read_unaligned(&dispatch.push);
        let mut nodes: Vec<Node> = vec![bytemuck::Zeroable::zeroed(); params.nodes as usize];
        device.download(&dispatch.buffers[0], bytemuck::cast_slice_mut(&mut nodes))?;
        let mut books = [0u32; BOOKS_WORDS as usize];
        device.download(&dispatch.buffers[2], bytemuck::cast_slice_mut(&mut books))?;
        let count = if params.mu > 0 { params.count } else { books[OVER_LIST] } as usize;
        let books = AtomicU32::from_mut_slice(&mut books);
        change(device, &dispatch.buffers[1], |found: &mut [Move]| {
            let params = params.by(books);
            let found = &mut found[..count];
            found.par_iter_mut().enumerate().for_each(|(i, found)| *found = search(params.input(i as u32), &nodes));
        })
    })
}

/// The output with the largest area decrease that float32 calls positive, of all there are: a search without the relative threshold.
#[must_use]
pub fn without_threshold(input: u32, nodes: &[Node]) -> Move {
    let mut best = Move::NONE;
    if input == ROOT {
        return best;
    }
    let above = Above::of(input, nodes);
    for output in 1..nodes.len() as u32 {
        if output == input || output == nodes.sibling(input) || above.has(output) {
            continue;
        }
        let area_decrease = area_decrease(input, output, &above, nodes);
        if area_decrease > best.area_decrease {
            best = Move { area_decrease, input, output, other: above.top_over(output, nodes) };
        }
    }
    best
}

/// The nodes above a node.
struct Above {
    /// From the parent to the root.
    path: Vec<u32>,
    is_above: Vec<bool>,
}

impl Above {
    fn of(v: u32, nodes: &[Node]) -> Self {
        let path: Vec<u32> =
            std::iter::successors(Some(v), |&v| (v != ROOT).then(|| nodes.parent(v))).skip(1).collect();
        let mut is_above = vec![false; nodes.len()];
        path.iter().for_each(|&v| is_above[v as usize] = true);
        Self { path, is_above }
    }

    fn has(&self, v: u32) -> bool {
        self.is_above[v as usize]
    }

    /// The child of the pivot above an output, or the output itself.
    fn top_over(&self, output: u32, nodes: &[Node]) -> u32 {
        let mut top = output;
        while !self.has(nodes.parent(top)) {
            top = nodes.parent(top);
        }
        top
    }
}

/// The sum of `prbvh_kernel::prbvh` in float32; 0 where the output lies below the input or the move might close a loop.
fn area_decrease(input: u32, output: u32, above: &Above, nodes: &[Node]) -> f32 {
    let aabb = |v: u32| nodes[v as usize].aabb();
    let (input_box, sibling) = (aabb(input), nodes.sibling(input));
    if !is_loop_free(input, output, above, nodes) {
        return 0.0;
    }
    let mut increase = 0.0;
    let mut pivot = nodes.parent(output);
    while !above.has(pivot) {
        increase += aabb(pivot).union(input_box).half_area() - aabb(pivot).half_area();
        pivot = nodes.parent(pivot);
    }
    let mut decrease = 0.0;
    let mut without = aabb(sibling);
    for pair in above.path.windows(2).take_while(|pair| pair[0] != pivot && pair[1] != pivot) {
        without = without.union(aabb(nodes.sibling(pair[0])));
        decrease += aabb(pair[1]).half_area() - without.half_area();
    }
    aabb(above.path[0]).half_area() - aabb(output).union(input_box).half_area() + (decrease - increase)
}

/// Whether every node on the way down to the output, the sibling excepted, has a larger area than the input: see `prbvh_kernel::prbvh`.
/// Below the input there is none.
fn is_loop_free(input: u32, output: u32, above: &Above, nodes: &[Node]) -> bool {
    let area = |v: u32| nodes[v as usize].aabb().half_area();
    let (sibling, mut v) = (nodes.sibling(input), nodes.parent(output));
    while !above.has(v) {
        if v == input || v != sibling && area(v) <= area(input) {
            return false;
        }
        v = nodes.parent(v);
    }
    true
}

/// What [`published_walk`] finds, for what its sum says.
#[must_use]
pub fn published(input: u32, nodes: &[Node]) -> Move {
    if input == ROOT {
        return Move::NONE;
    }
    match published_walk(input, nodes) {
        Some(Candidate { output, top, area_decrease })
            if is_loop_free(input, output, &Above::of(input, nodes), nodes) =>
        {
            Move { area_decrease, input, output, other: top }
        }
        _ => Move::NONE,
    }
}

/// What [`published_walk`] finds, if the decrease from its definition exceeds the threshold, and for that.
#[must_use]
pub fn published_and_recomputed(input: u32, nodes: &[Node]) -> Move {
    if input == ROOT {
        return Move::NONE;
    }
    let Some(Candidate { output, top, .. }) = published_walk(input, nodes) else { return Move::NONE };
    let area_decrease = checked_area_decrease(input, output, nodes.parent(top), nodes);
    if area_decrease > 0.0 { Move { area_decrease, input, output, other: top } } else { Move::NONE }
}

/// The walk of Meister & Bittner 2018, algorithm 1, with its one running sum: what a step down adds, the step up subtracts again,
/// all the way from the input's parent to the root.
#[must_use]
pub fn published_walk(input: u32, nodes: &[Node]) -> Option<Candidate> {
    let internal = nodes.len() as u32 / 2;
    let aabb = |v: u32| nodes[v as usize].aabb();
    let input_box = aabb(input);
    let (parent, sibling) = (nodes.parent(input), nodes.sibling(input));
    let parent_area = aabb(parent).half_area();
    let bound = parent_area - input_box.half_area();
    let mut best = Candidate { output: NO_NODE, top: NO_NODE, area_decrease: 0.0 };
    let mut d = 0.0f32;
    let mut pivot = parent;
    let mut top = sibling;
    let mut pivot_box: Aabb = aabb(sibling);
    loop {
        let (mut v, mut is_down) = (top, true);
        loop {
            let area = aabb(v).union(input_box).half_area();
            let change = aabb(v).half_area() - area;
            if is_down {
                let decrease = d + (parent_area - area);
                if v != sibling && decrease > best.area_decrease {
                    best = Candidate { output: v, top, area_decrease: decrease };
                }
                d += change;
                if v < internal && d + bound > best.area_decrease {
                    v = nodes.down(v);
                    continue;
                }
            }
            d -= change;
            if v == top {
                break;
            }
            is_down = nodes[v as usize].is_left();
            v = if is_down { nodes.sibling(v) } else { nodes.parent(v) };
        }
        if pivot == ROOT {
            return (best.output != NO_NODE).then_some(best);
        }
        if pivot != parent {
            d += aabb(pivot).half_area() - pivot_box.half_area();
        }
        top = nodes.sibling(pivot);
        pivot = nodes.parent(pivot);
        pivot_box = pivot_box.union(aabb(top));
    }
}
