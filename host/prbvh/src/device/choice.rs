//! Which device to run on: `auto`, `cpu`, `vulkan`, `vulkan:N`.

use std::fmt;
use std::str::FromStr;

/// Which Vulkan device to open.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Selection {
    /// The best that prbvh can run on: a discrete GPU before an integrated one, a virtual one, a CPU.
    #[default]
    Automatic,
    /// The one with this number in `prbvh devices`.
    Index(usize),
}

/// A device by the name that a user gives it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum DeviceChoice {
    /// The best Vulkan GPU that the kernels can run on, else the CPU.
    #[default]
    Auto,
    /// The CPU.
    Cpu,
    /// The best Vulkan device, or one by its number.
    Vulkan(Selection),
}

/// A text that names no device.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no device: there are auto, cpu, vulkan and vulkan:N with N as `prbvh devices` lists it")]
pub struct NoSuchChoice(String);

impl FromStr for DeviceChoice {
    type Err = NoSuchChoice;

    fn from_str(text: &str) -> Result<Self, NoSuchChoice> {
        match text.split_once(':') {
            None if text == "auto" => Ok(Self::Auto),
            None if text == "cpu" => Ok(Self::Cpu),
            None if text == "vulkan" => Ok(Self::Vulkan(Selection::Automatic)),
            Some(("vulkan", index)) if !index.starts_with('+') => {
                let index = index.parse().map_err(|_| NoSuchChoice(text.to_owned()))?;
                Ok(Self::Vulkan(Selection::Index(index)))
            }
            _ => Err(NoSuchChoice(text.to_owned())),
        }
    }
}

impl fmt::Display for DeviceChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Cpu => f.write_str("cpu"),
            Self::Vulkan(Selection::Automatic) => f.write_str("vulkan"),
            Self::Vulkan(Selection::Index(index)) => write!(f, "vulkan:{index}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_read_back_as_written() {
        for text in ["auto", "cpu", "vulkan", "vulkan:0", "vulkan:12"] {
            assert_eq!(text.parse::<DeviceChoice>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn other_texts_are_refused_by_name() {
        for text in ["", "gpu", "vulkan:", "vulkan:x", "vulkan:-1", "vulkan:+1", "cpu:0", "VULKAN"] {
            let error = text.parse::<DeviceChoice>().unwrap_err().to_string();
            assert!(error.contains(&format!("`{text}`")), "{error}");
        }
    }
}
