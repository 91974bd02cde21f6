//! STL, binary and text.

use super::faces::{CROSSING, TOO_SMALL};
use super::format::without_mark;
use super::lines::{Line, Lines, is_blank, words};
use super::open::Opened;
use super::polygon::Polygons;
use super::{ATTRIBUTE_NUMBER, Loaded};
use crate::scene::Place;
use crate::scene::error::{Blame, SceneError, shorten};
use crate::scene::files::notes::Notes;
use prbvh_kernel::setup::Triangle;
use std::io::BufRead;

/// Bytes before the facets of a binary file: a free header and the number of facets.
const HEADER_BYTES: usize = 84;
const FREE_BYTES: usize = 80;
const FACET_BYTES: usize = 50;
/// Bytes of a facet before its corners: the normal.
const NORMAL_BYTES: usize = 12;

/// Bytes of a text in which a zero byte tells that it is none.
const TEXT_BYTES: usize = 512;

/// Reads an STL file. Normals and attributes are passed over.
pub(super) fn read(mut opened: Opened) -> Result<Loaded, SceneError> {
    let bytes = opened.read_all()?;
    let blame = Blame(&opened.origin.file);
    let mut notes = Notes::default();
    let is_exact = has_announced_length(&bytes);
    let triangles = if is_exact || is_binary(&bytes) {
        if !is_exact {
            opened.check_encoding()?;
        }
        read_binary(blame, &bytes, &mut notes)?
    } else {
        let mut text = Text::new(blame);
        text.read(Lines::new(opened.origin.clone(), without_mark(&bytes)))?;
        notes = text.notes;
        text.triangles
    };
    blame.limit(triangles.len() as u64)?;
    // A normal per facet.
    let attribute_bytes = 3 * ATTRIBUTE_NUMBER * triangles.len() as u64;
    Ok(Loaded { triangles, attribute_bytes, notes })
}

/// Number of facets that the header of a binary file announces.
fn announced(bytes: &[u8]) -> Option<u32> {
    bytes.get(FREE_BYTES..HEADER_BYTES)?.try_into().ok().map(u32::from_le_bytes)
}

fn has_announced_length(bytes: &[u8]) -> bool {
    let length = announced(bytes).map(|count| HEADER_BYTES as u64 + FACET_BYTES as u64 * u64::from(count));
    length == Some(bytes.len() as u64)
}

/// Whether a file that is not as long as its binary header says is binary all the same: a text begins with `solid`, but so does the free
/// header of many a binary file, whose zero bytes then tell.
fn is_binary(bytes: &[u8]) -> bool {
    // Zero bytes may fill up a text, and DOS ends one with a mark.
    let end = bytes.iter().rposition(|byte| !matches!(*byte, 0 | 0x1a)).map_or(0, |last| last + 1);
    let bytes = &bytes[..end];
    let text = without_mark(bytes).trim_ascii_start();
    let begins =
        text.get(..5).is_some_and(|word| [b"solid", b"facet"].iter().any(|first| word.eq_ignore_ascii_case(*first)));
    !begins || bytes[..bytes.len().min(TEXT_BYTES)].contains(&0)
}

fn read_binary(blame: Blame<'_>, bytes: &[u8], notes: &mut Notes) -> Result<Vec<Triangle>, SceneError> {
    let count = announced(bytes).ok_or_else(|| {
        let message = format!("neither \"solid\" at the beginning nor the {HEADER_BYTES} bytes of a binary header");
        blame.format(Place::File, message)
    })?;
    let (facets, _) = bytes[HEADER_BYTES..].as_chunks::<FACET_BYTES>();
    if facets.len() < count as usize {
        let message = format!("the binary file is truncated: {count} facets are announced, {} are there", facets.len());
        return Err(blame.format(Place::Element("facet", facets.len() as u64), message));
    }
    let more = bytes.len() - HEADER_BYTES - FACET_BYTES * count as usize;
    if more > 0 {
        let place = Place::Element("facet", u64::from(count));
        notes.add_many(place, more as u64, "a byte after the last facet of a binary file is left out");
    }
    let mut triangles = Vec::with_capacity(count as usize);
    for (index, facet) in (0..).zip(&facets[..count as usize]) {
        let (numbers, _) = facet[NORMAL_BYTES..].as_chunks::<4>();
        let corner = |k: usize| [0, 1, 2].map(|axis| f32::from_le_bytes(numbers[3 * k + axis]));
        let [a, b, c] = [0, 1, 2].map(corner);
        for corner in [a, b, c] {
            blame.finite(Place::Element("facet", index), corner)?;
        }
        triangles.push(Triangle { a, b, c });
    }
    Ok(triangles)
}

/// What is read of a text.
struct Text<'a> {
    blame: Blame<'a>,
    triangles: Vec<Triangle>,
    polygons: Polygons,
    /// Line of the facet that has not ended.
    facet: Option<u64>,
    /// Its loops that have ended.
    loops: u32,
    corners: Vec<[f32; 3]>,
    /// Whether a solid has not ended.
    is_open: bool,
    notes: Notes,
}

impl<'a> Text<'a> {
    fn new(blame: Blame<'a>) -> Self {
        Self {
            blame,
            triangles: Vec::new(),
            polygons: Polygons::default(),
            facet: None,
            loops: 0,
            corners: Vec::new(),
            is_open: false,
            notes: Notes::default(),
        }
    }

    fn read<R: BufRead>(&mut self, mut lines: Lines<R>) -> Result<(), SceneError> {
        let mut last = 0;
        while let Some(Line { number, text }) = lines.next()? {
            last = number;
            self.line(number, text)?;
        }
        if let Some(line) = self.facet {
            return Err(self.blame.format(Place::Line(line), "the facet has no end: the file is truncated"));
        }
        if self.is_open {
            self.notes.add(Place::Line(last), "the file ends without \"endsolid\": it may be truncated");
        }
        Ok(())
    }

    fn line(&mut self, line: u64, text: &[u8]) -> Result<(), SceneError> {
        let place = Place::Line(line);
        let mut words = words(text).peekable();
        while let Some(word) = words.next() {
            let mut follows = |next: &str| words.next_if(|word| word.eq_ignore_ascii_case(next.as_bytes())).is_some();
            match word.to_ascii_lowercase().as_slice() {
                b"solid" => {
                    self.is_open = true;
                    // What follows is a name.
                    break;
                }
                b"endsolid" => {
                    self.is_open = false;
                    break;
                }
                b"end" if follows("solid") => {
                    self.is_open = false;
                    break;
                }
                b"facet" => {
                    if let Some(before) = self.facet.replace(line) {
                        return Err(self.blame.format(place, format!("the facet of line {before} has no end")));
                    }
                    // The normal, of whatever numbers.
                    while words.next_if(|word| !word.eq_ignore_ascii_case(b"outer")).is_some() {}
                }
                b"outer" => {
                    follows("loop");
                }
                b"vertex" => self.vertex(place, &mut words)?,
                b"endloop" => self.end_loop(place)?,
                b"endfacet" => self.end_facet(place)?,
                b"end" if follows("loop") => self.end_loop(place)?,
                b"end" if follows("facet") => self.end_facet(place)?,
                _ if is_blank(text) => break,
                _ => {
                    self.notes.add(place, format!("statement \"{}\" is not known", shorten(word)));
                    break;
                }
            }
        }
        Ok(())
    }

    fn vertex<'w>(&mut self, place: Place, words: &mut impl Iterator<Item = &'w [u8]>) -> Result<(), SceneError> {
        if self.facet.is_none() {
            return Err(self.blame.format(place, "a vertex outside a facet"));
        }
        let mut corner = [0.0f32; 3];
        for (value, axis) in corner.iter_mut().zip(["x", "y", "z"]) {
            let missing = || self.blame.format(place, format!("the vertex has no {axis}"));
            let word = words.next().ok_or_else(missing)?;
            let number = str::from_utf8(word).ok().and_then(|word| word.parse().ok());
            *value =
                number.ok_or_else(|| self.blame.format(place, format!("\"{}\" is not a number", shorten(word))))?;
            if !value.is_finite() {
                return Err(self.blame.not_finite(place, String::from_utf8_lossy(word)));
            }
        }
        self.corners.push(corner);
        Ok(())
    }

    /// A loop of more than three corners is a polygon.
    fn end_loop(&mut self, place: Place) -> Result<(), SceneError> {
        if self.corners.len() < 3 {
            self.notes.add(place, TOO_SMALL);
        } else {
            if !self.polygons.push(&self.corners, &mut self.triangles) {
                self.notes.add(place, CROSSING);
            }
            self.blame.limit(self.triangles.len() as u64)?;
        }
        self.loops += 1;
        self.corners.clear();
        Ok(())
    }

    fn end_facet(&mut self, place: Place) -> Result<(), SceneError> {
        if self.loops == 0 || !self.corners.is_empty() {
            self.end_loop(place)?;
        }
        self.facet = None;
        self.loops = 0;
        Ok(())
    }
}
