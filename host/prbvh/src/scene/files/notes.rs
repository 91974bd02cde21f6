//! Collects what a reader has to say.

use crate::scene::{Note, Place};
use std::borrow::Cow;

/// Collects the notes of a file.
#[derive(Debug, Default)]
pub(super) struct Notes(Vec<Note>);

/// Most kinds of notes: a file of noise under the name of a scene has a kind in every line.
const MOST_KINDS: usize = 40;

/// What further kinds are counted as.
const OTHER: &str = "other things that are not known";

impl Notes {
    pub(super) fn add<'a>(&mut self, place: Place, what: impl Into<Cow<'a, str>>) {
        self.add_many(place, 1, what);
    }

    pub(super) fn add_many<'a>(&mut self, place: Place, count: u64, what: impl Into<Cow<'a, str>>) {
        let what = what.into();
        let is_new = !self.0.iter().any(|note| note.what == what);
        let what = if is_new && self.0.len() >= MOST_KINDS { Cow::Borrowed(OTHER) } else { what };
        match self.0.iter_mut().find(|note| note.what == what) {
            Some(note) => note.count = note.count.saturating_add(count),
            None => self.0.push(Note { what: what.into_owned(), first: place, count }),
        }
    }

    pub(super) fn append(&mut self, others: Self) {
        others.0.into_iter().for_each(|note| self.add_many(note.first, note.count, note.what));
    }

    pub(super) fn into_vec(self) -> Vec<Note> {
        self.0
    }
}
