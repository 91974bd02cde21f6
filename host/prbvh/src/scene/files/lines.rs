//! The lines of a text file, however they end.

use super::format::without_mark;
use super::origin::Origin;
use crate::scene::error::SceneError;
use std::io::BufRead;

/// A line without its end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line<'a> {
    /// From 1.
    pub(super) number: u64,
    pub(super) text: &'a [u8],
}

/// Reads line after line. One ends with a line feed, a carriage return, or both.
pub(super) struct Lines<R> {
    pub(super) origin: Origin,
    bytes: R,
    /// What was read up to a line feed, without its end; it may hold carriage returns.
    buffer: Vec<u8>,
    /// Where the next line starts in `buffer`; none where it has been handed out.
    start: Option<usize>,
    number: u64,
}

impl<R: BufRead> Lines<R> {
    pub(super) fn new(origin: Origin, bytes: R) -> Self {
        Self::from(origin, bytes, 0)
    }

    /// The lines of what follows `number` others.
    pub(super) fn from(origin: Origin, bytes: R, number: u64) -> Self {
        Self { origin, bytes, buffer: Vec::new(), start: None, number }
    }

    /// The next line; none at the end.
    pub(super) fn next(&mut self) -> Result<Option<Line<'_>>, SceneError> {
        let start = match self.start {
            Some(start) => start,
            None => {
                self.buffer.clear();
                let read = self.bytes.read_until(b'\n', &mut self.buffer);
                if read.map_err(|source| self.origin.fault(source))? == 0 {
                    return Ok(None);
                }
                for end in [b'\n', b'\r'] {
                    if self.buffer.last() == Some(&end) {
                        self.buffer.pop();
                    }
                }
                0
            }
        };
        self.number += 1;
        let rest = &self.buffer[start..];
        let length = rest.iter().position(|byte| *byte == b'\r');
        self.start = length.map(|length| start + length + 1);
        // Files that were put together have a mark before each part.
        let text = without_mark(&rest[..length.unwrap_or(rest.len())]);
        Ok(Some(Line { number: self.number, text }))
    }
}

/// The words of a line.
pub(super) fn words(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// Whether a line is blank, or holds but what old editors fill or end a file with.
pub(super) fn is_blank(text: &[u8]) -> bool {
    text.iter().all(|byte| byte.is_ascii_whitespace() || matches!(byte, 0 | 0x1a))
}
