//! The 32 bytes of a node and how to walk a tree made of them.
//!
//! ```text
//!   word   0 1 2   3    4 5 6   7
//!          min     up   max     down
//! ```
//! `down` of an internal node is its left child; of a leaf it is the reference (triangle) that the leaf holds.
//! `up` threads the tree in depth-first order, so that a walk never needs more than the line that it stands on:
//!
//! ```text
//!            p                up(l) = r            "after me comes my sibling"
//!          /   \              up(r) = p | RIGHT    "after me comes nothing below p"
//!         l --> r             up(root) = NO_NODE
//! ```
//! Hence `left(p) = down(p)`, `right(p) = up(down(p))`, and the parent of a left child is one step further away.

use crate::aabb::Aabb;
use crate::math::select;
use crate::mem::{AtomicU32, atomic_words, prefetch};
use bytemuck::{Pod, Zeroable};

/// Set in [`Node::up`] of a right child, whose other bits are its parent.
pub const RIGHT: u32 = 0x8000_0000;

/// No node; [`Node::up`] of the root.
pub const NO_NODE: u32 = u32::MAX;

/// The root of every tree.
pub const ROOT: u32 = 0;

/// A node of a tree under construction, 32 bytes. See the module for the links.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Node {
    /// Smallest coordinates of the box.
    pub min: [f32; 3],
    /// Left child: its sibling. Right child: its parent with [`RIGHT`]. Root: [`NO_NODE`].
    pub up: u32,
    /// Largest coordinates of the box.
    pub max: [f32; 3],
    /// Internal node: its left child. Leaf: its reference.
    pub down: u32,
}

impl Node {
    /// The node's box.
    #[inline(always)]
    pub fn aabb(&self) -> Aabb {
        Aabb { min: self.min, max: self.max }
    }

    /// `a` if `condition`, else `b`, by words.
    #[inline(always)]
    fn select(condition: bool, a: Self, b: Self) -> Self {
        let Aabb { min, max } = Aabb::select(condition, a.aabb(), b.aabb());
        Self { min, up: select(condition, a.up, b.up), max, down: select(condition, a.down, b.down) }
    }

    /// Whether the node is a left child, so that `up` is its sibling.
    #[inline(always)]
    pub fn is_left(&self) -> bool {
        self.up & RIGHT == 0
    }

    /// Parent of a right child; [`NO_NODE`] of the root.
    #[inline(always)]
    pub fn parent_of_right(&self) -> u32 {
        parent_of_right(self.up)
    }
}

#[inline(always)]
fn parent_of_right(up: u32) -> u32 {
    if up == NO_NODE { NO_NODE } else { up & !RIGHT }
}

/// Four words that are loaded at once.
#[cfg_attr(target_arch = "spirv", rust_gpu::vector::v1)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
struct Quad {
    x: u32,
    y: u32,
    z: u32,
    w: u32,
}

/// A [`Node`] as two vectors of four words, for kernels that walk: a GPU loads a vector as fast as a word, and where loads are made lane by lane, as on
/// lavapipe, it costs little more.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct WideNode {
    low: Quad,
    high: Quad,
}

const _: () = assert!(size_of::<WideNode>() == size_of::<Node>());

impl WideNode {
    /// The node.
    #[inline(always)]
    pub fn node(self) -> Node {
        let Self { low, high } = self;
        Node {
            min: [f32::from_bits(low.x), f32::from_bits(low.y), f32::from_bits(low.z)],
            up: low.w,
            max: [f32::from_bits(high.x), f32::from_bits(high.y), f32::from_bits(high.z)],
            down: high.w,
        }
    }
}

/// Arrays whose nodes are loaded as a whole.
pub trait WholeNodes: Links {
    /// Node `v`.
    fn whole(&self, v: u32) -> Node;

    /// Asks for node `v`, which may be none, before it is needed.
    #[inline(always)]
    fn ask_for(&self, _v: u32) {}

    /// Box of node `v`.
    #[inline(always)]
    fn box_of(&self, v: u32) -> Aabb {
        self.whole(v).aabb()
    }

    /// Parent and sibling of a node, which is not the root.
    #[inline(always)]
    fn family(&self, node: Node) -> Family {
        let is_left = node.is_left();
        let link = node.up & !RIGHT;
        let linked = self.whole(link);
        let other = select(is_left, linked.up & !RIGHT, linked.down);
        let other_node = self.whole(other);
        Family {
            parent: select(is_left, other, link),
            sibling: select(is_left, link, other),
            parent_node: Node::select(is_left, other_node, linked),
            sibling_box: Aabb::select(is_left, linked.aabb(), other_node.aabb()),
        }
    }
}

impl WholeNodes for [Node] {
    #[inline(always)]
    fn whole(&self, v: u32) -> Node {
        self[v as usize]
    }
}

impl WholeNodes for [AtomicNode] {
    #[inline(always)]
    fn whole(&self, v: u32) -> Node {
        let Aabb { min, max } = self.box_of(v);
        let node = &self[v as usize];
        Node { min, up: node.up(), max, down: node.down() }
    }

    #[inline(always)]
    fn box_of(&self, v: u32) -> Aabb {
        self[v as usize].aabb()
    }
}

impl WholeNodes for [WideNode] {
    #[inline(always)]
    fn whole(&self, v: u32) -> Node {
        self[v as usize].node()
    }

    #[inline(always)]
    fn ask_for(&self, v: u32) {
        prefetch(self, v);
    }
}

/// Those next to a node; see [`WholeNodes::family`].
#[derive(Clone, Copy, Debug)]
pub struct Family {
    /// The parent.
    pub parent: u32,
    /// The other child of the parent.
    pub sibling: u32,
    /// The parent itself.
    pub parent_node: Node,
    /// Box of the sibling.
    pub sibling_box: Aabb,
}

/// A [`Node`] whose words many invocations may touch.
#[repr(C)]
pub struct AtomicNode {
    min_x: AtomicU32,
    min_y: AtomicU32,
    min_z: AtomicU32,
    up: AtomicU32,
    max_x: AtomicU32,
    max_y: AtomicU32,
    max_z: AtomicU32,
    down: AtomicU32,
}

const _: () = assert!(size_of::<Node>() == 32);
atomic_words!(AtomicNode { min_x, min_y, min_z, up, max_x, max_y, max_z, down } of Node);

impl AtomicNode {
    /// The node's box.
    #[inline(always)]
    pub fn aabb(&self) -> Aabb {
        Aabb {
            min: [self.min_x.load_f32(), self.min_y.load_f32(), self.min_z.load_f32()],
            max: [self.max_x.load_f32(), self.max_y.load_f32(), self.max_z.load_f32()],
        }
    }

    /// Replaces the node's box.
    #[inline(always)]
    pub fn set_aabb(&self, aabb: Aabb) {
        self.min_x.store_f32(aabb.min[0]);
        self.min_y.store_f32(aabb.min[1]);
        self.min_z.store_f32(aabb.min[2]);
        self.max_x.store_f32(aabb.max[0]);
        self.max_y.store_f32(aabb.max[1]);
        self.max_z.store_f32(aabb.max[2]);
    }

    /// See [`Node::up`].
    #[inline(always)]
    pub fn up(&self) -> u32 {
        self.up.load()
    }

    /// See [`Node::up`].
    #[inline(always)]
    pub fn set_up(&self, up: u32) {
        self.up.store(up);
    }

    /// See [`Node::down`].
    #[inline(always)]
    pub fn down(&self) -> u32 {
        self.down.load()
    }

    /// See [`Node::down`].
    #[inline(always)]
    pub fn set_down(&self, down: u32) {
        self.down.store(down);
    }
}

/// What every walk needs from an array of nodes, whether it is read-only or atomic in this dispatch.
pub trait Links {
    /// [`Node::up`] of node `v`.
    fn up(&self, v: u32) -> u32;
    /// [`Node::down`] of node `v`.
    fn down(&self, v: u32) -> u32;

    /// Right child of internal node `p`.
    #[inline(always)]
    fn right(&self, p: u32) -> u32 {
        self.up(self.down(p))
    }

    /// Parent of `v`; [`NO_NODE`] of the root.
    #[inline(always)]
    fn parent(&self, v: u32) -> u32 {
        let up = self.up(v);
        if up & RIGHT == 0 { parent_of_right(self.up(up)) } else { parent_of_right(up) }
    }

    /// Other child of the parent of `v`, which is not the root.
    #[inline(always)]
    fn sibling(&self, v: u32) -> u32 {
        let up = self.up(v);
        if up & RIGHT == 0 { up } else { self.down(up & !RIGHT) }
    }
}

impl Links for [Node] {
    #[inline(always)]
    fn up(&self, v: u32) -> u32 {
        self[v as usize].up
    }
    #[inline(always)]
    fn down(&self, v: u32) -> u32 {
        self[v as usize].down
    }
}

impl Links for [WideNode] {
    #[inline(always)]
    fn up(&self, v: u32) -> u32 {
        self[v as usize].low.w
    }
    #[inline(always)]
    fn down(&self, v: u32) -> u32 {
        self[v as usize].high.w
    }
}

impl Links for [AtomicNode] {
    #[inline(always)]
    fn up(&self, v: u32) -> u32 {
        self[v as usize].up()
    }
    #[inline(always)]
    fn down(&self, v: u32) -> u32 {
        self[v as usize].down()
    }
}
