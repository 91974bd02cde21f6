//! Which values of the optimisers' settings make sense.

use super::{Epsilon, Limits, PrbvhSettings, RbvhSettings, RotationSettings, WorstFirst};
use crate::check::{SettingError, at_least_1, must, no_negative};

impl Limits {
    /// # Errors
    /// If `target_cost` is NaN.
    pub fn check(&self) -> Result<(), SettingError> {
        let target = self.target_cost.unwrap_or(0.0);
        must("target_cost", target, !target.is_nan(), "a number")
    }
}

impl WorstFirst {
    /// More rounds of locks over one tree have nothing left to win.
    const MOST_LOCK_ROUNDS: u32 = 1000;

    /// # Errors
    /// The first field whose value makes no sense.
    pub fn check(&self) -> Result<(), SettingError> {
        let Self { first, growth, most_part, lock_rounds, slack, settles, patience, tail_part, .. } = *self;
        at_least_1("worst_first.first", first)?;
        must("worst_first.growth", growth, growth >= 1.0 && growth.is_finite(), "a finite number of at least 1")?;
        must("worst_first.most_part", most_part, most_part > 0.0 && most_part <= 1.0, "above 0 and at most 1")?;
        let is_good = (1..=Self::MOST_LOCK_ROUNDS).contains(&lock_rounds);
        must("worst_first.lock_rounds", lock_rounds, is_good, "from 1 to 1000")?;
        no_negative("worst_first.slack", slack.into())?;
        must("worst_first.settles", settles, (0.0..1.0).contains(&settles), "at least 0 and below 1")?;
        at_least_1("worst_first.patience", patience)?;
        must("worst_first.tail_part", tail_part, (0.0..=1.0).contains(&tail_part), "from 0 to 1")
    }
}

impl PrbvhSettings {
    /// # Errors
    /// The first field whose value makes no sense, also one that the chosen order does not look at.
    pub fn check(&self) -> Result<(), SettingError> {
        self.worst_first.check()?;
        at_least_1("mu", self.mu)?;
        let (Epsilon::Relative(epsilon) | Epsilon::Absolute(epsilon)) = self.epsilon;
        no_negative("epsilon", epsilon)?;
        at_least_1("patience", self.patience)?;
        self.limits.check()
    }
}

impl RbvhSettings {
    /// # Errors
    /// The first field whose value makes no sense.
    pub fn check(&self) -> Result<(), SettingError> {
        must("batch", self.batch, self.batch > 0.0 && self.batch <= 1.0, "above 0 and at most 1")?;
        no_negative("epsilon", self.epsilon)?;
        at_least_1("patience", self.patience)?;
        self.limits.check()
    }
}

impl RotationSettings {
    /// # Errors
    /// The first field whose value makes no sense.
    pub fn check(&self) -> Result<(), SettingError> {
        no_negative("temperature", self.temperature)?;
        no_negative("epsilon", self.epsilon)?;
        self.limits.check()
    }
}
