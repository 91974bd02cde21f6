//! What can be wrong with a tree.

use prbvh_kernel::aabb::Aabb;
use std::fmt;

/// One thing wrong with a tree. Numbers are node ids unless the name says otherwise.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TreeFault {
    /// No nodes, more than links can name, or (from a device) an even number.
    #[error("{nodes} nodes are no binary tree")]
    NodeCount {
        /// Nodes there are.
        nodes: usize,
    },
    /// A link names a node that does not exist.
    #[error("node {node}: {link} {value} is not among the {nodes} nodes")]
    LinkOutOfRange {
        /// Where the link is.
        node: u32,
        /// Which link.
        link: Link,
        /// Where it leads.
        value: u32,
        /// Nodes there are.
        nodes: u32,
    },
    /// The root has a parent (from a device: its `up` is not empty).
    #[error("the root has the parent {parent}")]
    RootParent {
        /// The parent.
        parent: u32,
    },
    /// The root is somebody's child.
    #[error("node {node}: the root is its child")]
    RootIsChild {
        /// Whose.
        node: u32,
    },
    /// A node besides the root has no parent.
    #[error("node {node} has no parent and is not the root")]
    ExtraRoot {
        /// The node.
        node: u32,
    },
    /// Both children are the same node.
    #[error("node {node}: both children are node {child}")]
    SameChildren {
        /// The parent.
        node: u32,
        /// The child.
        child: u32,
    },
    /// A child names another parent.
    #[error("node {node}: its child {child} has the parent {parent}")]
    ParentOfChild {
        /// Who has the child.
        node: u32,
        /// The child.
        child: u32,
        /// Whom the child names.
        parent: u32,
    },
    /// A parent does not have the child that names it.
    #[error("node {node}: its parent {parent} has other children")]
    ChildOfParent {
        /// The child.
        node: u32,
        /// Whom it names.
        parent: u32,
    },
    /// A child's `up`, in the threaded form of the devices, does not lead back to the parent.
    #[error("node {node}: `up` of its child {child} is {up:#010x}, which does not lead back")]
    Thread {
        /// The parent.
        node: u32,
        /// The child.
        child: u32,
        /// What the child says.
        up: u32,
    },
    /// Nobody has the node as a child, in the threaded form of the devices.
    #[error("node {node} is nobody's child")]
    Orphan {
        /// The node.
        node: u32,
    },
    /// A node lies below itself.
    #[error("node {node} lies below itself")]
    Cycle {
        /// The node.
        node: u32,
    },
    /// Two ways lead from the root to a node.
    #[error("node {node} is reached from the root in two ways")]
    Shared {
        /// The node.
        node: u32,
    },
    /// No way leads from the root to a node.
    #[error("node {node} is not reached from the root")]
    Unreachable {
        /// The node.
        node: u32,
    },
    /// A leaf lies deeper than a tree may reach ([`MaxDepth`](super::MaxDepth)).
    #[error("leaf {node} is {depth} links below the root, {max_depth} are allowed")]
    TooDeep {
        /// The leaf.
        node: u32,
        /// Its links to the root.
        depth: u32,
        /// Links that are allowed.
        max_depth: u32,
    },
    /// A leaf without triangles.
    #[error("leaf {node} is empty")]
    EmptyLeaf {
        /// The leaf.
        node: u32,
    },
    /// A leaf goes past the end of the triangle order.
    #[error("leaf {node}: {count} triangles from position {first} go beyond the {positions} of the triangle order")]
    LeafRange {
        /// The leaf.
        node: u32,
        /// Its first position.
        first: u32,
        /// Its triangles.
        count: u32,
        /// Positions there are.
        positions: usize,
    },
    /// Two leaves hold the same position of the triangle order.
    #[error("leaf {node} and leaf {other} both hold position {position} of the triangle order")]
    PositionShared {
        /// One leaf.
        node: u32,
        /// The other.
        other: u32,
        /// The position.
        position: u32,
    },
    /// No leaf holds a position of the triangle order.
    #[error("position {position} of the triangle order is in no leaf")]
    PositionUnused {
        /// The position.
        position: u32,
    },
    /// A leaf names a triangle that does not exist.
    #[error("leaf {node}: triangle {triangle} is not among the {triangles} triangles")]
    TriangleOutOfRange {
        /// The leaf.
        node: u32,
        /// The triangle.
        triangle: u32,
        /// Triangles there are.
        triangles: usize,
    },
    /// A triangle is in a tree twice.
    #[error("triangle {triangle} is in leaf {first} and again in leaf {second}")]
    TriangleTwice {
        /// The triangle.
        triangle: u32,
        /// One leaf.
        first: u32,
        /// The other, or the same again.
        second: u32,
    },
    /// A triangle is in no leaf.
    #[error("triangle {triangle} is in no leaf")]
    TriangleMissing {
        /// The triangle.
        triangle: u32,
    },
    /// A box has an infinite coordinate or a NaN.
    #[error("node {node}: the box {aabb:?} is not finite")]
    NotFinite {
        /// The node.
        node: u32,
        /// Its box.
        aabb: Aabb,
    },
    /// A box ends before it starts.
    #[error("node {node}: the box {aabb:?} has a smallest coordinate above the largest")]
    Inverted {
        /// The node.
        node: u32,
        /// Its box.
        aabb: Aabb,
    },
    /// A box is not the union of the children's.
    #[error("node {node}: the box is {have:?}, but the children's make {need:?}")]
    BoxOfChildren {
        /// The node.
        node: u32,
        /// Its box.
        have: Aabb,
        /// The union.
        need: Aabb,
    },
    /// A leaf's box is not the union of its triangles'.
    #[error("leaf {node}: the box is {have:?}, but the triangles' make {need:?}")]
    BoxOfTriangles {
        /// The leaf.
        node: u32,
        /// Its box.
        have: Aabb,
        /// The union.
        need: Aabb,
    },
    /// The pieces of a triangle that is in several leaves do not span it.
    #[error("triangle {triangle}: its pieces in the leaves span {have:?}, but its box is {need:?}")]
    Uncovered {
        /// The triangle.
        triangle: u32,
        /// What the pieces span.
        have: Aabb,
        /// Its box.
        need: Aabb,
    },
    /// The pieces of a triangle that is in several leaves leave a hole in it.
    #[error("triangle {triangle}: its pieces in the leaves have an area of {have:e}, but it has {need:e}")]
    Hole {
        /// The triangle.
        triangle: u32,
        /// Sum of the pieces' areas, scene units².
        have: f64,
        /// Its area.
        need: f64,
    },
    /// A leaf holds a triangle whose box is nowhere in the leaf's.
    #[error("triangle {triangle}: a leaf that holds it lies apart from it")]
    LeafApart {
        /// The triangle.
        triangle: u32,
    },
}

/// A link of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// To the left child.
    Left,
    /// To the right child.
    Right,
    /// To the parent.
    Parent,
}

impl fmt::Display for Link {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Left => "left child",
            Self::Right => "right child",
            Self::Parent => "parent",
        })
    }
}

/// The first few faults, one a line, and how many more there are.
#[must_use]
pub fn summary(faults: &[TreeFault]) -> String {
    const SHOWN: usize = 8;
    let mut lines: Vec<String> = faults.iter().take(SHOWN).map(ToString::to_string).collect();
    if faults.len() > SHOWN {
        lines.push(format!("… and {} more faults", faults.len() - SHOWN));
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_summary_says_how_much_it_leaves_out() {
        let faults: Vec<_> = (0..11).map(|node| TreeFault::Orphan { node }).collect();
        let text = summary(&faults);
        assert_eq!(text.lines().count(), 9);
        assert!(text.starts_with("node 0 is nobody's child\n") && text.ends_with("… and 3 more faults"), "{text}");
        assert_eq!(summary(&faults[..1]), "node 0 is nobody's child");
    }
}
