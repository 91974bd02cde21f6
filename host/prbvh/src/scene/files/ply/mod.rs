//! PLY, binary of either byte order and text: `x`, `y`, `z` of the vertices, and the index lists of faces and of strips of triangles.

mod header;
mod values;

use super::faces::{Faces, TOO_SMALL};
use super::open::Opened;
use super::{ATTRIBUTE_NUMBER, Loaded};
use crate::scene::Place;
use crate::scene::error::{Blame, SceneError};
use crate::scene::files::notes::Notes;
use header::{Element, Encoding, Kind};
use values::{Row, Values, place_of};

/// Elements that hold no shape.
const WITHOUT_SHAPE: [&str; 4] = ["camera", "material", "multi_texture_face", "multi_texture_vertex"];

/// Reads a PLY file.
pub(super) fn read(mut opened: Opened) -> Result<Loaded, SceneError> {
    opened.check_encoding()?;
    let mut notes = Notes::default();
    let header = header::read(&mut opened, &mut notes)?;
    let file = opened.origin.file.clone();
    let blame = Blame(&file);
    let is_text = header.encoding == Encoding::Text;
    let mut values = Values::new(opened, &header);

    let mut vertices: Vec<[f32; 3]> = Vec::new();
    let mut faces = Vec::new();
    let mut attribute_bytes = 0;
    // Elements without properties have no bytes, however many the header announces.
    for element in header.elements.iter().filter(|element| !element.properties.is_empty()) {
        let place: fn(u64) -> Place = if is_text { Place::Line } else { place_of(&element.name) };
        match element.name.as_str() {
            "vertex" => {
                let axes = axes(blame, element)?;
                values.each(element, &axes, &mut notes, |number, row| {
                    let vertex = vertex(element, axes, row);
                    blame.finite(place(number), vertex)?;
                    vertices.push(vertex);
                    Ok(())
                })?;
                // Beside the three coordinates.
                let others = element.properties.len() as u64 - 3;
                attribute_bytes += others * ATTRIBUTE_NUMBER * element.count;
            }
            "face" | "tristrips" if element.count > 0 => {
                let list = list(blame, element, &mut notes)?;
                let mut kept = Faces::new(place, 0);
                let mut small = Notes::default();
                values.each(element, &[list], &mut notes, |number, row| {
                    let items = items(element, list, row);
                    match element.name.as_str() {
                        "face" => face(blame, place, &mut kept, number, items, &mut small),
                        _ => strips(blame, place, &mut kept, number, items, &mut small),
                    }
                })?;
                faces.push((kept, small));
            }
            name => {
                if !WITHOUT_SHAPE.contains(&name) && element.count > 0 {
                    notes.add_many(Place::Line(element.line), element.count, format!("element \"{name}\" is not read"));
                }
                values.each(element, &[], &mut notes, |_, _| Ok(()))?;
            }
        }
    }
    values.finish(&mut notes)?;
    let mut triangles = Vec::new();
    for (kept, small) in faces {
        notes.append(small);
        kept.triangles(blame, &vertices, &mut triangles, &mut notes)?;
    }
    Ok(Loaded { triangles, attribute_bytes, notes })
}

/// The properties `x`, `y` and `z`.
fn axes(blame: Blame<'_>, element: &Element) -> Result<[usize; 3], SceneError> {
    let mut axes = [0; 3];
    for (axis, name) in axes.iter_mut().zip(["x", "y", "z"]) {
        let is_it = |property: &header::Property| property.name == name && matches!(property.kind, Kind::Scalar(_));
        let missing = || blame.format(Place::Line(element.line), format!("the vertices have no property {name}"));
        *axis = element.properties.iter().position(is_it).ok_or_else(missing)?;
    }
    Ok(axes)
}

fn vertex(element: &Element, axes: [usize; 3], row: &Row) -> [f32; 3] {
    axes.map(|axis| row[start(element, axis, row)] as f32)
}

/// Where the numbers of a property start in a row.
fn start(element: &Element, property: usize, row: &Row) -> usize {
    element.properties[..property].iter().fold(0, |start, before| match before.kind {
        Kind::Scalar(_) => start + 1,
        Kind::List { .. } => start + 1 + row[start] as usize,
    })
}

/// The property that lists vertices.
fn list(blame: Blame<'_>, element: &Element, notes: &mut Notes) -> Result<usize, SceneError> {
    let lists = |property: &header::Property| matches!(property.kind, Kind::List { .. });
    let named = |property: &header::Property| {
        lists(property) && matches!(property.name.as_str(), "vertex_indices" | "vertex_index")
    };
    if let Some(list) = element.properties.iter().position(named) {
        return Ok(list);
    }
    let whole = |property: &header::Property| matches!(property.kind, Kind::List { item, .. } if item.is_whole());
    let mut others = (0..element.properties.len()).filter(|index| whole(&element.properties[*index]));
    match (others.next(), others.next()) {
        (Some(only), None) => {
            let name = &element.properties[only].name;
            notes.add(Place::Line(element.line), format!("the list \"{name}\" is taken for the vertex indices"));
            Ok(only)
        }
        _ => {
            let message = format!("the {} elements have no list vertex_indices", element.name);
            Err(blame.format(Place::Line(element.line), message))
        }
    }
}

fn items<'r>(element: &Element, list: usize, row: &'r Row) -> &'r Row {
    let start = start(element, list, row);
    &row[start + 1..][..row[start] as usize]
}

fn face(
    blame: Blame<'_>,
    place: fn(u64) -> Place,
    faces: &mut Faces,
    number: u64,
    items: &Row,
    notes: &mut Notes,
) -> Result<(), SceneError> {
    for item in items {
        faces.corner(index(blame, place(number), *item)?);
    }
    faces.end(blame, number, notes)
}

/// Strips of triangles one after another, with -1, or what that is without a sign, at the end of each; every other triangle is turned round.
fn strips(
    blame: Blame<'_>,
    place: fn(u64) -> Place,
    faces: &mut Faces,
    number: u64,
    items: &Row,
    notes: &mut Notes,
) -> Result<(), SceneError> {
    for strip in items.split(|item| [-1.0, f64::from(u32::MAX)].contains(item)) {
        let vertices = strip.iter().map(|item| index(blame, place(number), *item)).collect::<Result<Vec<_>, _>>()?;
        if (1..3).contains(&vertices.len()) {
            notes.add(place(number), TOO_SMALL);
        }
        for (k, corners) in vertices.windows(3).enumerate() {
            let (second, third) = if k % 2 == 0 { (1, 2) } else { (2, 1) };
            [0, second, third].into_iter().for_each(|corner| faces.corner(corners[corner]));
            faces.end(blame, number, notes)?;
        }
    }
    Ok(())
}

fn index(blame: Blame<'_>, place: Place, item: f64) -> Result<u32, SceneError> {
    if item < 0.0 {
        return Err(blame.format(place, format!("vertex index {item} is negative")));
    }
    let index = item as u32;
    if f64::from(index) != item {
        return Err(blame.format(place, format!("vertex index {item} is no whole number below 2^32")));
    }
    Ok(index)
}
