//! The Morton order on the host, and the LBVH that it is.

use super::codes::{codes, morton_params};
use super::top_down::{Part, top_down};
use crate::stop::Stop;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;

/// A code of 60 bits and the reference that has it.
pub(super) type Coded = (u64, u32);

/// The references by their codes, equal ones by their number. The codes are those of the device.
pub(super) fn morton_order(triangles: &[Triangle]) -> Vec<Coded> {
    let scene_box = triangles.par_iter().map(Triangle::aabb).reduce(|| Aabb::EMPTY, Aabb::union);
    let params = morton_params(triangles.len() as u32, scene_box, 20);
    let words = codes(triangles, &params);
    let coded = |(k, [high, low]): (usize, [u32; 2])| (u64::from(high) << 30 | u64::from(low), k as u32);
    let mut order: Vec<Coded> = words.into_par_iter().enumerate().map(coded).collect();
    order.par_sort_unstable();
    order
}

/// At least one reference in Morton order, and their place in the whole order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range<'a> {
    pub(super) sorted: &'a [Coded],
    pub(super) start: usize,
}

impl<'a> Range<'a> {
    /// At least two references in two ranges: where the highest bit in which codes differ changes; of equal codes, where that of places does.
    pub(super) fn halves(self) -> [Self; 2] {
        let Self { sorted, start } = self;
        let last = sorted.len() - 1;
        let differing = sorted[0].0 ^ sorted[last].0;
        let middle = if differing == 0 {
            let top = (start ^ (start + last)).ilog2();
            ((start + last) >> top << top) - start
        } else {
            sorted.partition_point(|(code, _)| code >> differing.ilog2() & 1 == 0)
        };
        let (left, right): (&'a [Coded], &'a [Coded]) = sorted.split_at(middle);
        [Self { sorted: left, start }, Self { sorted: right, start: start + middle }]
    }
}

impl Part for Range<'_> {
    fn len(&self) -> usize {
        self.sorted.len()
    }

    fn first(&self) -> u32 {
        self.sorted[0].1
    }

    fn split(self) -> (Self, Self) {
        self.halves().into()
    }
}

/// `nodes[2n-1]` of the LBVH over at least one triangle in the safe range, numbered depth-first; none if an end was asked for.
pub(super) fn lbvh_on_host(triangles: &[Triangle], stop: Option<&Stop>) -> Option<Vec<Node>> {
    top_down(Range { sorted: &morton_order(triangles), start: 0 }, triangles, stop)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::{MortonBits, lbvh};
    use crate::bvh::{Bvh, tree_hash};
    use crate::device::cpu::CpuDevice;
    use crate::scene::{SafeRange, built_in};

    #[test]
    fn it_is_the_lbvh_of_the_device() {
        let mut scenes = vec![built_in(2000).triangles];
        scenes.push(scenes[0][..1].to_vec());
        scenes.push(scenes[0][..2].to_vec());
        // Equal codes by the dozen.
        scenes.push(scenes[0][..40].iter().flat_map(|triangle| [*triangle; 25]).collect());
        let mut device = CpuDevice::new(1).unwrap();
        for triangles in scenes {
            let working = SafeRange::of(&triangles).apply(&triangles);
            let hash = |nodes: &[Node]| tree_hash(&Bvh::from_device(nodes).unwrap());
            let (tree, _) = lbvh(&mut device, &working, MortonBits::Sixty).unwrap();
            let expected = hash(&tree.download(&mut device).unwrap());
            assert_eq!(hash(&lbvh_on_host(&working, None).unwrap()), expected, "{}", triangles.len());
            tree.free(&mut device);
        }
    }
}
