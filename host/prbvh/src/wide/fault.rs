//! What can be wrong with a wide tree.

use prbvh_kernel::aabb::Aabb;

/// One thing wrong with a wide tree.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WideFault {
    /// No nodes, or more than links can name.
    #[error("{nodes} nodes are no tree")]
    NodeCount {
        /// Nodes there are.
        nodes: usize,
    },
    /// A slot beyond the width is taken.
    #[error("node {node}: slot {slot} is taken in a tree of width {width}")]
    BeyondWidth {
        /// The node.
        node: u32,
        /// The slot.
        slot: usize,
        /// The width.
        width: usize,
    },
    /// A node has no children.
    #[error("node {node} is empty")]
    EmptyNode {
        /// The node.
        node: u32,
    },
    /// A link names a node that does not exist.
    #[error("node {node}, slot {slot}: node {child} is not among the {nodes} nodes")]
    LinkOutOfRange {
        /// Where the link is.
        node: u32,
        /// Which.
        slot: usize,
        /// Where it leads.
        child: u32,
        /// Nodes there are.
        nodes: usize,
    },
    /// The root is somebody's child, or two links lead to a node.
    #[error("node {node}, slot {slot}: node {child} has a parent already, or is the root")]
    Shared {
        /// Where the link is.
        node: u32,
        /// Which.
        slot: usize,
        /// Where it leads.
        child: u32,
    },
    /// No way leads from the root to a node.
    #[error("node {node} is not reached from the root")]
    Unreachable {
        /// The node.
        node: u32,
    },
    /// A leaf without triangles.
    #[error("node {node}, slot {slot}: the leaf is empty")]
    EmptyLeaf {
        /// The node.
        node: u32,
        /// The slot.
        slot: usize,
    },
    /// A leaf goes past the end of the triangle order.
    #[error(
        "node {node}, slot {slot}: {count} triangles from position {first} go beyond the {positions} of the triangle order"
    )]
    LeafRange {
        /// The node.
        node: u32,
        /// The slot.
        slot: usize,
        /// Its first position.
        first: u32,
        /// Its triangles.
        count: u32,
        /// Positions there are.
        positions: usize,
    },
    /// Two leaves hold the same position of the triangle order.
    #[error("node {node}, slot {slot}: position {position} of the triangle order is in another leaf, too")]
    PositionShared {
        /// The node.
        node: u32,
        /// The slot.
        slot: usize,
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
    #[error("position {position}: triangle {triangle} is not among the {triangles} triangles")]
    TriangleOutOfRange {
        /// The position in the triangle order.
        position: u32,
        /// The triangle.
        triangle: u32,
        /// Triangles there are.
        triangles: usize,
    },
    /// A triangle is in the order twice.
    #[error("triangle {triangle} is there twice, the second time at position {position}")]
    TriangleTwice {
        /// The triangle.
        triangle: u32,
        /// The position in the triangle order.
        position: u32,
    },
    /// A triangle is in no leaf.
    #[error("triangle {triangle} is in no leaf")]
    TriangleMissing {
        /// The triangle.
        triangle: u32,
    },
    /// A box has an infinite coordinate or a NaN, or ends before it starts.
    #[error("node {node}, slot {slot}: {aabb:?} is no box")]
    NoBox {
        /// The node.
        node: u32,
        /// The slot.
        slot: usize,
        /// The box.
        aabb: Aabb,
    },
    /// A triangle sticks out of a box.
    #[error("node {node}, slot {slot}: the box {have:?} does not hold {need:?}")]
    Outside {
        /// The node.
        node: u32,
        /// The slot.
        slot: usize,
        /// The box.
        have: Aabb,
        /// The smallest box around the triangles below.
        need: Aabb,
    },
    /// A byte of a compressed node means nothing.
    #[error("node {node}: {what} is {value}, but must be {need}")]
    Meaningless {
        /// The node.
        node: u32,
        /// Which number.
        what: &'static str,
        /// Its value.
        value: u32,
        /// What it must be.
        need: &'static str,
    },
}
