//! One decision of a plan.

use crate::format;
use std::fmt;

/// Something that a run can do without.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Omission {
    /// Morton codes and their sort.
    Codes,
    /// The lower words of the Morton codes.
    LowerCodes,
    /// Passes of the sort over bits in which no two codes differ.
    EqualBits,
    /// Locks, searches and moves on the device.
    DeviceOptimizer,
    /// The second word of a lock.
    LockWord,
    /// Paths of the reinsertions, which only the conservative strategy needs.
    Paths,
    /// The collapse to adaptive leaves.
    Collapse,
    /// Nodes of four and eight children.
    Wide,
    /// Normals, texture coordinates, materials.
    Attributes,
    /// All but one of triangles with equal boxes, until the tree is optimised.
    Duplicates,
    /// Places at ancestors of a node that is to move.
    Ancestors,
    /// Searches whose moves would be refused: µ chosen by the rate of conflicts.
    Conflicts,
    /// Keys, searches and sums of parts of the tree in which no round searches.
    Untouched,
    /// Other trees over what hangs below the top of the tree.
    Tops,
    /// A second search of all nodes after the worst ones.
    Tail,
    /// Rounds of locks after the first, over the moves of the same search.
    MoreLocks,
    /// Refits of nodes below which nothing moved.
    UnchangedBoxes,
    /// Pieces of triangles as references of their own.
    Presplit,
    /// Kernels that no phase runs.
    Kernels,
}

/// What it is, in words: as in the tables.
impl fmt::Display for Omission {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Codes => "Morton codes and their sort",
            Self::LowerCodes => "lower words of the Morton codes",
            Self::EqualBits => "passes of the sort over bits that are equal",
            Self::DeviceOptimizer => "locks, searches and moves on the device",
            Self::LockWord => "locks of two 32-bit words and their extra dispatch",
            Self::Paths => "paths of the reinsertions, for the conservative strategy",
            Self::Collapse => "collapse to adaptive leaves",
            Self::Wide => "nodes of four and eight children",
            Self::Attributes => "normals, texture coordinates, materials",
            Self::Duplicates => "all but one of triangles with equal boxes",
            Self::Ancestors => "evaluation of ancestors as places to move to",
            Self::Conflicts => "searches whose moves collide: µ from the rate of conflicts",
            Self::Untouched => "keys of nodes that no round comes to",
            Self::Tops => "other trees in place of the top of the tree",
            Self::Tail => "a broad search of all nodes at the end",
            Self::MoreLocks => "further rounds of locks over one search",
            Self::UnchangedBoxes => "refits of nodes below which nothing moved",
            Self::Presplit => "splits of triangles before the build",
            Self::Kernels => "kernels that no phase runs",
        })
    }
}

/// What became of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Status {
    /// The run does without.
    LeftOut,
    /// The run needs it.
    Needed,
    /// The scene has none of it.
    NoneThere,
    /// The run could do without, but that is not done.
    NotDone,
}

/// As in the tables.
impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::LeftOut => "left out",
            Self::Needed => "needed",
            Self::NoneThere => "none there",
            Self::NotDone => "not done",
        })
    }
}

/// What leaving it out saves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Saving {
    /// Device memory at the peak of the phase, bytes.
    pub bytes: u64,
    /// Dispatches of the run, at least.
    pub dispatches: u64,
    /// Dispatches of each iteration.
    pub dispatches_per_iteration: u64,
    /// Kernels that are not compiled, on a device that compiles them when they are first run; [`Omission::Kernels`] has them all.
    pub kernels: usize,
    /// Bytes of their SPIR-V modules.
    pub spirv_bytes: u64,
    /// Memory of the host, bytes.
    pub host_bytes: u64,
}

/// One decision: what is left out or not, why, and what that saves.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Item {
    /// What the decision is about.
    pub omission: Omission,
    /// What was decided.
    pub status: Status,
    /// What it is, in words.
    pub what: String,
    /// Why.
    pub why: String,
    /// What is saved; nothing unless it is left out.
    pub saved: Saving,
}

/// Empty if nothing is saved.
impl fmt::Display for Saving {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        if self.bytes > 0 {
            parts.push(format::bytes(self.bytes));
        }
        let dispatches =
            |count: u64| format!("{} dispatch{}", format::count(count), if count == 1 { "" } else { "es" });
        if self.dispatches > 0 {
            parts.push(dispatches(self.dispatches));
        }
        if self.dispatches_per_iteration > 0 {
            parts.push(format!("{} an iteration", dispatches(self.dispatches_per_iteration)));
        }
        if self.kernels > 0 {
            let kernels = format::count(self.kernels as u64);
            let plural = if self.kernels == 1 { "" } else { "s" };
            parts.push(format!("{kernels} kernel{plural} of {} SPIR-V", format::bytes(self.spirv_bytes)));
        }
        if self.host_bytes > 0 {
            parts.push(format!("{} on the host", format::bytes(self.host_bytes)));
        }
        f.write_str(&parts.join(", "))
    }
}

/// `what: why (what is saved)`.
impl fmt::Display for Item {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.what, self.why)?;
        match self.saved.to_string() {
            saved if saved.is_empty() => Ok(()),
            saved => write!(f, " ({saved})"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_item_says_what_it_saves() {
        let mut item = Item {
            omission: Omission::LockWord,
            status: Status::LeftOut,
            what: "a word".to_owned(),
            why: "there is a longer one".to_owned(),
            saved: Saving::default(),
        };
        assert_eq!(item.to_string(), "a word: there is a longer one");
        item.saved.dispatches_per_iteration = 1;
        assert_eq!(item.to_string(), "a word: there is a longer one (1 dispatch an iteration)");
        item.saved = Saving { bytes: 2048, dispatches: 12, ..Saving::default() };
        assert_eq!(item.to_string(), format!("a word: there is a longer one ({}, 12 dispatches)", format::bytes(2048)));
        item.saved = Saving { kernels: 1, spirv_bytes: 10, host_bytes: 20, ..Saving::default() };
        let [spirv, host] = [10, 20].map(format::bytes);
        assert_eq!(item.saved.to_string(), format!("1 kernel of {spirv} SPIR-V, {host} on the host"));
    }
}
