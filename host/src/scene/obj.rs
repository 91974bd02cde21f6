//! Wavefront OBJ: `v` and `f` statements; all others are passed over.

use super::error::{Blame, Place, SceneError, shorten};
use super::open::Opened;
use super::{ATTRIBUTE_NUMBER, Loaded};
use prbvh_kernel::setup::Triangle;
use std::io::{self, BufRead, Read};
use tobj::LoadOptions;

/// Reads an OBJ file. Polygons become fans; faces of fewer than three corners hold no triangle.
pub(super) fn read(mut opened: Opened) -> Result<Loaded, SceneError> {
    let options = LoadOptions { triangulate: true, ignore_points: true, ignore_lines: true, ..Default::default() };
    let mut statements = Statements::new(&mut opened);
    let loaded = tobj::load_obj_buf(&mut statements, &options, |_| Ok(Default::default()));
    let fault = statements.fault.take();
    let attribute_bytes = statements.attributes * ATTRIBUTE_NUMBER;
    let blame = Blame(&opened.file);
    let (models, _) = match (loaded, fault) {
        (_, Some(Fault::Scene(fault))) => return Err(fault),
        (_, Some(Fault::Read(fault))) => return Err(opened.fault(fault)),
        (Err(fault), None) => return Err(blame.format(Place::File, fault.to_string())),
        (Ok(loaded), None) => loaded,
    };
    let mut triangles = Vec::new();
    for tobj::Model { mesh, .. } in models {
        let (corners, _) = mesh.positions.as_chunks::<3>();
        let (faces, _) = mesh.indices.as_chunks::<3>();
        triangles.reserve(faces.len());
        triangles.extend(faces.iter().map(|face| {
            let [a, b, c] = face.map(|index| corners[index as usize]);
            Triangle { a, b, c }
        }));
    }
    Ok(Loaded { triangles, attribute_bytes })
}

/// Why the text ended early.
enum Fault {
    Scene(SceneError),
    Read(io::Error),
}

/// The `v` and `f` statements of a file in the plainest form: three coordinates, positive indices of positions.
///
/// tobj tells neither the line nor the value of a fault, and some faults of texture and normal indices, which are of no
/// use here, make it panic. So every statement is checked on its way to it.
struct Statements<'a> {
    opened: &'a mut Opened,
    line: Vec<u8>,
    line_number: u64,
    text: Vec<u8>,
    read: usize,
    vertices: u64,
    triangles: u64,
    /// Numbers of normals and texture coordinates.
    attributes: u64,
    /// The greatest index so far, and its line: a face may come before its vertices.
    greatest: (u64, u64),
    fault: Option<Fault>,
}

/// Text handed on at a time.
const TEXT_BYTES: usize = 32 * 1024;

impl<'a> Statements<'a> {
    fn new(opened: &'a mut Opened) -> Self {
        Self {
            opened,
            line: Vec::new(),
            line_number: 0,
            text: Vec::new(),
            read: 0,
            vertices: 0,
            triangles: 0,
            attributes: 0,
            greatest: (0, 0),
            fault: None,
        }
    }

    /// Fills `text` with the next statements; leaves it empty at the end.
    fn refill(&mut self) -> Result<(), Fault> {
        self.text.clear();
        self.read = 0;
        while self.text.len() < TEXT_BYTES {
            let first = self.line_number + 1;
            if !self.next_line().map_err(Fault::Read)? {
                return self.finish().map_err(Fault::Scene);
            }
            self.statement(Place::Line(first)).map_err(Fault::Scene)?;
        }
        Ok(())
    }

    /// Reads a line, with those that a backslash joins to it. False at the end.
    fn next_line(&mut self) -> io::Result<bool> {
        self.line.clear();
        loop {
            let start = self.line.len();
            if self.opened.bytes.read_until(b'\n', &mut self.line)? == 0 {
                return Ok(start > 0);
            }
            self.line_number += 1;
            let length = self.line.trim_ascii_end().len();
            if length <= start || self.line[length - 1] != b'\\' {
                return Ok(true);
            }
            self.line.truncate(length - 1);
            self.line.push(b' ');
        }
    }

    fn statement(&mut self, place: Place) -> Result<(), SceneError> {
        let blame = Blame(&self.opened.file);
        let mut words = self.line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        match words.next() {
            Some(b"v") => {
                self.text.push(b'v');
                for axis in ["x", "y", "z"] {
                    let word = words.next().ok_or_else(|| blame.format(place, format!("the vertex has no {axis}")))?;
                    check_coordinate(blame, place, word)?;
                    self.text.push(b' ');
                    self.text.extend_from_slice(word);
                }
                self.text.push(b'\n');
                self.vertices += 1;
            }
            Some(b"f") => {
                let start = self.text.len();
                let mut corners = 0;
                self.text.push(b'f');
                for word in words {
                    let index = corner_index(blame, place, word, self.vertices)?;
                    if index > self.greatest.0 {
                        self.greatest = (index, self.line_number);
                    }
                    self.text.extend_from_slice(format!(" {index}").as_bytes());
                    corners += 1;
                }
                self.text.push(b'\n');
                if corners < 3 {
                    self.text.truncate(start);
                } else {
                    self.triangles += corners - 2;
                    blame.limit(self.triangles)?;
                }
            }
            Some(b"vn" | b"vt") => self.attributes += words.count() as u64,
            _ => {}
        }
        Ok(())
    }

    fn finish(&self) -> Result<(), SceneError> {
        let (index, line) = self.greatest;
        if index > self.vertices {
            return Err(Blame(&self.opened.file).index(Place::Line(line), index, self.vertices));
        }
        Ok(())
    }
}

fn check_coordinate(blame: Blame<'_>, place: Place, word: &[u8]) -> Result<(), SceneError> {
    match str::from_utf8(word).ok().and_then(|word| word.parse::<f32>().ok()) {
        Some(value) if value.is_finite() => Ok(()),
        Some(_) => Err(blame.not_finite(place, String::from_utf8_lossy(word))),
        None => Err(blame.format(place, format!("\"{}\" is not a number", shorten(word)))),
    }
}

/// The index of a position, from 1, of a corner such as `7`, `-1`, `7/1`, `7/1/3` or `7//3`.
fn corner_index(blame: Blame<'_>, place: Place, word: &[u8], vertices: u64) -> Result<u64, SceneError> {
    let position = word.split(|byte| *byte == b'/').next().unwrap_or_default();
    let index = str::from_utf8(position).ok().and_then(|digits| digits.parse::<i64>().ok());
    let index = index.ok_or_else(|| blame.format(place, format!("\"{}\" is not a vertex index", shorten(word))))?;
    let absolute =
        if index < 0 { vertices.checked_sub(index.unsigned_abs()).map(|i| i + 1) } else { Some(index as u64) };
    match absolute {
        Some(absolute) if absolute > 0 => Ok(absolute),
        _ => Err(blame.index(place, index, vertices)),
    }
}

impl BufRead for Statements<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.read == self.text.len()
            && self.fault.is_none()
            && let Err(fault) = self.refill()
        {
            self.fault = Some(fault);
            return Err(io::Error::other("see Statements::fault"));
        }
        Ok(&self.text[self.read..])
    }

    fn consume(&mut self, bytes: usize) {
        self.read += bytes;
    }
}

impl Read for Statements<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(buffer)?;
        self.consume(count);
        Ok(count)
    }
}
