//! The one error of all settings whose values make no sense. Each type of settings has a `check`.

use std::fmt::Display;

/// A setting with a value that makes no sense. Nothing has run.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{name} is {value}, but must be {need}")]
pub struct SettingError {
    /// The field; of settings in settings with a dot between.
    pub name: &'static str,
    /// Its value.
    pub value: String,
    /// What it must be.
    pub need: &'static str,
}

/// Refuses a value unless it is good.
pub(crate) fn must(
    name: &'static str,
    value: impl Display,
    is_good: bool,
    need: &'static str,
) -> Result<(), SettingError> {
    if is_good { Ok(()) } else { Err(SettingError { name, value: value.to_string(), need }) }
}

const AT_LEAST_1: &str = "at least 1";
const NO_NEGATIVE: &str = "a finite number of at least 0";

/// Refuses 0.
pub(crate) fn at_least_1(name: &'static str, value: u32) -> Result<(), SettingError> {
    must(name, value, value >= 1, AT_LEAST_1)
}

/// Refuses what is negative or no finite number.
pub(crate) fn no_negative(name: &'static str, value: f64) -> Result<(), SettingError> {
    must(name, value, value >= 0.0 && value.is_finite(), NO_NEGATIVE)
}

/// A method that this program was built without.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{method} is not in this program: it was built without the cargo feature `{feature}`")]
#[non_exhaustive]
pub struct FeatureOff {
    /// The method.
    pub method: &'static str,
    /// The cargo feature that has it.
    pub feature: &'static str,
}
