//! Rounds of the worst-first order, seen from outside: what a device holds at the end of each, and what must be true of it.

use crate::oracle::{NaiveTree, half_area};
use crate::planted::Planted;
use prbvh::device::{Buffer, Device, DeviceError, Dispatch};
use prbvh_kernel::Kernel;
use prbvh_kernel::node::Node;
use prbvh_kernel::prbvh::worst::RoundParams;
use prbvh_kernel::prbvh::worst::books::{CLOSE, FRINGE_LENGTH, FRINGE_SIDE, POOL_LENGTH, POOL_SIDE, STAGE};
use prbvh_kernel::prbvh::worst::keys::{COLD, IN_POOL, ON_FRINGE, measure, measure_of, waits};
use prbvh_kernel::prbvh::{LAST, PrbvhParams};
use prbvh_kernel::status::{FAULTS, GREW, MARKED, REFITTED, REPORT_WORDS, SHRUNK};
use prbvh_kernel::sum::to_f64;
use std::collections::BTreeSet;

/// Buffers after a round, or after an unfolding.
#[derive(Clone, Debug)]
pub struct Round {
    /// The tree.
    pub nodes: Vec<Node>,
    /// Keys of the internal nodes.
    pub keys: Vec<u32>,
    /// Both sides of the pool.
    pub pool: Vec<u32>,
    /// Both sides of the fringe.
    pub fringe: Vec<u32>,
    /// The books.
    pub books: Vec<u32>,
    /// The row of the report.
    pub report: Vec<u32>,
    /// Whether all locks are free.
    pub is_free: bool,
    /// Units of a sum in an area.
    pub scale: f32,
}

impl Round {
    /// The side of a list of two sides that is filled.
    fn side(&self, list: &[u32], side: usize, length: usize) -> Result<Vec<u32>, String> {
        let places = self.nodes.len() / 2;
        let side = self.books[side] as usize;
        let length = self.books[length + side] as usize;
        if length > places {
            return Err(format!("{length} nodes in {places} places"));
        }
        Ok(list[side * places..][..length].to_vec())
    }

    /// Nodes in the pool.
    ///
    /// # Errors
    /// If there are more than have a place.
    pub fn in_pool(&self) -> Result<Vec<u32>, String> {
        self.side(&self.pool, POOL_SIDE, POOL_LENGTH)
    }

    /// Nodes on the fringe.
    ///
    /// # Errors
    /// As [`Round::in_pool`].
    pub fn on_fringe(&self) -> Result<Vec<u32>, String> {
        self.side(&self.fringe, FRINGE_SIDE, FRINGE_LENGTH)
    }

    /// What is wrong with keys, pool and fringe: each key is that of its node, who waits is in the pool, once, and nobody is forgotten.
    ///
    /// # Errors
    /// The first fault.
    pub fn check_lists(&self, tree: &NaiveTree) -> Result<(), String> {
        let pool = self.in_pool()?;
        let pooled: BTreeSet<u32> = pool.iter().copied().collect();
        if pooled.len() != pool.len() {
            return Err("a node is in the pool twice".to_owned());
        }
        let fringe: BTreeSet<u32> = self.on_fringe()?.into_iter().collect();
        let mut pending = if tree.children[0].is_empty() { vec![] } else { vec![(0u32, false)] };
        while let Some((v, is_below)) = pending.pop() {
            let key = self.keys[v as usize];
            let is_below = is_below || fringe.contains(&v);
            let is_unseen = key == COLD || key == ON_FRINGE;
            if is_unseen && !is_below {
                return Err(format!("{v} is forgotten"));
            }
            if key == ON_FRINGE && !fringe.contains(&v) {
                return Err(format!("{v} is not on the fringe"));
            }
            if (key & IN_POOL != 0) != pooled.contains(&v) {
                return Err(format!("{v} has the key {key:#x} and is in the pool, or is not"));
            }
            if v != 0 && !is_unseen {
                if waits(key) && key & IN_POOL == 0 {
                    return Err(format!("{v} waits outside of the pool"));
                }
                let [own, left, right] = [v, tree.children[v as usize][0], tree.children[v as usize][1]]
                    .map(|v| tree.boxes[v as usize].half_area());
                if measure_of(key) != measure_of(measure(own, left, right)) {
                    return Err(format!("the key of {v} is {key:#x}, its measure {:#x}", measure(own, left, right)));
                }
            }
            let internal = |child: &u32| !tree.children[*child as usize].is_empty();
            pending.extend(tree.children[v as usize].iter().copied().filter(internal).map(|child| (child, is_below)));
        }
        Ok(())
    }

    /// What is wrong after a round that began with `before`.
    ///
    /// # Errors
    /// The first fault.
    pub fn check(&self, before: &NaiveTree) -> Result<NaiveTree, String> {
        if self.report[FAULTS] != 0 || self.report[MARKED] != self.report[REFITTED] {
            return Err(format!(
                "{} faults, {} of {} refitted",
                self.report[FAULTS], self.report[REFITTED], self.report[MARKED]
            ));
        }
        if !self.is_free {
            return Err("a node is locked".to_owned());
        }
        let tree = NaiveTree::decode(&self.nodes);
        let mut fresh = tree.clone();
        fresh.refit(0);
        if let Some(v) = (0..fresh.boxes.len()).find(|&v| fresh.boxes[v] != tree.boxes[v]) {
            return Err(format!("the box of {v} is stale"));
        }
        self.check_lists(&tree)?;
        let sum = |at: usize| to_f64(self.report[at], self.report[at + 1], self.scale);
        let (said, lost) = (sum(SHRUNK) - sum(GREW), before.internal_area() - tree.internal_area());
        let rounding = 1e-6 * half_area(&before.boxes[0]) * f64::from(self.report[REFITTED]);
        if (said - lost).abs() > rounding {
            return Err(format!("the areas lose {lost}, not {said}"));
        }
        Ok(tree)
    }

    /// How often the root's area was divided by four.
    #[must_use]
    pub fn stage(&self) -> u32 {
        self.books[STAGE]
    }
}

/// A device that shows every round.
pub fn watched(
    device: Box<dyn Device>,
    mut see: impl FnMut(&Round),
) -> Planted<impl FnMut(&Dispatch, &mut dyn Device) -> Result<(), DeviceError>> {
    let mut is_free = false;
    let mut refit: Option<Dispatch> = None;
    Planted::new(device, move |dispatch, device| {
        let words = |device: &mut dyn Device, buffer: &Buffer| -> Result<Vec<u32>, DeviceError> {
            let mut words = vec![0; buffer.bytes() as usize / 4];
            device.download(buffer, bytemuck::cast_slice_mut(&mut words))?;
            Ok(words)
        };
        let locks = match dispatch.kernel {
            Kernel::PrbvhCheck => &dispatch.buffers[1..2],
            Kernel::PrbvhCheckWords => &dispatch.buffers[1..3],
            _ => &[],
        };
        if !locks.is_empty() {
            let params: PrbvhParams = bytemuck::pod_read_unaligned(&dispatch.push);
            is_free = params.has(LAST);
            for buffer in locks {
                is_free &= words(device, buffer)?.iter().all(|&word| word == 0);
            }
        }
        if dispatch.kernel == Kernel::WorstRefit {
            refit = Some(dispatch.clone());
        }
        // A small round ends with its tail, a large one with a page of the books.
        let ends = if dispatch.kernel == Kernel::WorstTail {
            let [_, nodes, locks, _, _, keys, fringe, pool, books, report] = &dispatch.buffers[..] else {
                panic!("{dispatch:?}")
            };
            is_free = words(device, locks)?.iter().all(|&word| word == 0);
            Some([nodes, keys, fringe, pool, books, report].map(Buffer::clone))
        } else if dispatch.kernel == Kernel::WorstBooks
            && bytemuck::pod_read_unaligned::<RoundParams>(&dispatch.push).page == CLOSE
            // What unfolds before the first round moves nothing.
            && let Some(refit) = refit.take()
        {
            let [_, nodes, _, keys, pool, books, report] = &refit.buffers[..] else { panic!("{refit:?}") };
            Some([nodes, keys, &dispatch.buffers[1], pool, books, report].map(Buffer::clone))
        } else {
            None
        };
        if let Some([nodes, keys, fringe, pool, books, report]) = &ends {
            let params: RoundParams = bytemuck::pod_read_unaligned(&dispatch.push);
            let mut tree: Vec<Node> = vec![bytemuck::Zeroable::zeroed(); nodes.length];
            device.download(nodes, bytemuck::cast_slice_mut(&mut tree))?;
            see(&Round {
                nodes: tree,
                keys: words(device, keys)?,
                pool: words(device, pool)?,
                fringe: words(device, fringe)?,
                books: words(device, books)?,
                report: words(device, report)?[params.row as usize..][..REPORT_WORDS as usize].to_vec(),
                is_free,
                scale: params.scale,
            });
        }
        Ok(())
    })
}
