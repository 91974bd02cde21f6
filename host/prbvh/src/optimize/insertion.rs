//! Builders that insert one reference after another.
//!
//! The greedy one is that of Goldsmith & Salmon 1987 (*Automatic Creation of Object Hierarchies for Ray Tracing*), for binary trees with a reference in each
//! leaf. Branch and bound finds the cheapest place in the whole tree, and with a reoptimisation of the worst nodes between batches it is the online
//! construction of Bittner, Hapala & Havran 2015 (*Incremental BVH Construction for Ray Tracing*, Computers & Graphics 47).
//!
//! The order of insertion decides much. References of a scene come sorted or in tiles, the worst orders there are, and so they are shuffled.

use super::rbvh::{Between, Way, grown};
use crate::build::in_range;
use crate::bvh::Bvh;
use crate::check::{SettingError, must};
use crate::parameters::parameters;
use crate::stop::Stop;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::{NO_NODE, Node};
use prbvh_kernel::setup::Triangle;

/// Settings of [`insertion`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default))]
#[non_exhaustive]
pub struct InsertionSettings {
    /// Nodes that the search for the best place may open, which begins with the greedy one; 0 for the greedy one. Where many boxes lie in each other the
    /// bounds say nothing, and a search without an end opens every node.
    pub most_steps: u32,
    /// Seed of the order.
    pub seed: u64,
}

impl InsertionSettings {
    /// As by Goldsmith & Salmon.
    pub const GREEDY: Self = Self { most_steps: 0, ..Self::BRANCH_AND_BOUND };
    /// The best place, but for inputs where that takes too long.
    pub const BRANCH_AND_BOUND: Self = Self { most_steps: 1024, seed: 1 };

    /// Every value makes sense.
    ///
    /// # Errors
    /// None today.
    pub fn check(&self) -> Result<(), SettingError> {
        Ok(())
    }
}

impl Default for InsertionSettings {
    fn default() -> Self {
        Self::BRANCH_AND_BOUND
    }
}

parameters!(
    InsertionSettings,
    known "greedy, most_steps=N, seed=N",
    presets { "" => Self::BRANCH_AND_BOUND, "greedy" => Self::GREEDY },
    most_steps, seed
);

/// Settings of [`online`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default))]
#[non_exhaustive]
pub struct OnlineSettings {
    /// References of a batch, as a part of those that are in the tree, above 0; 1024 at least.
    pub batch: f64,
    /// Part of the nodes, the worst ones, that are reinserted after each batch: above 0, at most 1.
    pub worst: f64,
    /// As [`InsertionSettings::most_steps`].
    pub most_steps: u32,
    /// Seed of the order.
    pub seed: u64,
}

impl OnlineSettings {
    /// Whether every value makes sense.
    ///
    /// # Errors
    /// The first that makes none.
    pub fn check(&self) -> Result<(), SettingError> {
        let Self { batch, worst, .. } = *self;
        must("online.batch", batch, batch > 0.0 && batch.is_finite(), "a finite number above 0")?;
        must("online.worst", worst, worst > 0.0 && worst <= 1.0, "above 0 and at most 1")
    }
}

impl Default for OnlineSettings {
    fn default() -> Self {
        let InsertionSettings { most_steps, seed } = InsertionSettings::default();
        Self { batch: 0.25, worst: 0.05, most_steps, seed }
    }
}

parameters!(
    OnlineSettings,
    known "batch=PART, worst=PART, most_steps=N, seed=N",
    presets { "" => Self::default() },
    batch, worst, most_steps, seed
);

/// Builds a tree of one triangle per leaf by insertion, on one thread of the CPU. Returns `nodes[2n-1]` for
/// [`DeviceTree::upload`](crate::build::DeviceTree::upload), numbered depth-first. `triangles` are finite and of any size. Of no triangles there is no tree, and no nodes.
#[must_use]
pub fn insertion(triangles: &[Triangle], settings: &InsertionSettings) -> Vec<Node> {
    insertion_until(triangles, settings, None).unwrap_or_default()
}

/// [`insertion`]; none of no triangles, or if an end was asked for.
pub(crate) fn insertion_until(
    triangles: &[Triangle],
    &InsertionSettings { most_steps, seed }: &InsertionSettings,
    stop: Option<&Stop>,
) -> Option<Vec<Node>> {
    build(triangles, Way { most_steps, seed }, None, stop)
}

/// As [`insertion`], with a reoptimisation of the worst nodes after each batch of references.
///
/// # Errors
/// If a setting makes no sense.
pub fn online(triangles: &[Triangle], settings: &OnlineSettings) -> Result<Vec<Node>, SettingError> {
    settings.check()?;
    Ok(online_until(triangles, settings, None).unwrap_or_default())
}

/// [`online`] with settings that make sense; none of no triangles, or if an end was asked for.
pub(crate) fn online_until(
    triangles: &[Triangle],
    &OnlineSettings { batch, worst, most_steps, seed }: &OnlineSettings,
    stop: Option<&Stop>,
) -> Option<Vec<Node>> {
    build(triangles, Way { most_steps, seed }, Some(Between { batch, worst }), stop)
}

fn build(triangles: &[Triangle], way: Way, between: Option<Between>, stop: Option<&Stop>) -> Option<Vec<Node>> {
    if let [only] = triangles {
        let Aabb { min, max } = only.aabb();
        return Some(vec![Node { min, up: NO_NODE, max, down: 0 }]);
    }
    if triangles.is_empty() {
        return None;
    }
    let boxes: Vec<Aabb> = in_range(triangles).iter().map(Triangle::aabb).collect();
    let nodes = grown(&boxes, way, between, stop)?.nodes();
    let tree = Bvh::from_device(&nodes).expect("insertions keep a tree").with_boxes_of(triangles);
    Some(tree.to_device().expect("a leaf holds a reference"))
}
