//! The header of a PLY file: what elements follow, of which properties.

use super::super::format::without_mark;
use super::super::lines::{is_blank, words};
use super::super::open::Opened;
use crate::scene::Place;
use crate::scene::error::{Blame, SceneError, shorten};
use crate::scene::files::notes::Notes;
use std::io::{BufRead, Read};

/// How the elements are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

/// Types of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Number {
    fn named(name: &[u8]) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_slice() {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"int64" => Self::I64,
            b"uint64" => Self::U64,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    pub(super) fn is_whole(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

/// What a property is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar(Number),
    List { length: Number, item: Number },
}

/// Names are in lower case.
#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
    /// Line of the header.
    pub(super) line: u64,
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Lines of the header.
    pub(super) lines: u64,
}

/// Reads the header, and leaves the bytes after it.
pub(super) fn read(opened: &mut Opened, notes: &mut Notes) -> Result<Header, SceneError> {
    let end = line_end(&opened.head);
    let Opened { bytes, origin, .. } = opened;
    let blame = Blame(&origin.file);
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut line = Vec::new();
    let mut number = 0;
    loop {
        number += 1;
        line.clear();
        // As long as a line of a binary file under a wrong name may be.
        let read =
            bytes.by_ref().take(LONGEST_LINE).read_until(end, &mut line).map_err(|source| origin.fault(source))?;
        let place = Place::Line(number);
        if read == 0 {
            return Err(blame.format(place, "the header has no end_header"));
        }
        let text = if number == 1 { without_mark(&line) } else { &line }.trim_ascii();
        let fault = |what: &str| blame.format(place, format!("{what}: \"{}\"", shorten(text)));
        let mut words = words(text);
        let keyword = words.next().unwrap_or_default().to_ascii_lowercase();
        match keyword.as_slice() {
            b"ply" if number == 1 => {}
            _ if number == 1 => return Err(fault("the file does not begin with \"ply\"")),
            b"" | b"comment" | b"obj_info" => {}
            b"format" => {
                let named = words.next().and_then(encoding_named).ok_or_else(|| fault("a format that is not known"))?;
                if encoding.replace(named).is_some_and(|before| before != named) {
                    return Err(fault("a second format"));
                }
            }
            b"element" => {
                let name = words.next().map(lower_case);
                let count = words.next().and_then(|count| str::from_utf8(count).ok()?.parse().ok());
                let (Some(name), Some(count)) = (name, count) else {
                    return Err(fault("an element needs a name and a number"));
                };
                elements.push(Element { name, count, properties: Vec::new(), line: number });
            }
            b"property" => {
                let element = elements.last_mut().ok_or_else(|| fault("a property before the first element"))?;
                element.properties.push(property(words).ok_or_else(|| fault("a property that is not known"))?);
            }
            b"end_header" => {
                let encoding = encoding.ok_or_else(|| blame.format(Place::File, "the header has no format"))?;
                return Ok(Header { encoding, elements, lines: number });
            }
            _ if is_blank(text) => {}
            other => notes.add(place, format!("\"{}\" of the header is not known", shorten(other))),
        }
    }
}

const LONGEST_LINE: u64 = 1 << 16;

/// What the lines of the header end with, as the first one tells: a line feed, or a carriage return by itself. Elsewhere in a binary
/// file either may be data.
fn line_end(head: &[u8]) -> u8 {
    let mut from_end = head.iter().skip_while(|byte| !matches!(byte, b'\n' | b'\r'));
    match (from_end.next(), from_end.next()) {
        (Some(b'\r'), next) if next != Some(&b'\n') => b'\r',
        _ => b'\n',
    }
}

fn encoding_named(name: &[u8]) -> Option<Encoding> {
    match name.to_ascii_lowercase().as_slice() {
        b"ascii" => Some(Encoding::Text),
        b"binary_little_endian" => Some(Encoding::LittleEndian),
        b"binary_big_endian" => Some(Encoding::BigEndian),
        _ => None,
    }
}

fn property<'w>(mut words: impl Iterator<Item = &'w [u8]>) -> Option<Property> {
    let word = words.next()?;
    let kind = if word.eq_ignore_ascii_case(b"list") {
        let length = Number::named(words.next()?).filter(|number| number.is_whole())?;
        Kind::List { length, item: Number::named(words.next()?)? }
    } else {
        Kind::Scalar(Number::named(word)?)
    };
    Some(Property { name: words.next().map(lower_case)?, kind })
}

fn lower_case(word: &[u8]) -> String {
    String::from_utf8_lossy(word).to_lowercase()
}
