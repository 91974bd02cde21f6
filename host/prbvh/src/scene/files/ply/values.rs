//! The numbers after the header, element by element.

use super::super::lines::{Lines, is_blank};
use super::super::open::Opened;
use super::super::origin::Origin;
use super::header::{Element, Encoding, Header, Kind, Number};
use crate::scene::Place;
use crate::scene::error::{Blame, SceneError, shorten};
use crate::scene::files::notes::Notes;
use std::io::{self, BufRead};

/// The numbers of an element: all properties in turn, a list as its length and then its items. A float32, and a whole number that
/// indices need, is exact as a float64.
pub(super) type Row = [f64];

/// Reads elements in the order of the file.
pub(super) enum Values {
    Text(Text),
    Binary { bytes: Box<dyn BufRead>, origin: Origin, is_big: bool },
}

/// Elements have a line each, but some writers break long ones.
pub(super) struct Text {
    lines: Lines<Box<dyn BufRead>>,
    /// The line that is being read, and how much of it has been.
    line: Vec<u8>,
    read: usize,
    number: u64,
    /// Whether the element began on an earlier line.
    is_broken: bool,
}

impl Values {
    pub(super) fn new(opened: Opened, header: &Header) -> Self {
        let Opened { bytes, origin, .. } = opened;
        match header.encoding {
            Encoding::Text => {
                let lines = Lines::from(origin, bytes, header.lines);
                Self::Text(Text { lines, line: Vec::new(), read: 0, number: header.lines, is_broken: false })
            }
            encoding => Self::Binary { bytes, origin, is_big: encoding == Encoding::BigEndian },
        }
    }

    fn origin(&self) -> &Origin {
        match self {
            Self::Text(text) => &text.lines.origin,
            Self::Binary { origin, .. } => origin,
        }
    }

    /// Reads all of an element, and gives each to `take` with the number of its line, or its own. Words of a text that are no numbers are
    /// faults only in the properties that are needed.
    pub(super) fn each(
        &mut self,
        element: &Element,
        needed: &[usize],
        notes: &mut Notes,
        mut take: impl FnMut(u64, &Row) -> Result<(), SceneError>,
    ) -> Result<(), SceneError> {
        let place = place_of(&element.name);
        let file = self.origin().file.clone();
        let blame = Blame(&file);
        let mut row = Vec::new();
        for index in 0..element.count {
            row.clear();
            let mut at = index;
            if let Self::Text(text) = self {
                at = text.begin()?.unwrap_or(text.number);
            }
            let place = if matches!(self, Self::Text(_)) { Place::Line(at) } else { place(index) };
            let truncated = || {
                let message =
                    format!("the file is truncated: {index} of {} {} elements are there", element.count, element.name);
                blame.format(place, message)
            };
            for (k, property) in element.properties.iter().enumerate() {
                let is_needed = needed.contains(&k);
                let (count, item) = match property.kind {
                    Kind::Scalar(number) => (1, number),
                    Kind::List { length, item } => {
                        let length = self.number(blame, place, length, true)?.ok_or_else(truncated)?;
                        if length < 0.0 || length.fract() != 0.0 {
                            let message = format!("{length} is no length of the list {}", property.name);
                            return Err(blame.format(place, message));
                        }
                        row.push(length);
                        (length as u64, item)
                    }
                };
                for _ in 0..count {
                    row.push(self.number(blame, place, item, is_needed)?.ok_or_else(truncated)?);
                }
            }
            if let Self::Text(text) = self {
                text.end(blame, place, notes)?;
            }
            take(at, &row)?;
        }
        Ok(())
    }

    /// The next number; none at the end of the file.
    fn number(
        &mut self,
        blame: Blame<'_>,
        place: Place,
        number: Number,
        is_needed: bool,
    ) -> Result<Option<f64>, SceneError> {
        match self {
            Self::Text(text) => text.number(blame, place, number, is_needed),
            Self::Binary { bytes, origin, is_big } => match binary(bytes, *is_big, number) {
                Ok(value) => Ok(Some(value)),
                Err(fault) if fault.kind() == io::ErrorKind::UnexpectedEof => Ok(None),
                Err(fault) => Err(origin.fault(fault)),
            },
        }
    }

    /// Notes what comes after the last element.
    pub(super) fn finish(&mut self, notes: &mut Notes) -> Result<(), SceneError> {
        match self {
            Self::Text(text) => {
                while let Some(line) = text.begin()? {
                    notes.add(Place::Line(line), "a line after the last element is left out");
                    text.read = text.line.len();
                }
            }
            Self::Binary { bytes, origin, .. } => {
                let left = io::copy(bytes, &mut io::sink()).map_err(|fault| origin.fault(fault))?;
                if left > 0 {
                    notes.add_many(Place::File, left, "a byte after the last element is left out");
                }
            }
        }
        Ok(())
    }
}

impl Text {
    /// Goes to the next line that is not blank, and returns its number; none at the end of the file.
    fn begin(&mut self) -> Result<Option<u64>, SceneError> {
        self.is_broken = false;
        loop {
            let Some(line) = self.lines.next()? else { return Ok(None) };
            if !is_blank(line.text) {
                self.line.clear();
                self.line.extend_from_slice(line.text);
                (self.read, self.number) = (0, line.number);
                return Ok(Some(line.number));
            }
        }
    }

    fn rest(&self) -> &[u8] {
        self.line[self.read..].trim_ascii_start()
    }

    fn number(
        &mut self,
        blame: Blame<'_>,
        place: Place,
        number: Number,
        is_needed: bool,
    ) -> Result<Option<f64>, SceneError> {
        if self.rest().is_empty() {
            if self.begin()?.is_none() {
                return Ok(None);
            }
            self.is_broken = true;
        }
        let rest = self.rest();
        let word = &rest[..rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len())];
        let text = str::from_utf8(word).ok();
        // Straight to float32: by way of a float64 it would be rounded twice.
        let value = match number {
            Number::F32 => text.and_then(|text| text.parse::<f32>().ok()).map(f64::from),
            _ => text.and_then(|text| text.parse().ok()),
        };
        let read = self.line.len() - rest.len() + word.len();
        match value {
            None if is_needed => {
                let line = shorten(self.line.trim_ascii());
                Err(blame.format(place, format!("\"{}\" is not a number, in \"{line}\"", shorten(word))))
            }
            // Such as the "-nan(ind)" of a normal.
            value => {
                self.read = read;
                Ok(Some(value.unwrap_or(f64::NAN)))
            }
        }
    }

    /// Ends an element. More words than it has numbers are of no use; but after an element of several lines they may be of the next one.
    fn end(&mut self, blame: Blame<'_>, place: Place, notes: &mut Notes) -> Result<(), SceneError> {
        if !self.rest().is_empty() {
            if self.is_broken {
                let message = format!("the element of several lines does not end with line {}", self.number);
                return Err(blame.format(place, message));
            }
            notes.add(place, "numbers after those of an element are left out");
            self.read = self.line.len();
        }
        Ok(())
    }
}

/// From the number of an element to its place.
pub(super) fn place_of(name: &str) -> fn(u64) -> Place {
    match name {
        "vertex" => |index| Place::Element("vertex", index),
        "face" => |index| Place::Element("face", index),
        "tristrips" => |index| Place::Element("tristrips", index),
        _ => |index| Place::Element("element", index),
    }
}

fn binary(bytes: &mut impl BufRead, is_big: bool, number: Number) -> io::Result<f64> {
    macro_rules! value {
        ($type:ty) => {{
            let mut value = [0; size_of::<$type>()];
            bytes.read_exact(&mut value)?;
            if is_big { <$type>::from_be_bytes(value) } else { <$type>::from_le_bytes(value) }
        }};
    }
    Ok(match number {
        Number::I8 => value!(i8).into(),
        Number::U8 => value!(u8).into(),
        Number::I16 => value!(i16).into(),
        Number::U16 => value!(u16).into(),
        Number::I32 => value!(i32).into(),
        Number::U32 => value!(u32).into(),
        Number::I64 => value!(i64) as f64,
        Number::U64 => value!(u64) as f64,
        Number::F32 => value!(f32).into(),
        Number::F64 => value!(f64),
    })
}
