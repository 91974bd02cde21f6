//! Wavefront OBJ: the polygons of `v` and `f` statements.
//!
//! Statements end with their line, or go on after a backslash; `#` starts a comment. Neither holds for a statement that names something:
//! a Windows path may end in a backslash, and a material may be called `#1`.

use super::faces::Faces;
use super::lines::{Line, is_blank, words};
use super::open::Opened;
use super::{ATTRIBUTE_NUMBER, Loaded};
use crate::scene::Place;
use crate::scene::error::{Blame, SceneError, shorten};
use crate::scene::files::notes::Notes;

/// Statements whose words are names.
const NAMES: [&str; 10] = ["usemtl", "mtllib", "o", "g", "usemap", "maplib", "shadow_obj", "trace_obj", "call", "csh"];

/// Statements that hold no triangles: attributes, groups, looks, and what only matters to curves and surfaces.
const WITHOUT_TRIANGLES: [&str; 25] = [
    "vn", "vt", "vp", "s", "mg", "bevel", "c_interp", "d_interp", "lod", "ctech", "stech", "cstype", "deg", "bmat",
    "step", "parm", "trim", "hole", "scrv", "sp", "end", "con", "curv2", "res", "mtl",
];

/// Statements that hold a shape which is not read, with what it is.
const SHAPES: [(&str, &str); 10] = [
    ("p", "points"),
    ("l", "lines"),
    ("curv", "curves"),
    ("surf", "surfaces"),
    ("bsp", "B-spline patches"),
    ("bzp", "Bézier patches"),
    ("cdc", "Cardinal curves"),
    ("cdp", "Cardinal patches"),
    ("call", "the statements of another file"),
    ("csh", "commands"),
];

/// Reads an OBJ file.
pub(super) fn read(opened: Opened) -> Result<Loaded, SceneError> {
    let file = opened.origin.file.clone();
    let mut lines = opened.lines()?;
    let mut statements = Statements::new(Blame(&file));
    // What a backslash joined so far, and its first line.
    let mut joined: Option<(u64, Vec<u8>)> = None;
    while let Some(Line { number, text }) = lines.next()? {
        let text = text.trim_ascii_start();
        if joined.is_none() && is_name(text) {
            statements.read(number, text)?;
            continue;
        }
        let text = before_comment(text).trim_ascii_end();
        let (part, goes_on) = text.strip_suffix(b"\\").map_or((text, false), |part| (part, true));
        match &mut joined {
            None if !goes_on => statements.read(number, part)?,
            None => joined = Some((number, [part, b" "].concat())),
            Some((first, whole)) => {
                whole.extend_from_slice(part);
                whole.push(b' ');
                if !goes_on {
                    statements.read_joined(*first, whole)?;
                    joined = None;
                }
            }
        }
    }
    if let Some((first, whole)) = joined {
        statements.read_joined(first, &whole)?;
    }
    statements.finish()
}

/// In a vertex a comment follows a blank: there `1.#QNAN` is what some programs write for no number.
fn before_comment(text: &[u8]) -> &[u8] {
    let is_vertex = matches!(text, [b'v' | b'V', next, ..] if next.is_ascii_whitespace());
    let begins = |at: &usize| text[*at] == b'#' && !(is_vertex && *at > 0 && !text[*at - 1].is_ascii_whitespace());
    &text[..(0..text.len()).find(begins).unwrap_or(text.len())]
}

/// Whether the first word of a line is one that names something.
fn is_name(text: &[u8]) -> bool {
    // Nearly all lines begin with one of these letters, and none of the names does.
    !matches!(text.first(), None | Some(b'v' | b'f' | b'#'))
        && words(text).next().is_some_and(|word| is_one_of(word, &NAMES))
}

fn is_one_of(word: &[u8], names: &[&str]) -> bool {
    names.iter().any(|name| word.eq_ignore_ascii_case(name.as_bytes()))
}

fn is_statement(word: &[u8]) -> bool {
    is_one_of(word, &["v", "f", "fo"])
        || is_one_of(word, &WITHOUT_TRIANGLES)
        || is_one_of(word, &NAMES)
        || shape(word).is_some()
}

/// The statement that holds a shape which is not read, and what that is.
fn shape(word: &[u8]) -> Option<&'static (&'static str, &'static str)> {
    SHAPES.iter().find(|(name, _)| word.eq_ignore_ascii_case(name.as_bytes()))
}

/// The statements so far.
struct Statements<'a> {
    blame: Blame<'a>,
    vertices: Vec<[f32; 3]>,
    /// A face may come before its vertices.
    faces: Faces,
    /// Numbers of normals and texture coordinates.
    attributes: u64,
    notes: Notes,
}

impl<'a> Statements<'a> {
    fn new(blame: Blame<'a>) -> Self {
        let faces = Faces::new(Place::Line, 1);
        Self { blame, vertices: Vec::new(), faces, attributes: 0, notes: Notes::default() }
    }

    fn read(&mut self, line: u64, text: &[u8]) -> Result<(), SceneError> {
        let mut words = words(text);
        match words.next() {
            None => {}
            Some(b"v" | b"V") => self.vertex(Place::Line(line), words)?,
            // `fo` is what version 2 of the format called it.
            Some(word) if is_one_of(word, &["f", "fo"]) => self.face(line, words)?,
            Some(b"vn" | b"vt") => self.attributes += words.count() as u64,
            Some(word) => self.other(Place::Line(line), word, text),
        }
        Ok(())
    }

    /// A statement of several lines. A backslash too many joins the next one, which must not get lost.
    fn read_joined(&mut self, line: u64, text: &[u8]) -> Result<(), SceneError> {
        let is_vertex = words(text).next().is_some_and(|word| is_one_of(word, &["v"]));
        // Some statements of curves have the names of others among their words.
        let is_lost = |word: &&[u8]| is_one_of(word, &["v", "f", "fo"]) || (is_vertex && is_statement(word));
        if let Some(word) = words(text).skip(1).find(is_lost) {
            let message = format!("a backslash joins the statement \"{}\" to one before", shorten(word));
            return Err(self.blame.format(Place::Line(line), message));
        }
        self.read(line, text)
    }

    /// A vertex; a weight or a colour may follow the coordinates.
    fn vertex<'w>(&mut self, place: Place, mut words: impl Iterator<Item = &'w [u8]>) -> Result<(), SceneError> {
        let mut vertex = [0.0; 3];
        for (value, axis) in vertex.iter_mut().zip(["x", "y", "z"]) {
            let missing = || self.blame.format(place, format!("the vertex has no {axis}"));
            let word = words.next().ok_or_else(missing)?;
            *value = number(self.blame, place, word)?;
            if !value.is_finite() {
                return Err(self.blame.not_finite(place, String::from_utf8_lossy(word)));
            }
        }
        self.vertices.push(vertex);
        Ok(())
    }

    fn face<'w>(&mut self, line: u64, words: impl Iterator<Item = &'w [u8]>) -> Result<(), SceneError> {
        for word in words {
            let vertex = corner(self.blame, Place::Line(line), word, self.vertices.len() as u64)?;
            self.faces.corner(vertex);
        }
        self.faces.end(self.blame, line, &mut self.notes)
    }

    /// A statement that makes no triangles.
    fn other(&mut self, place: Place, word: &[u8], text: &[u8]) {
        if let Some((name, what)) = shape(word) {
            self.notes.add(place, format!("statement \"{name}\" ({what}) is not read"));
        } else if !is_statement(word) && !is_blank(text) {
            self.notes.add(place, format!("statement \"{}\" is not known", shorten(word)));
        }
    }

    fn finish(mut self) -> Result<Loaded, SceneError> {
        let mut triangles = Vec::new();
        self.faces.triangles(self.blame, &self.vertices, &mut triangles, &mut self.notes)?;
        let attribute_bytes = self.attributes * ATTRIBUTE_NUMBER;
        Ok(Loaded { triangles, attribute_bytes, notes: self.notes })
    }
}

fn number(blame: Blame<'_>, place: Place, word: &[u8]) -> Result<f32, SceneError> {
    let value = str::from_utf8(word).ok().and_then(|word| word.parse().ok());
    value.ok_or_else(|| blame.format(place, format!("\"{}\" is not a number", shorten(word))))
}

/// The vertex, from 0, of a corner such as `7`, `-1`, `7/1`, `7/1/3` or `7//3`, which count from 1, or back from the last vertex so far.
fn corner(blame: Blame<'_>, place: Place, word: &[u8], vertices: u64) -> Result<u32, SceneError> {
    let position = word.split(|byte| *byte == b'/').next().unwrap_or_default();
    let index = str::from_utf8(position).ok().and_then(|digits| digits.parse::<i64>().ok());
    let index = index.ok_or_else(|| blame.format(place, format!("\"{}\" is not a vertex index", shorten(word))))?;
    let vertex = match index {
        ..0 => vertices.checked_sub(index.unsigned_abs()),
        _ => (index as u64).checked_sub(1),
    };
    vertex.and_then(|vertex| u32::try_from(vertex).ok()).ok_or_else(|| blame.index(place, index, vertices))
}
