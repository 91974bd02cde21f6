//! Top-down building on the CPU, whatever splits the references.

use crate::scene::SafeRange;
use crate::stop::Stop;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::node::{NO_NODE, Node, RIGHT};
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;
use std::borrow::Cow;

/// References that become a subtree.
pub(super) trait Part: Send + Sized {
    /// References, at least one.
    fn len(&self) -> usize;
    /// The first reference.
    fn first(&self) -> u32;
    /// Splits at least two references into two parts, neither of which is empty.
    fn split(self) -> (Self, Self);
}

/// Below so many references a subtree is grown by one thread.
pub(super) const SERIAL: usize = 4096;

/// Deepest node below which two threads may go different ways: a tree may be as deep as it has references, the call stack not.
const MOST_FORKS: u32 = 48;

/// The triangles as they are split: scaled where areas could not be relied on otherwise.
pub(crate) fn in_range(triangles: &[Triangle]) -> Cow<'_, [Triangle]> {
    let all = triangles.par_iter().map(Triangle::aabb).reduce(|| Aabb::EMPTY, Aabb::union);
    match SafeRange::check(&all) {
        Ok(()) => Cow::Borrowed(triangles),
        Err(_) => Cow::Owned(SafeRange::of(triangles).apply(triangles)),
    }
}

/// Splits `part` until each leaf holds one triangle. Nodes are numbered depth-first, parents before their children, so that the result
/// does not depend on the threads. None if an end was asked for.
pub(super) fn top_down(part: impl Part, triangles: &[Triangle], stop: Option<&Stop>) -> Option<Vec<Node>> {
    let n = part.len();
    let mut nodes = vec![Node { min: [0.0; 3], up: NO_NODE, max: [0.0; 3], down: 0 }; 2 * n - 1];
    let (internal, leaves) = nodes.split_at_mut(n - 1);
    let root = Subtree { part, internal, internal_id: 0, leaves, leaf_id: n as u32 - 1, up: NO_NODE };
    let is_asked = || stop.is_some_and(Stop::is_asked);
    grow(root, MOST_FORKS, triangles, &is_asked);
    if is_asked() { None } else { Some(nodes) }
}

/// Computes the boxes of a subtree whose internal nodes are numbered from `first` on, parents first, and its leaves from `first_leaf` on. Returns
/// that of its root.
pub(super) fn fill_boxes(
    (internal, first): (&mut [Node], u32),
    (leaves, first_leaf): (&mut [Node], u32),
    all: &[Triangle],
) -> Aabb {
    for leaf in &mut *leaves {
        let aabb = all[leaf.down as usize].aabb();
        (leaf.min, leaf.max) = (aabb.min, aabb.max);
    }
    let mut aabb = leaves[0].aabb();
    for k in (0..internal.len()).rev() {
        let node =
            |v: u32| if v < first_leaf { internal[(v - first) as usize] } else { leaves[(v - first_leaf) as usize] };
        let left = node(internal[k].down);
        let right = node(left.up);
        aabb = left.aabb().union(right.aabb());
        (internal[k].min, internal[k].max) = (aabb.min, aabb.max);
    }
    aabb
}

/// A part and the nodes that it will fill: one internal node fewer than leaves.
struct Subtree<'a, P> {
    part: P,
    internal: &'a mut [Node],
    internal_id: u32,
    leaves: &'a mut [Node],
    leaf_id: u32,
    /// [`Node::up`] of its root.
    up: u32,
}

impl<'a, P: Part> Subtree<'a, P> {
    /// Fills the links of the root. Returns it, and what hangs below it; none if it is a leaf.
    fn plant(self) -> Option<(&'a mut Node, [Self; 2])> {
        let Some((root, internal)) = self.internal.split_first_mut() else {
            self.leaves[0].up = self.up;
            self.leaves[0].down = self.part.first();
            return None;
        };
        let (left, right) = self.part.split();
        let count = left.len();
        let internal_ids = [self.internal_id + 1, self.internal_id + count as u32];
        let leaf_ids = [self.leaf_id, self.leaf_id + count as u32];
        let left_root = if left.len() == 1 { leaf_ids[0] } else { internal_ids[0] };
        let right_root = if right.len() == 1 { leaf_ids[1] } else { internal_ids[1] };
        root.up = self.up;
        root.down = left_root;
        let internal = internal.split_at_mut(count - 1);
        let leaves = self.leaves.split_at_mut(count);
        let left = Self {
            part: left,
            internal: internal.0,
            internal_id: internal_ids[0],
            leaves: leaves.0,
            leaf_id: leaf_ids[0],
            up: right_root,
        };
        let right = Self {
            part: right,
            internal: internal.1,
            internal_id: internal_ids[1],
            leaves: leaves.1,
            leaf_id: leaf_ids[1],
            up: self.internal_id | RIGHT,
        };
        Some((root, [left, right]))
    }
}

/// Fills a subtree; returns the box of its root. Nothing is said of it if an end was asked for.
fn grow<P: Part>(
    subtree: Subtree<'_, P>,
    forks: u32,
    triangles: &[Triangle],
    is_asked: &(impl Fn() -> bool + Sync),
) -> Aabb {
    if is_asked() {
        return Aabb::EMPTY;
    }
    if forks > 0 && subtree.leaves.len() >= SERIAL {
        let (root, [left, right]) = subtree.plant().expect("several references are no leaf");
        let grow = |subtree| grow(subtree, forks - 1, triangles, is_asked);
        let (left, right) = rayon::join(|| grow(left), || grow(right));
        let aabb = left.union(right);
        (root.min, root.max) = (aabb.min, aabb.max);
        return aabb;
    }
    let Subtree { part, internal, internal_id, leaves, leaf_id, up } = subtree;
    let mut pending = vec![Subtree { part, internal: &mut *internal, internal_id, leaves: &mut *leaves, leaf_id, up }];
    while let Some(subtree) = pending.pop() {
        if let Some((_, [left, right])) = subtree.plant() {
            pending.extend([right, left]);
        }
    }
    fill_boxes((internal, internal_id), (leaves, leaf_id), triangles)
}

/// A split under consideration.
#[derive(Clone, Copy, Debug)]
pub(super) struct Split {
    /// `area(left) · references(left) + area(right) · references(right)` with half areas, scene units².
    pub(super) cost: f64,
    /// References on the left.
    pub(super) left: usize,
}

impl Split {
    /// A split in the middle that every other one beats.
    pub(super) fn worst(references: usize) -> Self {
        Self { cost: f64::INFINITY, left: references / 2 }
    }

    pub(super) fn new(left_area: f32, right_area: f32, left: usize, references: usize) -> Self {
        let right = references - left;
        Self { cost: f64::from(left_area) * left as f64 + f64::from(right_area) * right as f64, left }
    }

    /// Whether it is the better one of two over as many references. Of equally good ones the one closer to the middle is, so that equal
    /// boxes make a balanced tree.
    pub(super) fn beats(&self, other: &Self, references: usize) -> bool {
        let off_middle = |split: &Self| (2 * split.left).abs_diff(references);
        self.cost < other.cost || (self.cost == other.cost && off_middle(self) < off_middle(other))
    }
}

/// Moves the items for which `is_left` holds to the front, keeping the order among them and among the others. `spare` is as long as `items`.
/// Returns how many they are.
pub(super) fn stable_partition<T: Copy>(items: &mut [T], spare: &mut [T], is_left: impl Fn(&T) -> bool) -> usize {
    let (mut left, mut right) = (0, 0);
    for k in 0..items.len() {
        let item = items[k];
        if is_left(&item) {
            items[left] = item;
            left += 1;
        } else {
            spare[right] = item;
            right += 1;
        }
    }
    items[left..].copy_from_slice(&spare[..right]);
    left
}
