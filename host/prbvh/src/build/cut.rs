//! Sweeps over a cut of an auxiliary LBVH, from the top down: Hunt, Mark & Fussell 2007 (*Fast and Lazy Build of Acceleration Structures from Scene
//! Hierarchies*) with a cut of constant size, and progressive hierarchical refinement (PHR: Hendrich, Meister & Bittner 2017, *Parallel BVH Construction
//! Using Progressive Hierarchical Refinement*) with one that follows the areas.
//!
//! A cut is a set of nodes of the auxiliary tree that holds each reference of a part once. Before a split some of its nodes are opened, the largest first;
//! then it is split like so many boxes. Where a part is smaller than a cut it is the sweep over its triangles. Spatial splits, which the second paper
//! also makes, would put a triangle into several leaves and are left out.

use super::morton::lbvh_on_host;
use super::top_down::{Part, Split, in_range, top_down};
use crate::check::{SettingError, must};
use crate::parameters::parameters;
use crate::stop::Stop;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use std::collections::BinaryHeap;

/// Settings of [`hunt`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default))]
#[non_exhaustive]
pub struct HuntSettings {
    /// Nodes of a cut: 2 to 65,536.
    pub cut: u32,
}

impl HuntSettings {
    /// Whether every value makes sense.
    ///
    /// # Errors
    /// If the cut is too small or too large.
    pub fn check(&self) -> Result<(), SettingError> {
        must("hunt.cut", self.cut, (2..=1 << 16).contains(&self.cut), "2 to 65536")
    }
}

impl Default for HuntSettings {
    /// The larger one of those that Hendrich, Meister & Bittner 2017 compare with.
    fn default() -> Self {
        Self { cut: 500 }
    }
}

parameters!(HuntSettings, known "cut=N", presets { "" => Self::default() }, cut);

/// Settings of [`phr`]. A node is opened while its area is above `S/2^(α·d+δ)`, where S is the area of the scene's box and d the depth of the part.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default))]
#[non_exhaustive]
pub struct PhrSettings {
    /// How much smaller the nodes of a cut are per level, α: 0 to 8.
    pub alpha: f64,
    /// How small they are at the root, δ: 0 to 64.
    pub delta: f64,
}

impl PhrSettings {
    /// As published: fast.
    pub const FAST: Self = Self { alpha: 0.5, delta: 6.0 };
    /// As published: high quality.
    pub const HQ: Self = Self { alpha: 0.55, delta: 9.0 };
    /// Most nodes of a cut, as published.
    pub const MOST: usize = 2048;

    /// Whether every value makes sense.
    ///
    /// # Errors
    /// The first that makes none.
    pub fn check(&self) -> Result<(), SettingError> {
        must("phr.alpha", self.alpha, (0.0..=8.0).contains(&self.alpha), "0 to 8")?;
        must("phr.delta", self.delta, (0.0..=64.0).contains(&self.delta), "0 to 64")
    }
}

impl Default for PhrSettings {
    fn default() -> Self {
        Self::HQ
    }
}

parameters!(
    PhrSettings,
    known "fast, hq, alpha=A, delta=D",
    presets { "fast" => Self::FAST, "hq" => Self::HQ },
    alpha, delta
);

/// Builds a tree of one triangle per leaf on the CPU by sweeps over cuts of a constant size, with all threads of the current rayon pool; the tree does not depend
/// on their number. Returns `nodes[2n-1]` for [`DeviceTree::upload`](super::DeviceTree::upload), numbered depth-first. `triangles` are finite and of any size.
///
/// A split is weighted by triangles. Of equally good splits the one closest to the middle is taken, then the first axis.
/// Of no triangles there is no tree, and no nodes.
///
/// # Errors
/// If a setting makes no sense.
pub fn hunt(triangles: &[Triangle], settings: &HuntSettings) -> Result<Vec<Node>, SettingError> {
    settings.check()?;
    Ok(hunt_until(triangles, settings, None).unwrap_or_default())
}

/// [`hunt`] with settings that make sense; none of no triangles, or if an end was asked for.
pub(crate) fn hunt_until(triangles: &[Triangle], settings: &HuntSettings, stop: Option<&Stop>) -> Option<Vec<Node>> {
    build(triangles, Rule::Constant(settings.cut as usize), stop)
}

/// As [`hunt`], with cuts that follow the areas. A split is weighted by nodes of the cut, which the authors found better than triangles.
///
/// # Errors
/// If a setting makes no sense.
pub fn phr(triangles: &[Triangle], settings: &PhrSettings) -> Result<Vec<Node>, SettingError> {
    settings.check()?;
    Ok(phr_until(triangles, settings, None).unwrap_or_default())
}

/// [`phr`] with settings that make sense; none of no triangles, or if an end was asked for.
pub(crate) fn phr_until(triangles: &[Triangle], settings: &PhrSettings, stop: Option<&Stop>) -> Option<Vec<Node>> {
    build(triangles, Rule::Areas(*settings), stop)
}

fn build(triangles: &[Triangle], rule: Rule, stop: Option<&Stop>) -> Option<Vec<Node>> {
    if triangles.is_empty() {
        return None;
    }
    let auxiliary = Auxiliary::new(lbvh_on_host(&in_range(triangles), stop)?);
    let root = Cut { auxiliary: &auxiliary, nodes: vec![0], references: triangles.len(), depth: 0, rule };
    top_down(root, triangles, stop)
}

/// When nodes are opened.
#[derive(Clone, Copy, Debug)]
enum Rule {
    /// Until there are so many.
    Constant(usize),
    /// Until they are small enough for their depth.
    Areas(PhrSettings),
}

/// The tree that cuts go through.
struct Auxiliary {
    /// Numbered depth-first.
    nodes: Vec<Node>,
    /// References below each node.
    counts: Vec<u32>,
}

impl Auxiliary {
    fn new(nodes: Vec<Node>) -> Self {
        let internal = nodes.len() / 2;
        let mut counts = vec![1; nodes.len()];
        for v in (0..internal).rev() {
            let left = nodes[v].down as usize;
            counts[v] = counts[left] + counts[nodes[left].up as usize];
        }
        Self { nodes, counts }
    }

    fn children(&self, v: u32) -> Option<[u32; 2]> {
        let is_internal = (v as usize) < self.nodes.len() / 2;
        is_internal.then(|| {
            let left = self.nodes[v as usize].down;
            [left, self.nodes[left as usize].up]
        })
    }

    fn aabb(&self, v: u32) -> Aabb {
        self.nodes[v as usize].aabb()
    }
}

/// A part as a cut.
struct Cut<'a> {
    auxiliary: &'a Auxiliary,
    nodes: Vec<u32>,
    /// References below the nodes.
    references: usize,
    depth: u32,
    rule: Rule,
}

impl Cut<'_> {
    /// Opens nodes: the largest first, of equal ones that with more references, then that with the smaller number.
    fn refine(&mut self) {
        let (most, above) = match self.rule {
            Rule::Constant(most) => (most, f64::NEG_INFINITY),
            Rule::Areas(PhrSettings { alpha, delta }) => {
                let scene = f64::from(self.auxiliary.aabb(0).half_area());
                (PhrSettings::MOST, scene * libm::exp2(-(alpha * f64::from(self.depth) + delta)))
            }
        };
        let auxiliary = self.auxiliary;
        let mut large = BinaryHeap::new();
        let mut kept = Vec::with_capacity(self.nodes.len());
        let sort = |v: u32, large: &mut BinaryHeap<(u32, u32, u32)>, kept: &mut Vec<u32>| {
            let area = auxiliary.aabb(v).half_area();
            if auxiliary.children(v).is_some() && f64::from(area) > above {
                // No area is negative, and floats of one sign order like their bits.
                large.push((area.abs().to_bits(), auxiliary.counts[v as usize], !v));
            } else {
                kept.push(v);
            }
        };
        self.nodes.drain(..).for_each(|v| sort(v, &mut large, &mut kept));
        while kept.len() + large.len() < most
            && let Some((_, _, v)) = large.pop()
        {
            auxiliary.children(!v).into_iter().flatten().for_each(|child| sort(child, &mut large, &mut kept));
        }
        kept.extend(large.into_iter().map(|(_, _, v)| !v));
        if let [only] = kept[..]
            && let Some(children) = auxiliary.children(only)
        {
            kept = children.to_vec();
        }
        self.nodes = kept;
    }

    fn weight(&self, v: u32) -> usize {
        match self.rule {
            Rule::Constant(_) => self.auxiliary.counts[v as usize] as usize,
            Rule::Areas(_) => 1,
        }
    }

    /// The nodes by their centres; of equal ones, leaves by their references.
    fn sorted(&self, axis: usize) -> Vec<u32> {
        let key = |&v: &u32| {
            let Node { min, max, down, .. } = self.auxiliary.nodes[v as usize];
            (min[axis] + max[axis], (down, v))
        };
        let mut keys: Vec<(f32, (u32, u32))> = self.nodes.iter().map(key).collect();
        keys.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        keys.into_iter().map(|(_, (_, v))| v).collect()
    }

    /// The best split of the nodes in this order, and its place.
    fn best_split(&self, order: &[u32], weight: usize) -> (Split, usize) {
        let mut areas = vec![0.0; order.len()];
        let mut aabb = Aabb::EMPTY;
        for k in (1..order.len()).rev() {
            aabb = aabb.union(self.auxiliary.aabb(order[k]));
            areas[k] = aabb.half_area();
        }
        let mut best = (Split::worst(weight), order.len() / 2);
        let (mut aabb, mut left) = (Aabb::EMPTY, 0);
        for k in 1..order.len() {
            aabb = aabb.union(self.auxiliary.aabb(order[k - 1]));
            left += self.weight(order[k - 1]);
            let split = Split::new(aabb.half_area(), areas[k], left, weight);
            if split.beats(&best.0, weight) {
                best = (split, k);
            }
        }
        best
    }

    fn side(&self, nodes: Vec<u32>) -> Self {
        let references = nodes.iter().map(|&v| self.auxiliary.counts[v as usize] as usize).sum();
        Self { nodes, references, depth: self.depth + 1, ..*self }
    }
}

impl Part for Cut<'_> {
    fn len(&self) -> usize {
        self.references
    }

    fn first(&self) -> u32 {
        self.auxiliary.nodes[self.nodes[0] as usize].down
    }

    fn split(mut self) -> (Self, Self) {
        self.refine();
        let weight = self.nodes.iter().map(|&v| self.weight(v)).sum();
        let mut order = self.sorted(0);
        let mut best = self.best_split(&order, weight);
        for axis in 1..3 {
            let other = self.sorted(axis);
            let split = self.best_split(&other, weight);
            if split.0.beats(&best.0, weight) {
                (order, best) = (other, split);
            }
        }
        let right = order.split_off(best.1);
        (self.side(order), self.side(right))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::sah_sweep;
    use crate::bvh::{Bvh, tree_hash};
    use crate::scene::{SafeRange, built_in};

    fn hash(nodes: &[Node]) -> String {
        tree_hash(&Bvh::from_device(nodes).unwrap())
    }

    #[test]
    fn a_cut_of_all_triangles_is_the_sweep_and_a_cut_of_two_the_lbvh() {
        let scene = built_in(900);
        let triangles = SafeRange::of(&scene.triangles).apply(&scene.triangles);
        for n in [1, 2, 3, 50, 900] {
            let triangles = &triangles[..n];
            let hunt = |cut| hash(&hunt(triangles, &HuntSettings { cut }).unwrap());
            assert_eq!(hunt(1000), hash(&sah_sweep(triangles)), "{n}");
            let fine = PhrSettings { alpha: 0.0, delta: 64.0 };
            assert_eq!(hash(&phr(triangles, &fine).unwrap()), hash(&sah_sweep(triangles)), "{n}");
            let coarse = PhrSettings { alpha: 0.0, delta: 0.0 };
            let sides = |nodes: &[Node]| {
                let tree = Bvh::from_device(nodes).unwrap();
                let mut areas: Vec<u32> = tree.nodes.iter().map(|node| node.aabb.half_area().to_bits()).collect();
                areas.sort_unstable();
                areas
            };
            // Which child is the left one is a matter of the sweep.
            let lbvh = sides(&lbvh_on_host(triangles, None).unwrap());
            assert_eq!(sides(&super::hunt(triangles, &HuntSettings { cut: 2 }).unwrap()), lbvh, "{n}");
            assert_eq!(sides(&phr(triangles, &coarse).unwrap()), lbvh, "{n}");
        }
    }

    #[test]
    fn a_cut_keeps_to_its_rule() {
        let scene = built_in(3000);
        let auxiliary = Auxiliary::new(lbvh_on_host(&scene.triangles, None).unwrap());
        let refined = |rule, depth| {
            let mut cut = Cut { auxiliary: &auxiliary, nodes: vec![0], references: 3000, depth, rule };
            cut.refine();
            let held: u32 = cut.nodes.iter().map(|&v| auxiliary.counts[v as usize]).sum();
            assert_eq!(held, 3000);
            cut
        };
        assert_eq!(refined(Rule::Constant(77), 0).nodes.len(), 77);
        for depth in [0, 3] {
            let cut = refined(Rule::Areas(PhrSettings::FAST), depth);
            let most = auxiliary.aabb(0).half_area() / 2f32.powf(0.5 * depth as f32 + 6.0);
            let is_small =
                |&v: &u32| auxiliary.children(v).is_none() || auxiliary.aabb(v).half_area() <= most * 1.000_1;
            assert!(cut.nodes.iter().all(is_small) && cut.nodes.len() > 20, "{} nodes", cut.nodes.len());
        }
        assert_eq!(refined(Rule::Areas(PhrSettings { alpha: 0.0, delta: 60.0 }), 0).nodes.len(), PhrSettings::MOST);
    }
}
