//! Parameters of builders as text: the name of a preset, or `name=value` with commas between.

use crate::check::SettingError;

/// Text that says no builder's parameters.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ParameterError {
    /// Neither a preset nor a parameter.
    #[error("`{text}` is neither a preset nor `name=value`: there are {known}")]
    Unknown {
        /// What was written.
        text: String,
        /// Presets and parameters.
        known: &'static str,
    },
    /// No value of the parameter.
    #[error("{name}={value}: {why}")]
    Value {
        /// The parameter.
        name: &'static str,
        /// What was written.
        value: String,
        /// What is wrong with it.
        why: String,
    },
    /// A value that makes no sense.
    #[error(transparent)]
    Setting(#[from] SettingError),
}

/// `Display` and `FromStr` of a builder's settings, which are `Default`, `PartialEq` and have a `check`. An empty name is a preset that needs none.
macro_rules! parameters {
    ($settings:ty, known $known:literal, presets { $($preset:literal => $value:expr),* }, $($field:ident),+) => {
        impl std::fmt::Display for $settings {
            /// The preset's name, or all parameters with their values.
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                $(if *self == $value {
                    return f.write_str($preset);
                })*
                f.write_str(&[$(format!(concat!(stringify!($field), "={}"), self.$field)),+].join(","))
            }
        }

        impl std::str::FromStr for $settings {
            type Err = $crate::parameters::ParameterError;

            /// A preset's name, or some parameters, the others as by default.
            fn from_str(text: &str) -> Result<Self, Self::Err> {
                use $crate::parameters::ParameterError;
                $(if text == $preset {
                    return Ok($value);
                })*
                let mut settings = Self::default();
                for part in text.split(',').filter(|part| !part.is_empty()) {
                    match part.split_once('=') {
                        $(Some((stringify!($field), value)) => {
                            settings.$field = value.parse().map_err(|why| ParameterError::Value {
                                name: stringify!($field),
                                value: value.to_owned(),
                                why: format!("{why}"),
                            })?;
                        })+
                        _ => return Err(ParameterError::Unknown { text: part.to_owned(), known: $known }),
                    }
                }
                settings.check()?;
                Ok(settings)
            }
        }
    };
}

pub(crate) use parameters;
