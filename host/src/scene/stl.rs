//! STL, binary and ASCII.

use super::error::{Blame, Place, SceneError};
use super::open::Opened;
use super::{ATTRIBUTE_NUMBER, Loaded};
use prbvh_kernel::setup::Triangle;
use std::io::Cursor;

/// Bytes before the facets of a binary file: a free header and the number of facets.
const HEADER_BYTES: usize = 84;
const FREE_BYTES: usize = 80;
const FACET_BYTES: u64 = 50;

/// Reads an STL file. Normals and attributes are passed over.
pub(super) fn read(mut opened: Opened) -> Result<Loaded, SceneError> {
    let mut bytes = opened.read_all()?;
    let blame = Blame(&opened.file);
    let mut triangles = Vec::new();
    if is_binary(&bytes) {
        // stl_io takes every file that begins with "solid " for text, but many exporters begin the free header with it.
        let free = bytes.len().min(FREE_BYTES);
        bytes[..free].fill(0);
        read_facets(blame, bytes, &mut triangles)?;
    } else {
        for solid in solids(&bytes) {
            read_facets(blame, solid, &mut triangles)?;
        }
    }
    // A normal per facet.
    let attribute_bytes = 3 * ATTRIBUTE_NUMBER * triangles.len() as u64;
    Ok(Loaded { triangles, attribute_bytes })
}

/// A file is text if it begins with `solid`, unless its length is exactly that of the binary file its header announces.
fn is_binary(bytes: &[u8]) -> bool {
    let count = bytes.get(FREE_BYTES..HEADER_BYTES).and_then(|count| count.try_into().ok()).map(u32::from_le_bytes);
    let announced = count.map(|count| HEADER_BYTES as u64 + FACET_BYTES * u64::from(count));
    !bytes.trim_ascii_start().starts_with(b"solid") || announced == Some(bytes.len() as u64)
}

/// The solids of a text file, each with the first line as stl_io wants it: `solid`, a blank, a name.
fn solids(bytes: &[u8]) -> Vec<Vec<u8>> {
    let mut solids: Vec<Vec<u8>> = Vec::new();
    for line in bytes.split_inclusive(|byte| *byte == b'\n') {
        let first_word = line.trim_ascii_start().split(u8::is_ascii_whitespace).next();
        if first_word == Some(b"solid") {
            solids.push(b"solid x\n".to_vec());
        } else if let Some(solid) = solids.last_mut() {
            solid.extend_from_slice(line);
        }
    }
    solids
}

fn read_facets(blame: Blame<'_>, bytes: Vec<u8>, triangles: &mut Vec<Triangle>) -> Result<(), SceneError> {
    let mut bytes = Cursor::new(bytes);
    let facets = stl_io::create_stl_reader(&mut bytes).map_err(|fault| blame.format(Place::File, fault.to_string()))?;
    for facet in facets {
        let place = Place::Element("facet", triangles.len() as u64);
        let [a, b, c] = facet.map_err(|fault| blame.format(place, fault.to_string()))?.vertices.map(|corner| corner.0);
        for corner in [a, b, c] {
            blame.finite(place, corner)?;
        }
        triangles.push(Triangle { a, b, c });
        blame.limit(triangles.len() as u64)?;
    }
    Ok(())
}
