//! How many bins an axis has.

use std::fmt;

/// Bins of an axis for binned SAH (Wald 2007), 8 to 32.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(try_from = "u32", into = "u32"))]
pub struct Bins(u32);

/// A number of bins that no axis has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("an axis has {min} to {max} bins, not {bins}", min = Bins::MIN, max = Bins::MAX)]
#[non_exhaustive]
pub struct BinsError {
    bins: u32,
}

impl Bins {
    /// The fewest: with less the splits near the root are far off.
    pub const MIN: Self = Self(8);
    /// The most: more gain nothing.
    pub const MAX: Self = Self(32);
    /// The most.
    pub const DEFAULT: Self = Self::MAX;

    /// A number of bins.
    ///
    /// # Errors
    /// If it is out of range.
    pub const fn new(bins: u32) -> Result<Self, BinsError> {
        if Self::MIN.0 <= bins && bins <= Self::MAX.0 { Ok(Self(bins)) } else { Err(BinsError { bins }) }
    }

    /// The number of bins.
    #[must_use]
    pub const fn get(self) -> u32 {
        self.0
    }
}

impl TryFrom<u32> for Bins {
    type Error = BinsError;

    fn try_from(bins: u32) -> Result<Self, BinsError> {
        Self::new(bins)
    }
}

impl From<Bins> for u32 {
    fn from(bins: Bins) -> Self {
        bins.get()
    }
}

impl Default for Bins {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl fmt::Display for Bins {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_has_8_to_32_bins() {
        for bins in [8, 9, 16, 32] {
            assert_eq!(Bins::new(bins).map(Bins::get), Ok(bins));
        }
        for bins in [0, 7, 33, u32::MAX] {
            assert_eq!(Bins::new(bins).unwrap_err().to_string(), format!("an axis has 8 to 32 bins, not {bins}"));
        }
    }
}
