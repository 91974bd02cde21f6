//! Buffers: aligned to cache lines, and borrow-checked while a dispatch runs.

use bytemuck::allocation::try_zeroed_slice_box;
use memmap2::MmapMut;
use std::cell::{Ref, RefCell, RefMut};

/// Number of a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BufferId(pub u32);

/// The system refused memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the system refused {bytes} bytes")]
pub struct AllocationRefused {
    /// Size of the buffer.
    pub bytes: usize,
}

/// Buffers begin at a cache line, so that a 32-byte node never lies in two.
const LINE: usize = 64;

/// Bytes from which on a buffer is pages of its own. Smaller ones are of the allocator, which has them at hand again for the next run.
pub const OWN_PAGES: usize = 4 << 20;

/// Size of the pages of a large buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pages {
    /// For buffers of which little may be touched.
    Small,
    /// For buffers that are written whole and read here and there, where the system has such pages: the processor then knows where they all are.
    Large,
}

#[derive(Debug)]
enum Memory {
    // Words, not lines: of plainly aligned memory the system gives zeros without writing them.
    Words {
        words: Box<[u64]>,
        start: usize,
    },
    /// Pages of their own: an allocator keeps much of what it is given back, so that a process would grow by what it no longer needs.
    Pages(MmapMut),
}

#[derive(Debug)]
struct Buffer {
    memory: Memory,
    bytes: usize,
}

impl Buffer {
    fn zeroed(bytes: usize, pages: Pages) -> Option<Self> {
        if bytes >= OWN_PAGES {
            let memory = MmapMut::map_anon(bytes).ok()?;
            #[cfg(target_os = "linux")]
            if pages == Pages::Large {
                // A wish: without it everything works, slower.
                _ = memory.advise(memmap2::Advice::HugePage);
            }
            return Some(Self { memory: Memory::Pages(memory), bytes });
        }
        let count = bytes.div_ceil(size_of::<u64>()) + LINE / size_of::<u64>();
        let words = try_zeroed_slice_box::<u64>(count).ok()?;
        let start = words.as_ptr().cast::<u8>().align_offset(LINE);
        Some(Self { memory: Memory::Words { words, start }, bytes })
    }

    fn bytes(&self) -> &[u8] {
        match &self.memory {
            Memory::Words { words, start } => &bytemuck::cast_slice(words)[*start..][..self.bytes],
            Memory::Pages(pages) => &pages[..self.bytes],
        }
    }

    fn bytes_mut(&mut self) -> &mut [u8] {
        match &mut self.memory {
            Memory::Words { words, start } => &mut bytemuck::cast_slice_mut(words)[*start..][..self.bytes],
            Memory::Pages(pages) => &mut pages[..self.bytes],
        }
    }
}

#[derive(Debug, Default)]
pub(crate) struct Arena {
    buffers: Vec<RefCell<Option<Buffer>>>,
}

impl Arena {
    pub(crate) fn allocate(&mut self, bytes: usize, pages: Pages) -> Result<BufferId, AllocationRefused> {
        let buffer = RefCell::new(Some(Buffer::zeroed(bytes, pages).ok_or(AllocationRefused { bytes })?));
        let free = self.buffers.iter().position(|slot| slot.borrow().is_none());
        let id = free.unwrap_or(self.buffers.len());
        if free.is_some() {
            self.buffers[id] = buffer;
        } else {
            self.buffers.push(buffer);
        }
        Ok(BufferId(u32::try_from(id).expect("fewer than 2^32 buffers")))
    }

    pub(crate) fn free(&mut self, buffer: BufferId) {
        self.buffers[buffer.0 as usize] = RefCell::new(None);
    }

    pub(crate) fn read(&self, buffer: BufferId, name: &str) -> Ref<'_, [u8]> {
        let guard = self.buffers[buffer.0 as usize]
            .try_borrow()
            .unwrap_or_else(|_| panic!("`{name}` is bound for reading and for writing in one dispatch"));
        Ref::map(guard, |slot| slot.as_ref().unwrap_or_else(|| panic!("`{name}` is a freed buffer")).bytes())
    }

    pub(crate) fn write(&self, buffer: BufferId, name: &str) -> RefMut<'_, [u8]> {
        let guard = self.buffers[buffer.0 as usize]
            .try_borrow_mut()
            .unwrap_or_else(|_| panic!("`{name}` is bound twice in one dispatch"));
        RefMut::map(guard, |slot| slot.as_mut().unwrap_or_else(|| panic!("`{name}` is a freed buffer")).bytes_mut())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_are_zeroed_aligned_and_reused() {
        let mut arena = Arena::default();
        let first = arena.allocate(100, Pages::Small).unwrap();
        assert_eq!(arena.read(first, "first").len(), 100);
        assert_eq!(arena.read(first, "first").as_ptr() as usize % 64, 0);
        arena.write(first, "first").fill(7);
        arena.free(first);
        let second = arena.allocate(3, Pages::Small).unwrap();
        assert_eq!(second, first);
        assert_eq!(&*arena.read(second, "second"), &[0, 0, 0]);
    }

    #[test]
    fn refused_memory_is_an_error() {
        assert_eq!(
            Arena::default().allocate(isize::MAX as usize, Pages::Large).unwrap_err().bytes,
            isize::MAX as usize
        );
    }

    #[test]
    #[should_panic(expected = "`nodes` is bound for reading and for writing in one dispatch")]
    fn a_buffer_bound_for_reading_and_writing_is_refused_by_name() {
        let mut arena = Arena::default();
        let buffer = arena.allocate(4, Pages::Small).unwrap();
        let _writing = arena.write(buffer, "boxes");
        let _reading = arena.read(buffer, "nodes");
    }
}
