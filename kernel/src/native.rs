//! What the host and the CPU device need to know of a kernel, and how native entries get their views of memory.

use crate::grid::WORKGROUP_SIZE;
use crate::kept::{AtomicKept, Kept};
use crate::mem::{self, AtomicU32, AtomicU64, SharedU32, Slot};
use crate::node::{AtomicNode, Node};
use crate::workgroup::Workgroup;
use bytemuck::Pod;
use core::cell::Cell;

/// What a kernel does to a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Only reads it.
    Read,
    /// Writes it, and may read it.
    Write,
}

/// A parameter of a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BindingInfo {
    /// Name of the parameter.
    pub name: &'static str,
    /// What the kernel does to the buffer.
    pub access: Access,
    /// Bytes of an element.
    pub element_bytes: usize,
}

/// A kernel as the host sees it. Bindings are numbered from 0 in set 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KernelInfo {
    /// Name of the SPIR-V entry point.
    pub name: &'static str,
    /// Bytes of its push constants, whose first word is the number of invocations.
    pub push_bytes: usize,
    /// Its buffers.
    pub bindings: &'static [BindingInfo],
    /// Bytes of memory that a workgroup shares; 0 where invocations know nothing of their workgroup.
    pub shared_bytes: usize,
}

/// Memory handed to a native entry.
#[derive(Debug)]
pub enum Bytes<'a> {
    /// For a parameter that is only read.
    Read(&'a [u8]),
    /// For a parameter that is written.
    Write(&'a mut [u8]),
}

/// Runs the invocations of a dispatch in some order.
pub trait Dispatcher: Sync {
    /// Calls `invocation` once for each number below `count`, of which `grain` are worth a thread.
    fn for_each(&self, count: u32, grain: u32, invocation: impl Fn(u32) + Sync + Send);

    /// Whether one lane does the work of a whole workgroup, as [`Alone`].
    fn is_alone(&self) -> bool;

    /// Calls `lane` once for each number below `count`, on this thread. `turn` tells the phases of a dispatch apart.
    fn for_each_lane(&self, count: u32, turn: u64, lane: impl Fn(u32));
}

/// A workgroup of one lane: nobody to wait for.
#[derive(Debug)]
pub struct Alone {
    /// Number of the group.
    pub group: u32,
}

impl Alone {
    /// Shared memory of a group that begins.
    #[must_use]
    pub const fn memory<const N: usize>(&self) -> [SharedU32; N] {
        [const { SharedU32::new(0xa5a5_a5a5) }; N]
    }
}

impl Workgroup for Alone {
    const LANES: u32 = 1;

    #[inline(always)]
    fn group(&self) -> u32 {
        self.group
    }

    #[inline(always)]
    fn phase(&self, lane: impl Fn(u32)) {
        lane(0);
    }
}

/// A workgroup with all its lanes, which run on one thread, phase by phase, in an order of the dispatcher.
#[derive(Debug)]
pub struct Lanes<'a, D> {
    dispatcher: &'a D,
    group: u32,
    phases: Cell<u32>,
}

impl<'a, D> Lanes<'a, D> {
    /// A group that begins.
    #[must_use]
    pub const fn new(dispatcher: &'a D, group: u32) -> Self {
        Self { dispatcher, group, phases: Cell::new(0) }
    }

    /// Shared memory of a group that begins: other words than those of [`Alone`], since nobody may rely on them.
    #[must_use]
    pub const fn memory<const N: usize>(&self) -> [SharedU32; N] {
        [const { SharedU32::new(0xdead_beef) }; N]
    }
}

impl<D: Dispatcher> Workgroup for Lanes<'_, D> {
    const LANES: u32 = WORKGROUP_SIZE;

    fn group(&self) -> u32 {
        self.group
    }

    fn phase(&self, lane: impl Fn(u32)) {
        let phase = self.phases.get();
        self.phases.set(phase + 1);
        let turn = u64::from(self.group) << 32 | u64::from(phase);
        self.dispatcher.for_each_lane(WORKGROUP_SIZE, turn, lane);
    }
}

/// A parameter type of an entry.
pub trait View<'a> {
    /// What it allows.
    const ACCESS: Access;
    /// Bytes of an element.
    const ELEMENT_BYTES: usize;

    /// The view of a piece of memory.
    ///
    /// # Panics
    /// If the memory is of the other access, misaligned or no whole number of elements: a mistake of the caller.
    fn bind(bytes: Bytes<'a>) -> Self;
}

fn readable<T: Pod>(bytes: Bytes<'_>) -> &[T] {
    match bytes {
        Bytes::Read(bytes) => bytemuck::cast_slice(bytes),
        Bytes::Write(_) => panic!("a buffer bound for writing is only read"),
    }
}

fn writable<T: Pod>(bytes: Bytes<'_>) -> &mut [T] {
    match bytes {
        Bytes::Read(_) => panic!("a buffer bound for reading is written"),
        Bytes::Write(bytes) => bytemuck::cast_slice_mut(bytes),
    }
}

impl<'a, T: Pod> View<'a> for &'a [T] {
    const ACCESS: Access = Access::Read;
    const ELEMENT_BYTES: usize = size_of::<T>();
    fn bind(bytes: Bytes<'a>) -> Self {
        readable(bytes)
    }
}

macro_rules! writable_view {
    ($view:ty, $element:ty, $from:path $(, $generic:ident)?) => {
        impl<'a $(, $generic: Pod)?> View<'a> for &'a [$view] {
            const ACCESS: Access = Access::Write;
            const ELEMENT_BYTES: usize = size_of::<$element>();
            fn bind(bytes: Bytes<'a>) -> Self {
                $from(writable::<$element>(bytes))
            }
        }
    };
}

writable_view!(Slot<T>, T, Slot::from_mut_slice, T);
writable_view!(AtomicU32, u32, AtomicU32::from_mut_slice);
writable_view!(AtomicU64, u64, AtomicU64::from_mut_slice);
writable_view!(AtomicNode, Node, mem::AtomicWords::from_mut_slice);
writable_view!(AtomicKept, Kept, mem::AtomicWords::from_mut_slice);
