//! Runs the kernels of prbvh natively, in any order and on any number of threads.
//!
//! [`CpuSim`] holds buffers and runs one dispatch at a time, calling the same entries that rust-gpu compiles for Vulkan. Every
//! [`Order`] must give the same bytes: that is how races are found. [`Order::Parallel`] is the production CPU device.
#![forbid(unsafe_code)]

mod arena;
mod dispatch;
#[cfg(test)]
mod workgroup_tests;

pub use arena::{AllocationRefused, BufferId, OWN_PAGES, Pages};
pub use dispatch::Order;

use arena::Arena;
use dispatch::Executor;
use prbvh_kernel::native::Bytes;
use prbvh_kernel::{Access, Kernel};
use rayon::prelude::*;
use std::cell::{Ref, RefMut};
use std::sync::Arc;

/// Bytes that a thread clears before it looks for company.
const CLEARED_AT_ONCE: usize = 1 << 18;

/// A CPU that runs kernels.
#[derive(Debug)]
pub struct CpuSim {
    arena: Arena,
    executor: Arc<Executor>,
}

/// The threads could not be started.
#[derive(Debug, thiserror::Error)]
#[error("cannot start {threads} threads")]
pub struct ThreadsRefused {
    /// How many were asked for; 0 stands for one per core.
    pub threads: usize,
    /// Why.
    #[source]
    pub source: rayon::ThreadPoolBuildError,
}

impl CpuSim {
    /// A CPU without buffers. `threads` matters for [`Order::Parallel`] only; 0 means one per core.
    ///
    /// # Errors
    /// If the system refuses the threads.
    pub fn new(order: Order, threads: usize) -> Result<Self, ThreadsRefused> {
        let executor = Executor::new(order, threads).map_err(|source| ThreadsRefused { threads, source })?;
        Ok(Self { arena: Arena::default(), executor: Arc::new(executor) })
    }

    /// A CPU without buffers that runs [`Order::Parallel`] on the threads of a pool.
    #[must_use]
    pub fn in_pool(pool: Arc<rayon::ThreadPool>) -> Self {
        Self { arena: Arena::default(), executor: Arc::new(Executor::in_pool(pool)) }
    }

    /// A CPU without buffers that runs [`Order::Parallel`] on the threads of whatever pool it is asked from.
    #[must_use]
    pub fn in_this_pool() -> Self {
        Self { arena: Arena::default(), executor: Arc::new(Executor::in_this_pool()) }
    }

    /// Threads that dispatches use.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.executor.threads()
    }

    /// Runs work that uses rayon with the threads of the dispatches; with those of the current pool, if dispatches run on one.
    pub fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        self.executor.install(work)
    }

    /// Runs work that dispatches on a thread of the dispatches, so that none of them is handed over from outside.
    pub fn within<T: Send>(&mut self, work: impl FnOnce(&mut Self) -> T + Send) -> T {
        let executor = Arc::clone(&self.executor);
        executor.install(|| work(self))
    }

    /// A zeroed buffer.
    ///
    /// # Errors
    /// If the system refuses the memory.
    pub fn allocate(&mut self, bytes: usize, pages: Pages) -> Result<BufferId, AllocationRefused> {
        self.arena.allocate(bytes, pages)
    }

    /// Gives a buffer's memory back; its id may be used again.
    pub fn free(&mut self, buffer: BufferId) {
        self.arena.free(buffer);
    }

    /// The bytes of a buffer.
    ///
    /// # Panics
    /// If there is no such buffer.
    #[must_use]
    pub fn bytes(&self, buffer: BufferId) -> Ref<'_, [u8]> {
        self.arena.read(buffer, "read")
    }

    /// The bytes of a buffer, to be changed.
    ///
    /// # Panics
    /// If there is no such buffer.
    #[must_use]
    pub fn bytes_mut(&self, buffer: BufferId) -> RefMut<'_, [u8]> {
        self.arena.write(buffer, "write")
    }

    /// Sets every byte of a buffer to 0.
    ///
    /// # Panics
    /// If there is no such buffer.
    pub fn clear(&mut self, buffer: BufferId) {
        let mut guard = self.arena.write(buffer, "clear");
        let bytes: &mut [u8] = &mut guard;
        self.executor.install(|| bytes.par_chunks_mut(CLEARED_AT_ONCE).for_each(|chunk| chunk.fill(0)));
    }

    /// Runs `count` invocations of a kernel, with `buffers` in the order of its bindings.
    ///
    /// # Panics
    /// If push constants or buffers do not fit the kernel, if one buffer is bound for reading and for writing, or if an
    /// invocation goes out of bounds: mistakes of the caller, named.
    pub fn dispatch(&self, kernel: Kernel, count: u32, push: &[u8], buffers: &[BufferId]) {
        enum Guard<'a> {
            Read(Ref<'a, [u8]>),
            Write(RefMut<'a, [u8]>),
        }
        let info = kernel.info();
        assert_eq!(buffers.len(), info.bindings.len(), "buffers of {}", info.name);
        let mut guards: Vec<Guard<'_>> = buffers
            .iter()
            .zip(info.bindings)
            .map(|(&buffer, binding)| match binding.access {
                Access::Read => Guard::Read(self.arena.read(buffer, binding.name)),
                Access::Write => Guard::Write(self.arena.write(buffer, binding.name)),
            })
            .collect();
        let views = guards
            .iter_mut()
            .map(|guard| match guard {
                Guard::Read(bytes) => Bytes::Read(bytes),
                Guard::Write(bytes) => Bytes::Write(bytes),
            })
            .collect();
        kernel.run(&*self.executor, count, push, views);
    }
}
