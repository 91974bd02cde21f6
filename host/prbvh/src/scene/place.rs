//! Places in scene files.

use std::fmt;

/// Where in a scene the fault is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Place {
    /// Line of a text file, from 1.
    Line(u64),
    /// Element of a file that has no lines, such as `("vertex", 7)`, from 0.
    Element(&'static str, u64),
    /// The file as a whole.
    File,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, ", line {line}"),
            Self::Element(kind, index) => write!(f, ", {kind} {index}"),
            Self::File => Ok(()),
        }
    }
}
