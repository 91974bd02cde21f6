//! What a wide tree is asked to be.

use super::layout::Layout;
use super::width::Width;
use crate::bvh::SahModel;
use crate::check::{SettingError, at_least_1, must};

/// How children are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum CollapseMethod {
    /// The tree of least cost, by dynamic programming (Ylitie, Karras & Laine 2017).
    #[default]
    Optimal,
    /// The child of the largest box is opened until the node is full (Wald, Benthin & Boulos 2008).
    Greedy,
}

/// A wide tree beside the binary one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default))]
#[non_exhaustive]
pub struct WideSettings {
    /// Most children of a node.
    pub width: Width,
    /// How its nodes lie in memory.
    pub layout: Layout,
    /// How children are chosen.
    pub method: CollapseMethod,
    /// Before it is collapsed, subtrees of the binary tree move to where the wide tree costs less, among what lies below the ancestor so many levels above their parent; 0: all stay, 4 at most. Only
    /// for [`CollapseMethod::Optimal`].
    pub reach: u32,
    /// The costs that decide; none: [`Width::sah`].
    pub sah: Option<SahModel>,
    /// Most triangles of a leaf, at least 1; none: as many as the layout can hold.
    pub max_leaf: Option<u32>,
}

impl WideSettings {
    /// # Errors
    /// The first field whose value makes no sense.
    pub fn check(&self) -> Result<(), SettingError> {
        const COST: &str = "a number from 0 to 1000000";
        let SahModel { c_traversal, c_intersect } = self.costs();
        for (name, value) in [("wide.c_traversal", c_traversal), ("wide.c_intersect", c_intersect)] {
            must(name, value, (0.0..=1e6).contains(&value), COST)?;
        }
        must("wide.reach", self.reach, self.reach <= 4, "from 0 to 4")?;
        if self.method == CollapseMethod::Greedy {
            must("wide.reach", self.reach, self.reach == 0, "0 where the collapse is greedy")?;
        }
        at_least_1("wide.max_leaf", self.max_leaf.unwrap_or(1))?;
        if self.layout == Layout::Cwbvh {
            must("wide.width", self.width, self.width == Width::Eight, "8 where the layout is cwbvh")?;
            let most = self.max_leaf.unwrap_or(1);
            must("wide.max_leaf", most, most <= Layout::CWBVH_LEAF, "at most 3 where the layout is cwbvh")?;
        }
        Ok(())
    }

    /// The costs that decide.
    #[must_use]
    pub fn costs(&self) -> SahModel {
        self.sah.unwrap_or_else(|| self.width.sah())
    }

    /// Most triangles of a leaf.
    #[must_use]
    pub fn most_of_a_leaf(&self) -> u32 {
        let most = match self.layout {
            Layout::Soa => u32::MAX,
            Layout::Cwbvh => Layout::CWBVH_LEAF,
        };
        self.max_leaf.unwrap_or(most).min(most)
    }
}
