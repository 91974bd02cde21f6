//! How long a search may take.

/// Counts the rounds of all loops of an invocation.
#[derive(Clone, Copy)]
pub(super) struct Rounds {
    pub(super) left: u32,
    /// Of these, the looks at the boxes of possible places.
    pub(super) visits: u32,
}

impl Rounds {
    /// Whether there is another round; if there is none, what the loops left is of no use.
    #[inline(always)]
    pub(super) fn next(&mut self) -> bool {
        if self.left > 0 {
            self.left -= 1;
            true
        } else {
            false
        }
    }
}
