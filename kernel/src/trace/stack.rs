//! Stacks of references to nodes.

use crate::mem::Slot;

/// Words of one invocation, addressed by depth.
pub trait Stack {
    /// The word at `depth`.
    fn get(&self, depth: u32) -> u32;
    /// Replaces the word at `depth`.
    fn set(&mut self, depth: u32, word: u32);
}

/// A stack of `N` words of the invocation's own.
#[derive(Clone, Copy, Debug)]
pub struct LocalStack<const N: usize>([u32; N]);

impl<const N: usize> LocalStack<N> {
    /// `N` zeros.
    #[inline(always)]
    #[must_use]
    pub fn new() -> Self {
        Self([0; N])
    }
}

impl<const N: usize> Default for LocalStack<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Stack for LocalStack<N> {
    #[inline(always)]
    fn get(&self, depth: u32) -> u32 {
        self.0[depth as usize]
    }
    #[inline(always)]
    fn set(&mut self, depth: u32, word: u32) {
        self.0[depth as usize] = word;
    }
}

/// Rows of a [`BufferStack`]'s buffer before the stack.
pub const STATE_ROWS: u32 = 3;

/// A stack in a buffer that all invocations share: the words of one depth lie side by side.
pub struct BufferStack<'a> {
    /// The buffer, `[(3 + depth) · count]`.
    pub words: &'a [Slot<u32>],
    /// The invocation.
    pub invocation: u32,
    /// Invocations.
    pub count: u32,
}

impl Stack for BufferStack<'_> {
    #[inline(always)]
    fn get(&self, depth: u32) -> u32 {
        self.words[((STATE_ROWS + depth) * self.count + self.invocation) as usize].get()
    }
    #[inline(always)]
    fn set(&mut self, depth: u32, word: u32) {
        self.words[((STATE_ROWS + depth) * self.count + self.invocation) as usize].set(word);
    }
}
