//! What of a scene file was not read, or not as the file means it.

use super::place::Place;
use std::fmt;

/// Something in a scene file that became no triangles, or others than the file means. Statements, elements and extensions that never hold
/// triangles are none.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Note {
    /// What it is, and what became of it.
    pub what: String,
    /// Where the first one is.
    #[cfg_attr(feature = "serde", serde(serialize_with = "bare"))]
    pub first: Place,
    /// How many there are.
    pub count: u64,
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = place(self.first);
        match (self.count, self.first) {
            (1, Place::File) => write!(f, "{}", self.what),
            (1, _) => write!(f, "{} ({place})", self.what),
            (count, Place::File) => write!(f, "{} ({count} times)", self.what),
            (count, _) => write!(f, "{} ({count} times, first at {place})", self.what),
        }
    }
}

/// A place by itself, without the comma that joins it to a file.
fn place(place: Place) -> String {
    match place {
        Place::File => "file".to_owned(),
        other => other.to_string().trim_start_matches(", ").to_owned(),
    }
}

#[cfg(feature = "serde")]
fn bare<S: serde::Serializer>(first: &Place, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&place(*first))
}

/// Notes of one message.
const SHOWN: usize = 4;

/// The first notes in one line.
pub(super) fn in_a_line(notes: &[Note]) -> String {
    let mut shown: Vec<String> = notes.iter().take(SHOWN).map(ToString::to_string).collect();
    if notes.len() > SHOWN {
        shown.push(format!("{} more", notes.len() - SHOWN));
    }
    shown.join("; ")
}
