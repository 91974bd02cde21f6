//! Agglomerative clustering: exact (Walter, Bala, Kulkarni & Pingali 2008) and approximate (AAC: Gu, He, Fatahalian & Blelloch 2013, *Efficient BVH
//! Construction via Approximate Agglomerative Clustering*).
//!
//! AAC halves the references in Morton order, again and again. Going up from fewer than δ references, the clusters of both halves are made one list,
//! which is agglomerated until `f(n)` clusters are left of `n` references (§3.2). So a cluster looks for a partner only among these.

use super::clusters::{Cluster, Clusters};
use super::links::Links;
use super::morton::{Range, morton_order};
use super::top_down::{SERIAL, in_range};
use crate::check::{SettingError, must};
use crate::parameters::parameters;
use crate::stop::Stop;
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;

/// Most references that the pipeline gives [`agglomerative`]: its time grows with their square, and this many take some seconds.
pub const MOST_AGGLOMERATED: usize = 1 << 15;

/// Settings of [`aac`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default))]
#[non_exhaustive]
pub struct AacSettings {
    /// Fewer references than this are a list of their own, δ: 2 to 65,536. Time and memory of a list grow with its square.
    pub delta: u32,
    /// Of `n` references `c·n^(1/2-ε)` clusters are left, `c = δ^(1/2+ε)/2`: 0 to 0.5. The larger, the fewer.
    pub epsilon: f64,
}

impl AacSettings {
    /// As published: fast.
    pub const FAST: Self = Self { delta: 4, epsilon: 0.2 };
    /// As published: high quality.
    pub const HQ: Self = Self { delta: 20, epsilon: 0.1 };

    /// Whether every value makes sense.
    ///
    /// # Errors
    /// The first that makes none.
    pub fn check(&self) -> Result<(), SettingError> {
        must("aac.delta", self.delta, (2..=1 << 16).contains(&self.delta), "2 to 65536")?;
        must("aac.epsilon", self.epsilon, (0.0..=0.5).contains(&self.epsilon), "0 to 0.5")
    }

    /// Clusters that are left of so many references.
    fn clusters(&self, references: usize) -> usize {
        let c = libm::pow(f64::from(self.delta), 0.5 + self.epsilon) / 2.0;
        (c * libm::pow(references as f64, 0.5 - self.epsilon)).ceil() as usize
    }
}

impl Default for AacSettings {
    fn default() -> Self {
        Self::HQ
    }
}

parameters!(
    AacSettings,
    known "fast, hq, delta=N, epsilon=E",
    presets { "fast" => Self::FAST, "hq" => Self::HQ, "" => Self::default() },
    delta, epsilon
);

/// Builds a tree of one triangle per leaf on the CPU by exact agglomeration, on one thread, in a time that grows with the square of the number of triangles
/// and worse: for up to some 10,000. Returns `nodes[2n-1]` for [`DeviceTree::upload`](super::DeviceTree::upload), numbered depth-first. `triangles` are finite
/// and of any size.
///
/// Of pairs with equal common areas the one goes first whose smallest references differ in lower bits, then the one with the smallest reference.
/// Of no triangles there is no tree, and no nodes.
#[must_use]
pub fn agglomerative(triangles: &[Triangle]) -> Vec<Node> {
    agglomerative_until(triangles, None).unwrap_or_default()
}

/// [`agglomerative`]; none of no triangles, or if an end was asked for.
pub(crate) fn agglomerative_until(triangles: &[Triangle], stop: Option<&Stop>) -> Option<Vec<Node>> {
    let working = in_range(triangles);
    let links = Links::new(triangles.len());
    let mut clusters = Clusters::new((0..).zip(working.iter()).map(|(k, triangle)| Cluster::of(k, triangle.aabb())));
    clusters.merge_down(1, |a, b| (!stop.is_some_and(Stop::is_asked)).then(|| links.join(a, b)))?;
    let root = clusters.only()?.node;
    Some(links.nodes(root, triangles))
}

/// Builds a tree of one triangle per leaf on the CPU by approximate agglomeration, with all threads of the current rayon pool; the tree does not depend on
/// their number. Else as [`agglomerative`].
///
/// # Errors
/// If a setting makes no sense.
pub fn aac(triangles: &[Triangle], settings: &AacSettings) -> Result<Vec<Node>, SettingError> {
    settings.check()?;
    Ok(aac_until(triangles, settings, None).unwrap_or_default())
}

/// [`aac`] with settings that make sense; none of no triangles, or if an end was asked for.
pub(crate) fn aac_until(triangles: &[Triangle], settings: &AacSettings, stop: Option<&Stop>) -> Option<Vec<Node>> {
    let left = |references| settings.clusters(references);
    approximate(triangles, settings.delta as usize, &left, stop)
}

/// AAC with `f` for how many clusters are left of so many references.
fn approximate(
    triangles: &[Triangle],
    delta: usize,
    f: &(dyn Fn(usize) -> usize + Sync),
    stop: Option<&Stop>,
) -> Option<Vec<Node>> {
    if triangles.is_empty() {
        return None;
    }
    let working = in_range(triangles);
    let sorted = morton_order(&working);
    let build = Build { triangles: &working, links: Links::new(triangles.len()), delta, f, stop };
    let mut clusters = build.clusters(Range { sorted: &sorted, start: 0 })?;
    clusters.merge_down(1, |a, b| Some(build.links.join(a, b)))?;
    let root = clusters.only()?.node;
    Some(build.links.nodes(root, triangles))
}

struct Build<'a> {
    triangles: &'a [Triangle],
    links: Links,
    delta: usize,
    f: &'a (dyn Fn(usize) -> usize + Sync),
    stop: Option<&'a Stop>,
}

impl Build<'_> {
    /// The clusters that are left of a range. Calls itself once per bit of a code or a place, at most.
    fn clusters(&self, range: Range<'_>) -> Option<Clusters> {
        if self.stop.is_some_and(Stop::is_asked) {
            return None;
        }
        let n = range.sorted.len();
        let mut clusters = if n < self.delta.max(2) {
            Clusters::new(range.sorted.iter().map(|&(_, k)| Cluster::of(k, self.triangles[k as usize].aabb())))
        } else {
            let [left, right] = range.halves();
            let halves = if n < SERIAL {
                (self.clusters(left), self.clusters(right))
            } else {
                rayon::join(|| self.clusters(left), || self.clusters(right))
            };
            halves.0?.join(halves.1?)
        };
        // Fewer than δ are left as many as of δ.
        clusters.merge_down((self.f)(n.max(self.delta)), |a, b| Some(self.links.join(a, b)))?;
        Some(clusters)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::{Bvh, tree_hash};
    use crate::scene::built_in;

    fn hash(nodes: &[Node]) -> String {
        tree_hash(&Bvh::from_device(nodes).unwrap())
    }

    #[test]
    fn with_all_clusters_left_it_is_the_exact_one() {
        let scene = built_in(700).triangles;
        let doubled: Vec<Triangle> = scene[..150].iter().flat_map(|triangle| [*triangle; 3]).collect();
        for triangles in [&scene[..], &scene[..1], &scene[..2], &scene[..3], &doubled] {
            let exact = hash(&agglomerative(triangles));
            for delta in [1, 2, 9, 1000] {
                let approximated = approximate(triangles, delta, &|n| n, None).unwrap();
                assert_eq!(hash(&approximated), exact, "{} triangles, delta {delta}", triangles.len());
            }
            if triangles.len() > 100 {
                assert_ne!(hash(&aac(triangles, &AacSettings::FAST).unwrap()), exact);
            }
        }
    }

    #[test]
    fn so_many_clusters_are_left() {
        // c = 4^0.7/2 and c = 20^0.6/2.
        for (settings, references, left) in [
            (AacSettings::FAST, 4, 2),
            (AacSettings::FAST, 10_000, 21),
            (AacSettings::HQ, 20, 10),
            (AacSettings::HQ, 10_000, 121),
        ] {
            assert_eq!(settings.clusters(references), left, "{settings:?}, {references}");
        }
    }

    #[test]
    fn an_end_that_is_asked_for_leaves_no_tree() {
        let stop = Stop::default();
        stop.ask();
        let triangles = built_in(100).triangles;
        assert!(agglomerative_until(&triangles, Some(&stop)).is_none());
        assert!(aac_until(&triangles, &AacSettings::HQ, Some(&stop)).is_none());
    }
}
