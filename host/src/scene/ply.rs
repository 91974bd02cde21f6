//! PLY, binary of either byte order and ASCII: `x`, `y`, `z` of the vertices and the index lists of the faces.

use super::error::{Blame, Place, SceneError, shorten};
use super::open::Opened;
use super::{ATTRIBUTE_NUMBER, Loaded};
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType};
use prbvh_kernel::setup::Triangle;
use std::io::{self, BufRead};

/// Reads a PLY file. Polygons become fans; faces of fewer than three corners hold no triangle.
pub(super) fn read(opened: Opened) -> Result<Loaded, SceneError> {
    let blame = Blame(&opened.file);
    let mut reader = Reader::new(opened.bytes);
    let header =
        Parser::<Vertex>::new().read_header(&mut reader).map_err(|fault| explain(blame, Place::File, &fault, ""))?;
    let mut line = reader.line() as u64;
    let mut source = Elements { bytes: reader.into_inner(), line: &mut line, encoding: header.encoding, blame };

    let mut corners: Vec<[f32; 3]> = Vec::new();
    let mut faces = Faces::default();
    let mut attribute_bytes = 0;
    for definition in elements_with_data(&header) {
        match definition.name.as_str() {
            "vertex" => {
                has_coordinates(blame, definition)?;
                source.each(definition, "vertex", |place, vertex: Vertex| {
                    blame.finite(place, vertex.0)?;
                    corners.push(vertex.0);
                    Ok(())
                })?;
                // Beside the three coordinates.
                let others = definition.properties.len() as u64 - 3;
                attribute_bytes += others * ATTRIBUTE_NUMBER * definition.count as u64;
            }
            "face" => source.each(definition, "face", |place, face: Face| faces.push(blame, place, &face))?,
            _ => source.each(definition, "element", |_, Passed| Ok(()))?,
        }
    }
    Ok(Loaded { triangles: faces.triangles(blame, &corners)?, attribute_bytes })
}

/// Elements without properties have no bytes, however many the header announces.
fn elements_with_data(header: &Header) -> impl Iterator<Item = &ElementDef> {
    header.elements.values().filter(|definition| !definition.properties.is_empty())
}

fn has_coordinates(blame: Blame<'_>, definition: &ElementDef) -> Result<(), SceneError> {
    for axis in ["x", "y", "z"] {
        match definition.properties.get(axis).map(|property| &property.data_type) {
            Some(PropertyType::Scalar(_)) => {}
            _ => return Err(blame.format(Place::File, format!("the vertices have no property {axis}"))),
        }
    }
    Ok(())
}

fn explain(blame: Blame<'_>, place: Place, fault: &ParseError, context: &str) -> SceneError {
    let place = fault.line().map_or(place, |line| Place::Line(line as u64));
    let text = fault.to_string();
    let text =
        text.split_once(": ").filter(|(head, _)| head.starts_with("Line ")).map_or(text.as_str(), |(_, rest)| rest);
    let words = text.split_whitespace().map(|word| shorten(word.as_bytes())).collect::<Vec<_>>().join(" ");
    blame.format(place, words + context)
}

/// The data after the header, element by element: a list of all elements as the crate makes it needs several times the memory.
struct Elements<'a, B: BufRead> {
    bytes: B,
    line: &'a mut u64,
    encoding: Encoding,
    blame: Blame<'a>,
}

impl<B: BufRead> Elements<'_, B> {
    fn each<E: PropertyAccess>(
        &mut self,
        definition: &ElementDef,
        kind: &'static str,
        mut take: impl FnMut(Place, E) -> Result<(), SceneError>,
    ) -> Result<(), SceneError> {
        let parser = Parser::<E>::new();
        let mut text = String::new();
        for index in 0..definition.count as u64 {
            let mut place = Place::Element(kind, index);
            let element = match self.encoding {
                Encoding::Ascii => {
                    text.clear();
                    let read = self.bytes.read_line(&mut text).map_err(ParseError::from);
                    place = Place::Line(*self.line);
                    *self.line += 1;
                    match read {
                        Ok(0) => Err(ParseError::from(io::Error::new(
                            io::ErrorKind::UnexpectedEof,
                            format!("the file ends at {kind} {index} of {}", definition.count),
                        ))),
                        Ok(_) => parser.read_ascii_element(&text, definition),
                        Err(fault) => Err(fault),
                    }
                }
                Encoding::BinaryBigEndian => parser.read_big_endian_element(&mut self.bytes, definition),
                Encoding::BinaryLittleEndian => parser.read_little_endian_element(&mut self.bytes, definition),
            };
            let element = element.map_err(|fault| match fault.kind() {
                io::ErrorKind::UnexpectedEof => self
                    .blame
                    .format(place, format!("the file is truncated: {index} of {} are there", definition.count)),
                _ if self.encoding == Encoding::Ascii => {
                    explain(self.blame, place, &fault, &format!(", in \"{}\"", shorten(text.trim().as_bytes())))
                }
                _ => explain(self.blame, place, &fault, ""),
            })?;
            take(place, element)?;
        }
        Ok(())
    }
}

/// Position of a vertex.
struct Vertex([f32; 3]);

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self([0.0; 3])
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let axis = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            _ => return PropertyAccessResult::Ignored,
        };
        match property.to_f32_lossy() {
            Some(value) => self.0[axis] = value,
            None => return PropertyAccessResult::UnsupportedType,
        }
        PropertyAccessResult::Set
    }
}

/// Vertex indices of a face; a negative one stays as it is, to be named in the error.
struct Face(Vec<i64>);

impl PropertyAccess for Face {
    fn new() -> Self {
        Self(Vec::new())
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !matches!(name, "vertex_indices" | "vertex_index") {
            return PropertyAccessResult::Ignored;
        }
        self.0 = match property {
            Property::ListChar(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUChar(list) => list.into_iter().map(i64::from).collect(),
            Property::ListShort(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUShort(list) => list.into_iter().map(i64::from).collect(),
            Property::ListInt(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUInt(list) => list.into_iter().map(i64::from).collect(),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

/// An element of no use here.
struct Passed;

impl PropertyAccess for Passed {
    fn new() -> Self {
        Self
    }
}

/// Faces, kept until all vertices are known: the elements may come in any order.
#[derive(Default)]
struct Faces {
    indices: Vec<u32>,
    /// Per face of three corners or more: where it ends in `indices`, and its place.
    faces: Vec<(usize, Place)>,
    triangles: u64,
}

impl Faces {
    fn push(&mut self, blame: Blame<'_>, place: Place, face: &Face) -> Result<(), SceneError> {
        if face.0.len() < 3 {
            return Ok(());
        }
        for index in &face.0 {
            let known = u32::try_from(*index);
            self.indices.push(known.map_err(|_| blame.format(place, format!("vertex index {index} is negative")))?);
        }
        self.faces.push((self.indices.len(), place));
        self.triangles += face.0.len() as u64 - 2;
        blame.limit(self.triangles)
    }

    fn triangles(&self, blame: Blame<'_>, corners: &[[f32; 3]]) -> Result<Vec<Triangle>, SceneError> {
        let mut triangles = Vec::with_capacity(self.triangles as usize);
        let mut start = 0;
        for (end, place) in &self.faces {
            let corner = |index: &u32| {
                corners.get(*index as usize).copied().ok_or_else(|| blame.index(*place, index, corners.len() as u64))
            };
            let face = self.indices[start..*end].iter().map(corner).collect::<Result<Vec<_>, _>>()?;
            let fan = face.windows(2).skip(1).map(|edge| Triangle { a: face[0], b: edge[0], c: edge[1] });
            triangles.extend(fan);
            start = *end;
        }
        Ok(triangles)
    }
}
