//! Wide trees as arrays of nodes that a traversal reads.

use super::layout::Layout;
use super::octants::by_octants;
use super::validate::validate;
use super::{SLOTS, WideBvh, WideChild, WideContent, WideFault, WideNode, Width, cwbvh, soa};
use prbvh_kernel::trace::wide::{Bvh4Node, Bvh8Node, CwbvhNode};

/// The nodes of a [`PackedTree`].
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum PackedNodes {
    /// Four children, boxes as they are.
    Bvh4(Vec<Bvh4Node>),
    /// Eight children, boxes as they are.
    Bvh8(Vec<Bvh8Node>),
    /// Eight children, compressed.
    Cwbvh(Vec<CwbvhNode>),
}

impl PackedNodes {
    /// The nodes' bytes.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        match self {
            Self::Bvh4(nodes) => bytemuck::cast_slice(nodes),
            Self::Bvh8(nodes) => bytemuck::cast_slice(nodes),
            Self::Cwbvh(nodes) => bytemuck::cast_slice(nodes),
        }
    }

    /// Nodes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.bytes().len() / self.node_bytes()
    }

    /// Whether there are none, which no tree has.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes of a node.
    #[must_use]
    pub fn node_bytes(&self) -> usize {
        self.layout().node_bytes(self.width())
    }

    /// Most children of a node.
    #[must_use]
    pub fn width(&self) -> Width {
        match self {
            Self::Bvh4(_) => Width::Four,
            Self::Bvh8(_) | Self::Cwbvh(_) => Width::Eight,
        }
    }

    /// How they lie.
    #[must_use]
    pub fn layout(&self) -> Layout {
        match self {
            Self::Bvh4(_) | Self::Bvh8(_) => Layout::Soa,
            Self::Cwbvh(_) => Layout::Cwbvh,
        }
    }

    /// What lies in them, node by node.
    fn unpacked(&self) -> Result<Vec<WideNode>, Vec<WideFault>> {
        match self {
            Self::Bvh4(nodes) => Ok(nodes.iter().map(soa::unpack4).collect()),
            Self::Bvh8(nodes) => Ok(nodes.iter().map(soa::unpack8).collect()),
            Self::Cwbvh(nodes) => cwbvh::unpack(nodes),
        }
    }
}

/// A wide tree as two arrays, which `bytemuck` casts to bytes. The order of nodes is given by the tree alone: children side by side, and what lies below the
/// first of them before what lies below the next.
#[derive(Clone, Debug, PartialEq)]
pub struct PackedTree {
    /// `[nodes]`; the root is the first.
    pub nodes: PackedNodes,
    /// Triangle ids, leaf by leaf, `[n]`.
    pub order: Vec<u32>,
}

/// A tree does not fit into a layout.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NotPacked {
    /// A leaf holds too many triangles.
    #[error("a leaf of {count} triangles does not fit into the layout {layout}, which holds {most}")]
    Leaf {
        /// Its triangles.
        count: u32,
        /// The layout.
        layout: Layout,
        /// Most that it holds.
        most: u32,
    },
}

impl PackedTree {
    /// Packs a valid tree. In compressed nodes children take the slots that suit the octants of rays, and boxes become larger, never smaller.
    ///
    /// # Errors
    /// If a leaf has more triangles than the layout can hold.
    ///
    /// # Panics
    /// If the links are no tree.
    pub fn new(tree: &WideBvh, layout: Layout) -> Result<Self, NotPacked> {
        let (nodes, order) = in_order(tree, layout);
        if layout == Layout::Cwbvh
            && let Some(count) = largest_leaf(&nodes).filter(|&count| count > Layout::CWBVH_LEAF)
        {
            return Err(NotPacked::Leaf { count, layout, most: Layout::CWBVH_LEAF });
        }
        let nodes = match (layout, tree.width) {
            (Layout::Soa, Width::Four) => PackedNodes::Bvh4(nodes.iter().map(soa::pack4).collect()),
            (Layout::Soa, Width::Eight) => PackedNodes::Bvh8(nodes.iter().map(soa::pack8).collect()),
            (Layout::Cwbvh, _) => PackedNodes::Cwbvh(nodes.iter().map(cwbvh::pack).collect()),
        };
        Ok(Self { nodes, order })
    }

    /// The tree in the nodes; its boxes are those of the layout.
    ///
    /// # Errors
    /// All faults that [`validate`] finds without triangles, and what means nothing in the layout.
    pub fn unpack(&self) -> Result<WideBvh, Vec<WideFault>> {
        let nodes = self.nodes.unpacked()?;
        let tree = WideBvh { width: self.nodes.width(), nodes, triangle_order: self.order.clone() };
        validate(&tree, None)?;
        Ok(tree)
    }

    /// Bytes of nodes and triangle order.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.nodes.bytes().len() + 4 * self.order.len()
    }

    /// [`PackedTree::bytes`] for each triangle of the order.
    #[must_use]
    pub fn bytes_per_triangle(&self) -> f64 {
        self.bytes() as f64 / self.order.len() as f64
    }

    /// The first 16 bytes of BLAKE3 over the counts, the nodes and the order, as 32 hexadecimal digits: equal packed trees have one hash on all devices.
    #[must_use]
    pub fn hash(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&(self.nodes.len() as u64).to_le_bytes());
        hasher.update(&(self.order.len() as u64).to_le_bytes());
        hasher.update(&[self.nodes.node_bytes() as u8]);
        for word in self.words() {
            hasher.update(&word.to_le_bytes());
        }
        hasher.finalize().to_hex()[..32].to_owned()
    }

    /// Position and number of triangles of each leaf; none if the nodes mean nothing.
    pub(crate) fn leaves(&self) -> Vec<(u32, u32)> {
        let nodes = self.nodes.unpacked().unwrap_or_default();
        let leaf = |child: &WideChild| match child.content {
            WideContent::Leaf { first, count } => Some((first, count)),
            WideContent::Node(_) => None,
        };
        nodes.iter().flat_map(WideNode::children).filter_map(leaf).collect()
    }

    /// All words of nodes and order.
    pub(super) fn words(&self) -> impl Iterator<Item = u32> {
        let nodes: &[u32] = bytemuck::cast_slice(self.nodes.bytes());
        nodes.iter().chain(&self.order).copied()
    }
}

/// Nodes and triangles in the order that the tree alone gives.
fn in_order(tree: &WideBvh, layout: Layout) -> (Vec<WideNode>, Vec<u32>) {
    let mut nodes = vec![WideNode::default()];
    let mut order = Vec::with_capacity(tree.triangle_order.len());
    let mut stack = vec![(0u32, 0u32)];
    while let Some((from, to)) = stack.pop() {
        let mut node = match layout {
            Layout::Soa => without_gaps(&tree.nodes[from as usize]),
            Layout::Cwbvh => by_octants(&tree.nodes[from as usize]),
        };
        let waiting = stack.len();
        for WideChild { content, .. } in node.slots.iter_mut().flatten() {
            match content {
                WideContent::Node(below) => {
                    let number = nodes.len() as u32;
                    assert!(nodes.len() < tree.nodes.len(), "the links are no tree");
                    nodes.push(WideNode::default());
                    stack.push((*below, number));
                    *below = number;
                }
                WideContent::Leaf { first, count } => {
                    let start = order.len() as u32;
                    order.extend_from_slice(&tree.triangle_order[*first as usize..][..*count as usize]);
                    *first = start;
                }
            }
        }
        stack[waiting..].reverse();
        nodes[to as usize] = node;
    }
    (nodes, order)
}

/// The children in the first slots.
fn without_gaps(node: &WideNode) -> WideNode {
    let mut slots = [None; SLOTS];
    for (slot, child) in slots.iter_mut().zip(node.children()) {
        *slot = Some(*child);
    }
    WideNode { slots }
}

fn largest_leaf(nodes: &[WideNode]) -> Option<u32> {
    let counts = nodes.iter().flat_map(WideNode::children).filter_map(|child| match child.content {
        WideContent::Leaf { count, .. } => Some(count),
        WideContent::Node(_) => None,
    });
    counts.max()
}
