//! A tree in memory as the initial one.

use crate::bvh::Bvh;
use std::sync::Arc;

/// A tree that the caller has, lent to any number of runs.
#[derive(Clone, Debug)]
pub struct GivenTree(pub(crate) Arc<Bvh>);

impl std::ops::Deref for GivenTree {
    type Target = Bvh;

    fn deref(&self) -> &Bvh {
        &self.0
    }
}

/// The same tree, not an equal one.
impl PartialEq for GivenTree {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Eq for GivenTree {}

/// Its number of nodes: the tree itself is no setting.
#[cfg(feature = "serde")]
impl serde::Serialize for GivenTree {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map([("nodes", self.nodes.len())])
    }
}
