//! A way to ask a run to end soon.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether a run is to end soon. Anyone may ask, from any thread and from a signal handler; the run looks between two steps of its work. Clones share
/// the answer.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Asks.
    pub fn ask(&self) {
        self.0.store(true, Ordering::SeqCst);
    }

    /// Whether somebody asked.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}

/// Asked as soon as the flag is true.
impl From<Arc<AtomicBool>> for Stop {
    fn from(flag: Arc<AtomicBool>) -> Self {
        Self(flag)
    }
}

/// Settings are the same whoever may end a run.
impl PartialEq for Stop {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clones_and_the_flag_share_the_answer() {
        let flag = Arc::new(AtomicBool::new(false));
        let stop = Stop::from(Arc::clone(&flag));
        let clone = stop.clone();
        assert!(!clone.is_asked());
        flag.store(true, Ordering::Relaxed);
        assert!(clone.is_asked() && stop.is_asked());
        let other = Stop::default();
        assert!(!other.is_asked());
        other.clone().ask();
        assert!(other.is_asked());
    }
}
