//! How ε is written: as plain keys.

use serde::{Deserialize, Serialize};

/// `epsilon`, and what it is a part of.
#[derive(Serialize, Deserialize)]
pub(super) struct Epsilon {
    epsilon: f64,
    /// Of the initial cost; else it is a cost.
    epsilon_relative: bool,
}

impl From<Epsilon> for super::Epsilon {
    fn from(Epsilon { epsilon, epsilon_relative }: Epsilon) -> Self {
        if epsilon_relative { Self::Relative(epsilon) } else { Self::Absolute(epsilon) }
    }
}

impl From<super::Epsilon> for Epsilon {
    fn from(epsilon: super::Epsilon) -> Self {
        match epsilon {
            super::Epsilon::Relative(epsilon) => Self { epsilon, epsilon_relative: true },
            super::Epsilon::Absolute(epsilon) => Self { epsilon, epsilon_relative: false },
        }
    }
}
