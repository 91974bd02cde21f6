//! Kernels of workgroups: phases between barriers.
//!
//! A workgroup is [`WORKGROUP_SIZE`](crate::grid::WORKGROUP_SIZE) invocations that share some memory (`&[SharedU32; N]`). Its kernel is written for all of them at once, as a
//! sequence of phases:
//!
//! ```text
//! w.phase(|lane| …)      every invocation does this, in any order or at once
//! w.phase(|lane| …)      … and now sees what all of them stored in the phase before
//! ```
//!
//! What stands between the phases is the same for the whole group: it sees push constants, buffers and the number of the group, but no lane. So all
//! invocations come to the same barriers by construction. Nothing but memory lives from one phase to the next.
//!
//! A barrier is about shared memory; after a [wide phase](Workgroup::wide_phase) it is about the atomics of buffers, too.
//!
//! In one phase no lane reads a word of shared memory that another one stores; several may add to a word or set its bits. A buffer's element stays with one lane in the whole
//! kernel, as [`crate::mem`] has it, unless it is an atomic.
//!
//! On the GPU a phase is a barrier after the code of one lane. The CPU has two ways: [`crate::native::Alone`] is a group of one lane, which does the work of all in order and has
//! nobody to wait for; [`crate::native::Lanes`] runs all lanes of a phase, in an order that is asked for, before the next phase begins. A kernel gives the same bits with any number of lanes, so what
//! depends on an order (a float sum) has a shape of its own.

use crate::math::umin;
use crate::mem::SharedU32;

/// A workgroup in the middle of its kernel.
pub trait Workgroup {
    /// Invocations; one of a phase is a lane, numbered from 0.
    const LANES: u32;

    /// Number of the group in the dispatch.
    fn group(&self) -> u32;

    /// Runs a phase: `lane(k)` for every lane `k`. All of it is done before the next phase.
    fn phase(&self, lane: impl Fn(u32));

    /// A [phase](Workgroup::phase) after which all lanes see what it did to buffers by atomics, too.
    #[inline(always)]
    fn wide_phase(&self, lane: impl Fn(u32)) {
        self.phase(lane);
    }

    /// Runs a [wide phase](Workgroup::wide_phase) over `count` items, of which a lane has the same in each.
    #[inline(always)]
    fn wide_each(&self, count: u32, item: impl Fn(u32)) {
        self.wide_phase(move |lane| {
            let mut k = lane;
            while k < count {
                item(k);
                k += Self::LANES;
            }
        });
    }

    /// Runs a phase over `count` items, which the lanes take in turn.
    #[inline(always)]
    fn each(&self, count: u32, item: impl Fn(u32)) {
        self.phase(move |lane| {
            let mut k = lane;
            while k < count {
                item(k);
                k += Self::LANES;
            }
        });
    }
}

/// Lanes whose sums one lane of a [`scan`] adds up.
const BLOCK: u32 = 8;
/// Blocks of the largest group.
const BLOCKS: u32 = crate::grid::WORKGROUP_SIZE / BLOCK;
/// Words of shared memory that a [`scan`] needs: a sum and what is before it in its block for each lane, and the sums of the blocks.
pub const SCAN_WORDS: u32 = 2 * crate::grid::WORKGROUP_SIZE + BLOCKS;

/// Exclusive prefix sums (wrapping) of `count` values, in three phases. Each lane has a run of consecutive values: it adds them up by `value(k)`, and comes by
/// again with the sum of all values before `k` by `place(k, before)`, which returns the value once more. [`total`] is there when it is over.
///
/// `shared` lends [`SCAN_WORDS`] words from `at` on.
#[inline(always)]
pub fn scan<W: Workgroup, const N: usize>(
    w: &W,
    shared: &[SharedU32; N],
    at: u32,
    count: u32,
    value: impl Fn(u32) -> u32,
    place: impl Fn(u32, u32) -> u32,
) {
    let run = count.div_ceil(W::LANES);
    let (in_block, blocks) = (at + W::LANES, at + 2 * W::LANES);
    w.phase(move |lane| {
        let end = umin((lane + 1) * run, count);
        let mut sum = 0u32;
        let mut k = lane * run;
        while k < end {
            sum = sum.wrapping_add(value(k));
            k += 1;
        }
        shared[(at + lane) as usize].store(sum);
    });
    w.phase(move |lane| {
        let block = lane / BLOCK;
        let mut before = 0u32;
        for k in block * BLOCK..lane {
            before = before.wrapping_add(shared[(at + k) as usize].load());
        }
        shared[(in_block + lane) as usize].store(before);
        if lane % BLOCK == BLOCK - 1 || lane == W::LANES - 1 {
            shared[(blocks + block) as usize].store(before.wrapping_add(shared[(at + lane) as usize].load()));
        }
    });
    w.phase(move |lane| {
        let mut before = shared[(in_block + lane) as usize].load();
        for block in 0..lane / BLOCK {
            before = before.wrapping_add(shared[(blocks + block) as usize].load());
        }
        let end = umin((lane + 1) * run, count);
        let mut k = lane * run;
        while k < end {
            before = before.wrapping_add(place(k, before));
            k += 1;
        }
    });
}

/// The sum of all values of the last [`scan`] there; a lane may ask for it in a phase.
#[inline(always)]
pub fn total<W: Workgroup, const N: usize>(shared: &[SharedU32; N], at: u32) -> u32 {
    let mut sum = 0u32;
    for block in 0..W::LANES.div_ceil(BLOCK) {
        sum = sum.wrapping_add(shared[(at + 2 * W::LANES + block) as usize].load());
    }
    sum
}

/// `Scope::Workgroup`.
#[cfg(target_arch = "spirv")]
const SCOPE: u32 = 2;
/// `ACQUIRE_RELEASE | UNIFORM_MEMORY | WORKGROUP_MEMORY | MAKE_AVAILABLE | MAKE_VISIBLE`.
#[cfg(target_arch = "spirv")]
const ALL_MEMORY: u32 = 0x6148;

/// A workgroup on the GPU.
#[cfg(target_arch = "spirv")]
pub struct OnDevice {
    /// Number of the group.
    pub group: u32,
    /// The lane that this invocation is.
    pub lane: u32,
}

#[cfg(target_arch = "spirv")]
impl Workgroup for OnDevice {
    const LANES: u32 = crate::grid::WORKGROUP_SIZE;

    #[inline(always)]
    fn group(&self) -> u32 {
        self.group
    }

    #[inline(always)]
    fn phase(&self, lane: impl Fn(u32)) {
        lane(self.lane);
        spirv_std::arch::workgroup_memory_barrier_with_group_sync();
    }

    #[inline(always)]
    fn wide_phase(&self, lane: impl Fn(u32)) {
        lane(self.lane);
        spirv_std::arch::control_barrier::<SCOPE, SCOPE, ALL_MEMORY>();
    }
}
