//! The search of an iteration once more, on the host: what its walk added up, what the definition gives in f32, and in f64.

use super::area_decrease;
use prbvh_kernel::mem::AtomicU32;
use prbvh_kernel::node::{Links, NO_NODE, Node, ROOT};
use prbvh_kernel::prbvh::PrbvhParams;
use prbvh_kernel::prbvh::search::{best_output, checked_area_decrease};
use prbvh_kernel::status::REPORT_WORDS;
use rayon::prelude::*;

/// Where a walk would move a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// The node to become the sibling of.
    pub output: u32,
    /// The child of the pivot above the output, which may be the output itself.
    pub top: u32,
    /// Area decrease as the walk added it up, scene units².
    pub area_decrease: f32,
}

/// A walk over all outputs of an input node (not the root).
pub type Walk<'a> = &'a (dyn Fn(u32, &[Node]) -> Option<Candidate> + Sync);

/// The walk of the search kernel, run natively: the same bits as on a device.
#[must_use]
pub fn kernel_walk(input: u32, nodes: &[Node]) -> Option<Candidate> {
    let mut report = [0; REPORT_WORDS as usize];
    let report = AtomicU32::from_mut_slice(&mut report);
    let params = PrbvhParams::every(1, 0, nodes.len() as u32);
    let (output, top, area_decrease) = best_output(input, &params, nodes, report);
    (output != NO_NODE).then_some(Candidate { output, top, area_decrease })
}

/// A candidate, and its area decrease by three ways, scene units².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offer {
    /// The node to move.
    pub input: u32,
    /// The node to become the sibling of.
    pub output: u32,
    /// As the walk added it up.
    pub walked: f32,
    /// From its definition in f32; 0 where the search refuses the move: no more than rounding, or it might close a loop.
    pub direct: f32,
    /// In f64 without cancellation.
    pub exact: f64,
}

/// What a walk finds for the input nodes of an iteration, in their order. The links of `nodes` are a tree.
#[must_use]
pub fn offers(nodes: &[Node], params: &PrbvhParams, walk: Walk<'_>) -> Vec<Offer> {
    let offer = |i: u32| {
        let input = params.input(i);
        if input == ROOT || input as usize >= nodes.len() {
            return None;
        }
        let Candidate { output, top, area_decrease: walked } = walk(input, nodes)?;
        let direct = checked_area_decrease(input, output, nodes.parent(top), nodes);
        Some(Offer { input, output, walked, direct, exact: area_decrease(nodes, input, output) })
    };
    (0..params.count).into_par_iter().filter_map(offer).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use prbvh::build;
    use prbvh::scene::{SafeRange, built_in};
    use prbvh_kernel::mem::Slot;
    use prbvh_kernel::node::WideNode;
    use prbvh_kernel::prbvh::worst::books::BOOKS_WORDS;
    use prbvh_kernel::prbvh::{Move, search::search};

    #[test]
    fn offers_are_what_the_search_kernel_finds() {
        let scene = built_in(400);
        let nodes = build::sah_binned(&SafeRange::of(&scene.triangles).apply(&scene.triangles));
        for (mu, first) in [(1, 0), (7, 3)] {
            let params = PrbvhParams::every(mu, first, nodes.len() as u32);
            let offers = offers(&nodes, &params, &kernel_walk);
            let mut found = vec![Move::NONE; params.count as usize];
            let mut report = [0; REPORT_WORDS as usize];
            let report = AtomicU32::from_mut_slice(&mut report);
            let mut books = [0; BOOKS_WORDS as usize];
            let books = AtomicU32::from_mut_slice(&mut books);
            let wide: Vec<WideNode> = bytemuck::pod_collect_to_vec(&nodes);
            let found_slots = Slot::from_mut_slice(&mut found);
            for i in 0..params.count {
                search(i, &params, &wide, found_slots, books, report);
            }
            let expected = (0..).zip(&found).filter(|(_, found)| found.output != NO_NODE);
            let taken = offers.iter().filter(|offer| offer.direct > 0.0);
            let taken: Vec<_> = taken.map(|offer| (offer.input, offer.output, offer.direct)).collect();
            let expected: Vec<_> = expected.map(|(i, one)| (params.input(i), one.output, one.area_decrease)).collect();
            assert_eq!(taken, expected, "µ {mu}");
            assert!(taken.len() > 10, "µ {mu}: {} offers", taken.len());
        }
    }

    /// A walk that is off is seen as it is.
    #[test]
    fn another_walk_is_told_by_its_sum() {
        let scene = built_in(400);
        let nodes = build::sah_binned(&SafeRange::of(&scene.triangles).apply(&scene.triangles));
        let params = PrbvhParams::every(1, 0, nodes.len() as u32);
        let planted = |input: u32, nodes: &[Node]| {
            kernel_walk(input, nodes).map(|found| Candidate { area_decrease: 2.0 * found.area_decrease, ..found })
        };
        let (right, wrong) = (offers(&nodes, &params, &kernel_walk), offers(&nodes, &params, &planted));
        assert_eq!(right.len(), wrong.len());
        for (right, wrong) in right.iter().zip(&wrong) {
            assert_eq!(Offer { walked: 2.0 * right.walked, ..*right }, *wrong);
        }
    }
}
