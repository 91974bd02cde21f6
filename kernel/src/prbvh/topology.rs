//! The nodes whose links a move reads or writes: the one definition for lock, check and reinsert.

use super::{Move, dual::DualMove};
use crate::node::{Links, NO_NODE, ROOT};

/// The nodes of a move. Some may be the same; unused places hold [`NO_NODE`].
///
/// Of a single move (§4.3.1): input, sibling, parent, grandparent (if the parent is the root: the children of the sibling instead), output, output's
/// parent. Of a dual one: input, its parent, sibling, grandparent and children, both outputs and their parents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MoveNodes([u32; 10]);

impl MoveNodes {
    /// The nodes of `found`, in a tree with `internal` internal nodes.
    #[inline(always)]
    #[must_use]
    pub fn of<T: Links + ?Sized>(tree: &T, internal: u32, found: &Move, is_dual: bool) -> Self {
        if is_dual { Self::of_dual(tree, &DualMove::new(tree, found)) } else { Self::of_single(tree, internal, found) }
    }

    #[inline(always)]
    fn of_single<T: Links + ?Sized>(tree: &T, internal: u32, found: &Move) -> Self {
        let (input, output) = (found.input(), found.output);
        let parent = tree.parent(input);
        let sibling = tree.sibling(input);
        let mut above = NO_NODE;
        let mut other = NO_NODE;
        if parent != ROOT {
            above = tree.parent(parent);
        } else if sibling < internal {
            above = tree.down(sibling);
            other = tree.up(above);
        }
        Self([input, sibling, parent, above, other, output, tree.parent(output), NO_NODE, NO_NODE, NO_NODE])
    }

    #[inline(always)]
    fn of_dual<T: Links + ?Sized>(tree: &T, dual: &DualMove) -> Self {
        let parent = tree.parent(dual.input);
        Self([
            dual.input,
            parent,
            tree.sibling(dual.input),
            tree.parent(parent),
            dual.first,
            dual.second,
            dual.first_output,
            tree.parent(dual.first_output),
            dual.second_output,
            tree.parent(dual.second_output),
        ])
    }

    /// Whether `holds` is true of every node; asks all of them.
    #[inline(always)]
    pub fn all(self, holds: impl Fn(usize) -> bool) -> bool {
        let mut all = true;
        // Not an iterator over the array: rust-gpu cannot compile one.
        for k in 0..10 {
            let v = self.0[k];
            if v != NO_NODE {
                all &= holds(v as usize);
            }
        }
        all
    }

    /// Calls `visit` with every node.
    #[inline(always)]
    pub fn for_each(self, visit: impl Fn(usize)) {
        self.all(|v| {
            visit(v);
            true
        });
    }
}
