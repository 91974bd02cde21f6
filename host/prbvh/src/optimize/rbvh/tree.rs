//! The tree that RBVH works on: links in both directions, boxes, and the sum of areas that the cost is made of.

use crate::bvh::{Bvh, Content, NO_NODE, ROOT};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::{Node, RIGHT};

/// A tree under sequential optimisation. Internal nodes are `[0, n-1)`, leaves `[n-1, 2n-1)`, the root is 0, as on a device.
#[derive(Clone, Debug)]
pub struct RbvhTree {
    nodes: Vec<Branch>,
    /// Apart from the nodes, since a search never climbs.
    parents: Vec<u32>,
    /// Half areas of the boxes, for the selection.
    areas: Vec<f32>,
    /// Reference of each leaf.
    references: Vec<u32>,
    /// Internal nodes that have a place in the tree; all of them but while a tree grows.
    placed: u32,
    /// Sum of the half areas of the internal nodes.
    internal_area: f64,
    leaf_area: f64,
    /// Children that internal nodes had since [`Self::keep`], the latest last.
    journal: Vec<(u32, [u32; 2])>,
    /// What was before each change since [`Self::begin`], the latest last.
    changes: Vec<Change>,
}

/// A change to be taken back.
#[derive(Clone, Copy, Debug)]
enum Change {
    Branch(u32, Branch),
    Parent(u32, u32),
}

/// The tree at a time, for [`RbvhTree::undo`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Mark {
    journal: usize,
    /// Before the changes.
    pub(super) internal_area: f64,
}

/// A node as a search reads it, 32 bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Branch {
    pub(super) aabb: Aabb,
    /// Left and right child; unused in a leaf.
    pub(super) children: [u32; 2],
}

const _: () = assert!(size_of::<Branch>() == 32);

impl RbvhTree {
    /// From a tree as [`Bvh::from_device`] makes it; boxes of internal nodes are computed anew.
    pub(super) fn new(bvh: Bvh) -> Self {
        let Bvh { nodes, triangle_order } = bvh;
        let branch = |node: &crate::bvh::BvhNode| Branch {
            aabb: node.aabb,
            children: match node.content {
                Content::Internal { left, right } => [left, right],
                Content::Leaf { .. } => [NO_NODE; 2],
            },
        };
        let mut tree = Self {
            parents: nodes.iter().map(|node| node.parent).collect(),
            areas: nodes.iter().map(|node| node.aabb.half_area()).collect(),
            nodes: nodes.iter().map(branch).collect(),
            references: triangle_order,
            placed: nodes.len() as u32 / 2,
            internal_area: 0.0,
            leaf_area: 0.0,
            journal: Vec::new(),
            changes: Vec::new(),
        };
        drop(nodes);
        tree.refit_all();
        let leaves = &tree.nodes[tree.internal() as usize..];
        tree.leaf_area = leaves.iter().map(|leaf| area(&leaf.aabb)).sum();
        tree
    }

    /// The first two of at least two references, which are to have leaves in this order. Others are not in the tree until [`Self::place`].
    pub(super) fn of_two(boxes: &[Aabb], order: Vec<u32>) -> Self {
        let internal = order.len() - 1;
        let leaf = |&reference: &u32| Branch { aabb: boxes[reference as usize], children: [NO_NODE; 2] };
        let nowhere = Branch { aabb: Aabb::EMPTY, children: [NO_NODE; 2] };
        let mut nodes = vec![nowhere; internal];
        nodes.extend(order.iter().map(leaf));
        let first = internal as u32;
        let root = nodes[internal].aabb.union(nodes[internal + 1].aabb);
        nodes[ROOT as usize] = Branch { aabb: root, children: [first, first + 1] };
        let mut parents = vec![NO_NODE; nodes.len()];
        parents[internal..=internal + 1].fill(ROOT);
        let leaf_area = nodes[internal..].iter().map(|leaf| area(&leaf.aabb)).sum();
        Self {
            parents,
            areas: nodes.iter().map(|node| node.aabb.half_area()).collect(),
            nodes,
            references: order,
            placed: 1,
            internal_area: area(&root),
            leaf_area,
            journal: Vec::new(),
            changes: Vec::new(),
        }
    }

    /// Places the next reference beside `target`, for good.
    pub(super) fn place(&mut self, target: u32) {
        let (slot, leaf) = (self.placed, self.internal() + self.placed + 1);
        self.placed += 1;
        self.insert(leaf, target, slot);
        self.changes.clear();
        self.keep();
    }

    /// The tree as a device takes it.
    #[must_use]
    pub fn nodes(&self) -> Vec<Node> {
        let internal = self.internal() as usize;
        let node = |branch: &Branch| Node { min: branch.aabb.min, up: NO_NODE, max: branch.aabb.max, down: 0 };
        let mut nodes: Vec<Node> = self.nodes.iter().map(node).collect();
        for v in 0..internal {
            let [left, right] = self.nodes[v].children;
            nodes[v].down = left;
            nodes[left as usize].up = right;
            nodes[right as usize].up = v as u32 | RIGHT;
        }
        for (leaf, &reference) in nodes[internal..].iter_mut().zip(&self.references) {
            leaf.down = reference;
        }
        nodes
    }

    /// Internal nodes, which are those before the leaves.
    pub(super) fn internal(&self) -> u32 {
        self.nodes.len() as u32 / 2
    }

    /// Internal nodes that have a place in the tree, which are the first.
    pub(super) fn placed(&self) -> u32 {
        self.placed
    }

    /// Sum of the half areas of the internal nodes, kept up to date change by change, in f64.
    #[must_use]
    pub fn internal_area(&self) -> f64 {
        self.internal_area
    }

    /// Sum of the half areas of the leaves, which never changes.
    pub(super) fn leaf_area(&self) -> f64 {
        self.leaf_area
    }

    pub(super) fn root_area(&self) -> f64 {
        area(&self.nodes[ROOT as usize].aabb)
    }

    #[inline(always)]
    pub(super) fn node(&self, v: u32) -> &Branch {
        &self.nodes[v as usize]
    }

    #[inline(always)]
    pub(super) fn parent(&self, v: u32) -> u32 {
        self.parents[v as usize]
    }

    /// Other child of the parent of `v`, which is not the root.
    pub(super) fn sibling(&self, v: u32) -> u32 {
        let [left, right] = self.node(self.parent(v)).children;
        if left == v { right } else { left }
    }

    /// Half area of a node's box.
    #[inline(always)]
    pub(super) fn half_area(&self, v: u32) -> f32 {
        self.areas[v as usize]
    }

    /// Takes an internal node that has a grandparent out, and its parent with it; its sibling moves up.
    pub(super) fn remove(&mut self, v: u32) -> Removed {
        let parent = self.parent(v);
        let grandparent = self.parent(parent);
        let sibling = self.sibling(v);
        let children = self.node(v).children;
        self.internal_area -= area(&self.node(v).aabb) + area(&self.node(parent).aabb);
        self.replace_child(grandparent, parent, sibling);
        self.shrink(grandparent);
        Removed { children, slots: [parent, v], sibling }
    }

    /// Makes `slot` the parent of `target` and `node`, in the place of `target`.
    pub(super) fn insert(&mut self, node: u32, target: u32, slot: u32) {
        let aabb = self.node(target).aabb.union(self.node(node).aabb);
        self.internal_area += area(&aabb);
        if target == ROOT {
            // The root keeps its number: the slot becomes what the root was.
            let root = *self.node(ROOT);
            root.children.iter().for_each(|&child| self.set_parent(child, slot));
            self.set_branch(slot, root);
            self.set_parent(slot, ROOT);
            self.set_branch(ROOT, Branch { aabb, children: [slot, node] });
            self.set_parent(node, ROOT);
            return;
        }
        let above = self.parent(target);
        self.replace_child(above, target, slot);
        self.set_branch(slot, Branch { aabb, children: [target, node] });
        self.set_parent(target, slot);
        self.set_parent(node, slot);
        self.grow(above, aabb);
    }

    fn replace_child(&mut self, parent: u32, old: u32, new: u32) {
        let mut branch = *self.node(parent);
        branch.children[usize::from(branch.children[1] == old)] = new;
        self.set_branch(parent, branch);
        self.set_parent(new, parent);
    }

    /// Recomputes boxes from `v` upward until one stays.
    fn shrink(&mut self, mut v: u32) {
        while v != NO_NODE {
            let [left, right] = self.node(v).children;
            let aabb = self.node(left).aabb.union(self.node(right).aabb);
            if !self.set_box(v, aabb) {
                break;
            }
            v = self.parent(v);
        }
    }

    /// Makes the boxes from `v` upward hold `aabb`, until one does.
    fn grow(&mut self, mut v: u32, aabb: Aabb) {
        while v != NO_NODE {
            if !self.set_box(v, self.node(v).aabb.union(aabb)) {
                break;
            }
            v = self.parent(v);
        }
    }

    /// Whether the box is another one than before.
    fn set_box(&mut self, v: u32, aabb: Aabb) -> bool {
        let Branch { aabb: have, children } = *self.node(v);
        if have == aabb {
            return false;
        }
        self.internal_area += area(&aabb) - area(&have);
        self.set_branch(v, Branch { aabb, children });
        true
    }

    fn set_branch(&mut self, v: u32, branch: Branch) {
        let have = std::mem::replace(&mut self.nodes[v as usize], branch);
        self.areas[v as usize] = branch.aabb.half_area();
        self.changes.push(Change::Branch(v, have));
        if have.children != branch.children {
            self.journal.push((v, have.children));
        }
    }

    fn set_parent(&mut self, v: u32, parent: u32) {
        let have = std::mem::replace(&mut self.parents[v as usize], parent);
        self.changes.push(Change::Parent(v, have));
    }

    /// Takes note of the tree as it is, for [`Self::undo`].
    pub(super) fn begin(&mut self) -> Mark {
        self.changes.clear();
        Mark { journal: self.journal.len(), internal_area: self.internal_area }
    }

    /// Takes all changes since `mark`, which is the last one, back.
    pub(super) fn undo(&mut self, mark: Mark) {
        while let Some(change) = self.changes.pop() {
            match change {
                Change::Parent(v, parent) => self.parents[v as usize] = parent,
                Change::Branch(v, branch) => {
                    self.nodes[v as usize] = branch;
                    self.areas[v as usize] = branch.aabb.half_area();
                }
            }
        }
        self.journal.truncate(mark.journal);
        self.internal_area = mark.internal_area;
    }

    /// Takes the tree as it is for the best one so far.
    pub(super) fn keep(&mut self) {
        self.journal.clear();
    }

    /// Goes back to the tree that was kept last; at first the initial one.
    pub(super) fn restore(&mut self) {
        if self.journal.is_empty() {
            return;
        }
        while let Some((v, children)) = self.journal.pop() {
            self.nodes[v as usize].children = children;
        }
        self.refit_all();
    }

    /// Parents, boxes of internal nodes and their areas, all anew from the children.
    fn refit_all(&mut self) {
        let internal = self.internal();
        let mut order = Vec::with_capacity(internal as usize);
        let mut pending = vec![ROOT];
        while let Some(v) = pending.pop() {
            if v < internal {
                order.push(v);
                let children = self.node(v).children;
                children.iter().for_each(|&child| self.parents[child as usize] = v);
                pending.extend(children);
            }
        }
        self.internal_area = 0.0;
        for &v in order.iter().rev() {
            let [left, right] = self.node(v).children;
            let aabb = self.node(left).aabb.union(self.node(right).aabb);
            self.nodes[v as usize].aabb = aabb;
            self.areas[v as usize] = aabb.half_area();
            self.internal_area += area(&aabb);
        }
    }

    /// Bytes in use, spare room included.
    pub(super) fn bytes(&self) -> u64 {
        let bytes = self.nodes.capacity() * size_of::<Branch>()
            + (self.parents.capacity() + self.areas.capacity() + self.references.capacity()) * 4
            + self.changes.capacity() * size_of::<Change>()
            + self.journal.capacity() * size_of::<(u32, [u32; 2])>();
        bytes as u64
    }
}

/// What [`RbvhTree::remove`] took out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Removed {
    /// Subtrees to be inserted again.
    pub(super) children: [u32; 2],
    /// Nodes to be used as new parents: the former parent and the node itself.
    pub(super) slots: [u32; 2],
    /// What the removed node was beside.
    pub(super) sibling: u32,
}

/// Half the surface area in f64.
pub(super) fn area(aabb: &Aabb) -> f64 {
    let [dx, dy, dz] = std::array::from_fn(|k| f64::from(aabb.max[k]) - f64::from(aabb.min[k]));
    dy * (dx + dz) + dz * dx
}
