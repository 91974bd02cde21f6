//! Memory that several invocations of one dispatch may write. The only file of the crate with `unsafe`.
//!
//! The type of a kernel's parameter is its concurrency contract:
//!
//! | parameter | in this dispatch |
//! |---|---|
//! | `&[T]` | nobody writes it |
//! | `&[Slot<T>]` | element `k` is touched by one invocation only |
//! | `&[AtomicU32]`, `&[AtomicU64]`, and structs of them ([`AtomicWords`]) | anybody may touch it |
//! | `&[SharedU32; N]` | memory of one workgroup: what an invocation stores in a phase, others read in later phases only ([`crate::workgroup`]) |
//!
//! Natively all of them are relaxed atomics (a workgroup is run by one thread, so that its memory is plain cells), and a broken contract is a wrong
//! answer that a test can find, never undefined behaviour. On the GPU atomics have `QueueFamily` scope (`Device` needs one more feature), and a [`Slot`] is a plain
//! private access: what one invocation hands to another within a dispatch must go through atomics.
#![allow(unsafe_code, reason = "views of buffers that many invocations write; each block states its reason")]

use bytemuck::Pod;
#[cfg(not(target_arch = "spirv"))]
use core::cell::Cell;
use core::cell::UnsafeCell;

#[cfg(not(target_arch = "spirv"))]
use core::sync::atomic::{self, Ordering};

/// `Scope::QueueFamily`.
#[cfg(target_arch = "spirv")]
const SCOPE: u32 = 5;
/// `Scope::Workgroup`.
#[cfg(target_arch = "spirv")]
const WORKGROUP: u32 = 2;
/// Relaxed: `MemorySemantics::NONE`.
#[cfg(target_arch = "spirv")]
const RELAXED: u32 = 0;
/// `ACQUIRE_RELEASE | UNIFORM_MEMORY | MAKE_AVAILABLE | MAKE_VISIBLE`.
#[cfg(target_arch = "spirv")]
const ACQUIRE_RELEASE: u32 = 0x6048;

macro_rules! atomic_word {
    ($(#[$doc:meta])* $name:ident, $int:ty, $native:ty) => {
        $(#[$doc])*
        #[repr(transparent)]
        pub struct $name(UnsafeCell<$int>);

        // SAFETY: every access below is atomic.
        unsafe impl Sync for $name {}

        #[cfg(not(target_arch = "spirv"))]
        impl $name {
            /// A shared atomic view of memory that the caller holds exclusively.
            #[must_use]
            pub fn from_mut_slice(words: &mut [$int]) -> &[Self] {
                let length = words.len();
                // SAFETY: same size and alignment (transparent), and `&mut` excludes every other view for as long as this one lives.
                unsafe { core::slice::from_raw_parts(words.as_mut_ptr().cast::<Self>(), length) }
            }

            #[inline(always)]
            fn native(&self) -> &$native {
                // SAFETY: the pointer is valid and aligned for the lifetime of `self`, and all accesses are atomic.
                unsafe { <$native>::from_ptr(self.0.get()) }
            }
        }

        impl $name {
            /// Relaxed load.
            #[inline(always)]
            pub fn load(&self) -> $int {
                #[cfg(target_arch = "spirv")]
                // SAFETY: an atomic access to a live element of a storage buffer.
                return unsafe { spirv_std::arch::atomic_load::<$int, SCOPE, RELAXED>(&*self.0.get()) };
                #[cfg(not(target_arch = "spirv"))]
                return self.native().load(Ordering::Relaxed);
            }

            /// Relaxed store.
            #[inline(always)]
            pub fn store(&self, value: $int) {
                #[cfg(target_arch = "spirv")]
                // SAFETY: an atomic access to a live element of a storage buffer.
                unsafe {
                    spirv_std::arch::atomic_store::<$int, SCOPE, RELAXED>(&mut *self.0.get(), value);
                }
                #[cfg(not(target_arch = "spirv"))]
                self.native().store(value, Ordering::Relaxed);
            }

            /// Relaxed maximum of unsigned words.
            #[inline(always)]
            pub fn max(&self, value: $int) {
                #[cfg(target_arch = "spirv")]
                // SAFETY: an atomic access to a live element of a storage buffer.
                unsafe {
                    spirv_std::arch::atomic_u_max::<$int, SCOPE, RELAXED>(&mut *self.0.get(), value);
                }
                #[cfg(not(target_arch = "spirv"))]
                self.native().fetch_max(value, Ordering::Relaxed);
            }
        }
    };
}

atomic_word!(
    /// A 32-bit word that many invocations may touch.
    AtomicU32, u32, atomic::AtomicU32
);
atomic_word!(
    /// A 64-bit word that many invocations may touch (`shaderBufferInt64Atomics`).
    AtomicU64, u64, atomic::AtomicU64
);

impl AtomicU32 {
    /// Relaxed addition; returns what was there before.
    #[inline(always)]
    pub fn add(&self, value: u32) -> u32 {
        #[cfg(target_arch = "spirv")]
        // SAFETY: an atomic access to a live element of a storage buffer.
        return unsafe { spirv_std::arch::atomic_i_add::<u32, SCOPE, RELAXED>(&mut *self.0.get(), value) };
        #[cfg(not(target_arch = "spirv"))]
        return self.native().fetch_add(value, Ordering::Relaxed);
    }

    /// Relaxed exchange; returns what was there before.
    #[inline(always)]
    pub fn swap(&self, value: u32) -> u32 {
        #[cfg(target_arch = "spirv")]
        // SAFETY: an atomic access to a live element of a storage buffer.
        return unsafe { spirv_std::arch::atomic_exchange::<u32, SCOPE, RELAXED>(&mut *self.0.get(), value) };
        #[cfg(not(target_arch = "spirv"))]
        return self.native().swap(value, Ordering::Relaxed);
    }

    /// Relaxed bitwise or.
    #[inline(always)]
    pub fn or(&self, bits: u32) {
        #[cfg(target_arch = "spirv")]
        // SAFETY: an atomic access to a live element of a storage buffer.
        unsafe {
            spirv_std::arch::atomic_or::<u32, SCOPE, RELAXED>(&mut *self.0.get(), bits);
        }
        #[cfg(not(target_arch = "spirv"))]
        self.native().fetch_or(bits, Ordering::Relaxed);
    }

    /// Counts an arrival and returns how many came before. Acquires and releases: what earlier arrivals wrote through
    /// atomics before they came is visible to the one that continues.
    #[inline(always)]
    pub fn arrive(&self) -> u32 {
        #[cfg(target_arch = "spirv")]
        // SAFETY: an atomic access to a live element of a storage buffer.
        return unsafe { spirv_std::arch::atomic_i_add::<u32, SCOPE, ACQUIRE_RELEASE>(&mut *self.0.get(), 1) };
        #[cfg(not(target_arch = "spirv"))]
        return self.native().fetch_add(1, Ordering::AcqRel);
    }

    /// Takes back an arrival and returns how many there were. Orders as [`AtomicU32::arrive`] does.
    #[inline(always)]
    pub fn depart(&self) -> u32 {
        #[cfg(target_arch = "spirv")]
        // SAFETY: an atomic access to a live element of a storage buffer.
        return unsafe { spirv_std::arch::atomic_i_sub::<u32, SCOPE, ACQUIRE_RELEASE>(&mut *self.0.get(), 1) };
        #[cfg(not(target_arch = "spirv"))]
        return self.native().fetch_sub(1, Ordering::AcqRel);
    }

    /// Relaxed load of a float stored by [`AtomicU32::store_f32`].
    #[inline(always)]
    pub fn load_f32(&self) -> f32 {
        f32::from_bits(self.load())
    }

    /// Relaxed store of a float's bits.
    #[inline(always)]
    pub fn store_f32(&self, value: f32) {
        self.store(value.to_bits());
    }
}

/// A word of the memory that a workgroup shares. Nothing is known of it before it is stored.
#[repr(transparent)]
pub struct SharedU32(#[cfg(target_arch = "spirv")] UnsafeCell<u32>, #[cfg(not(target_arch = "spirv"))] Cell<u32>);

// SAFETY: every access below is atomic.
#[cfg(target_arch = "spirv")]
unsafe impl Sync for SharedU32 {}

#[cfg(target_arch = "spirv")]
impl SharedU32 {
    /// Reads the word.
    #[inline(always)]
    pub fn load(&self) -> u32 {
        // SAFETY: an atomic access to a live word of the workgroup.
        unsafe { spirv_std::arch::atomic_load::<u32, WORKGROUP, RELAXED>(&*self.0.get()) }
    }

    /// Writes the word.
    #[inline(always)]
    pub fn store(&self, value: u32) {
        // SAFETY: an atomic access to a live word of the workgroup.
        unsafe {
            spirv_std::arch::atomic_store::<u32, WORKGROUP, RELAXED>(&mut *self.0.get(), value);
        }
    }

    /// Adds to the word. Several invocations may in one phase.
    #[inline(always)]
    pub fn add(&self, value: u32) {
        // SAFETY: an atomic access to a live word of the workgroup.
        unsafe {
            spirv_std::arch::atomic_i_add::<u32, WORKGROUP, RELAXED>(&mut *self.0.get(), value);
        }
    }

    /// Sets bits of the word. Several invocations may in one phase.
    #[inline(always)]
    pub fn or(&self, bits: u32) {
        // SAFETY: an atomic access to a live word of the workgroup.
        unsafe {
            spirv_std::arch::atomic_or::<u32, WORKGROUP, RELAXED>(&mut *self.0.get(), bits);
        }
    }
}

#[cfg(not(target_arch = "spirv"))]
impl SharedU32 {
    /// A word of a workgroup that begins.
    #[inline(always)]
    #[must_use]
    pub const fn new(value: u32) -> Self {
        Self(Cell::new(value))
    }

    /// Reads the word.
    #[inline(always)]
    pub fn load(&self) -> u32 {
        self.0.get()
    }

    /// Writes the word.
    #[inline(always)]
    pub fn store(&self, value: u32) {
        self.0.set(value);
    }

    /// Adds to the word. Several invocations may in one phase.
    #[inline(always)]
    pub fn add(&self, value: u32) {
        self.0.set(self.0.get().wrapping_add(value));
    }

    /// Sets bits of the word. Several invocations may in one phase.
    #[inline(always)]
    pub fn or(&self, bits: u32) {
        self.0.set(self.0.get() | bits);
    }
}

impl SharedU32 {
    /// Reads a float stored by [`SharedU32::store_f32`].
    #[inline(always)]
    pub fn load_f32(&self) -> f32 {
        f32::from_bits(self.load())
    }

    /// Writes a float's bits.
    #[inline(always)]
    pub fn store_f32(&self, value: f32) {
        self.store(value.to_bits());
    }
}

/// An element that a single invocation of the dispatch reads and writes.
#[repr(transparent)]
pub struct Slot<T>(UnsafeCell<T>);

// SAFETY: natively every access is a relaxed atomic of a 32-bit word; on the GPU the contract of the module holds.
unsafe impl<T: Pod> Sync for Slot<T> {}

#[cfg(target_arch = "spirv")]
impl<T: Pod> Slot<T> {
    /// Reads the element.
    #[inline(always)]
    pub fn get(&self) -> T {
        // SAFETY: one invocation touches this element during the dispatch.
        unsafe { *self.0.get() }
    }

    /// Writes the element.
    #[inline(always)]
    pub fn set(&self, value: T) {
        // SAFETY: one invocation touches this element during the dispatch.
        unsafe {
            *self.0.get() = value;
        }
    }
}

#[cfg(not(target_arch = "spirv"))]
impl<T: Pod> Slot<T> {
    const WORDS: usize = {
        assert!(size_of::<T>().is_multiple_of(4) && align_of::<T>() >= 4, "a slot is made of 32-bit words");
        size_of::<T>() / 4
    };

    /// A view of memory that the caller holds exclusively.
    #[must_use]
    pub fn from_mut_slice(elements: &mut [T]) -> &[Self] {
        let length = elements.len();
        // SAFETY: same size and alignment (transparent), and `&mut` excludes every other view for as long as this one lives.
        unsafe { core::slice::from_raw_parts(elements.as_mut_ptr().cast::<Self>(), length) }
    }

    #[inline(always)]
    fn word(&self, k: usize) -> &atomic::AtomicU32 {
        debug_assert!(k < Self::WORDS);
        // SAFETY: word `k` lies inside the element, is 4-byte aligned, and all accesses are atomic.
        unsafe { atomic::AtomicU32::from_ptr(self.0.get().cast::<u32>().add(k)) }
    }

    /// Reads the element.
    #[inline(always)]
    pub fn get(&self) -> T {
        let mut value = T::zeroed();
        let words: &mut [u32] = bytemuck::cast_slice_mut(core::slice::from_mut(&mut value));
        for (k, word) in words.iter_mut().enumerate().take(Self::WORDS) {
            *word = self.word(k).load(Ordering::Relaxed);
        }
        value
    }

    /// Writes the element.
    #[inline(always)]
    pub fn set(&self, value: T) {
        let words: &[u32] = bytemuck::cast_slice(core::slice::from_ref(&value));
        for (k, word) in words.iter().enumerate().take(Self::WORDS) {
            self.word(k).store(*word, Ordering::Relaxed);
        }
    }
}

/// Asks for an element that will be read soon, without waiting for it; nothing where the index is none of the slice, or on a GPU, which has other
/// invocations to run meanwhile.
#[inline(always)]
pub fn prefetch<T>(slice: &[T], index: u32) {
    #[cfg(all(target_arch = "x86_64", not(target_arch = "spirv")))]
    if let Some(element) = slice.get(index as usize) {
        use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a hint without effect on memory, at the address of a live element.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(core::ptr::from_ref(element).cast()) };
    }
    #[cfg(not(all(target_arch = "x86_64", not(target_arch = "spirv"))))]
    let _ = (slice, index);
}

/// A struct of [`AtomicU32`]s, each in the place of a word of a plain struct; `atomic_words!` makes it one.
///
/// # Safety
/// Both have the same size, and nothing but words that are atomic here.
#[cfg(not(target_arch = "spirv"))]
pub unsafe trait AtomicWords: Sized {
    /// The plain struct.
    type Plain: Pod;

    /// A shared view of memory that the caller holds exclusively.
    #[must_use]
    fn from_mut_slice(plain: &mut [Self::Plain]) -> &[Self] {
        let length = plain.len();
        // SAFETY: same words in the same places, each atomic in the view, and `&mut` excludes every other view for as long as this one lives.
        unsafe { core::slice::from_raw_parts(plain.as_mut_ptr().cast::<Self>(), length) }
    }
}

/// Makes a struct the [`AtomicWords`] of a plain one; takes all of its fields.
macro_rules! atomic_words {
    ($atomic:ident { $($field:ident),+ $(,)? } of $plain:ty) => {
        const _: () = {
            assert!(size_of::<$atomic>() == size_of::<$plain>() && align_of::<$atomic>() == align_of::<$plain>());
        };

        // SAFETY: the sizes are equal, and the pattern below names every field and takes none that is not an atomic word.
        #[cfg(not(target_arch = "spirv"))]
        #[allow(unsafe_code, reason = "checked here, for each struct")]
        unsafe impl $crate::mem::AtomicWords for $atomic {
            type Plain = $plain;
        }

        #[cfg(not(target_arch = "spirv"))]
        const _: fn(&$atomic) = |$atomic { $($field),+ }| {
            $(let _: &$crate::mem::AtomicU32 = $field;)+
        };
    };
}

pub(crate) use atomic_words;
