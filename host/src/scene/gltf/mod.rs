//! glTF and GLB: the positions of the meshes of a scene, moved by its nodes. Skins and morph targets stay at rest.

mod accessor;
mod buffers;
mod transform;

use super::error::{Blame, Place, SceneError};
use super::open::Opened;
use super::{ATTRIBUTE_NUMBER, Loaded};
use accessor::{Accessors, MOST_IMPLIED};
use gltf::json::validation::Checked;
use gltf::mesh::Mode;
use gltf::{Document, Gltf, Node, Primitive, Semantic};
use prbvh_kernel::setup::Triangle;
use std::cell::Cell;
use std::path::Path;
use transform::Transform;

/// Reads a glTF file: the default scene, else the first one, else all nodes.
pub(super) fn read(mut opened: Opened, path: &Path) -> Result<Loaded, SceneError> {
    let bytes = opened.read_all()?;
    let blame = Blame(&opened.file);
    let (document, blob) = parse(blame, &bytes)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let buffers = buffers::load(blame, &document, blob, folder)?;
    let accessors = Accessors { blame, buffers: &buffers, implied: Cell::new(MOST_IMPLIED) };

    let mut triangles = Vec::new();
    let mut attribute_bytes = 0;
    let mut seen = vec![false; document.nodes().len()];
    let mut stack: Vec<(Node<'_>, Transform)> = roots(&document).map(|node| (node, Transform::IDENTITY)).collect();
    stack.reverse();
    while let Some((node, parent)) = stack.pop() {
        // The format wants a forest, but nothing in a file keeps a node from being its own ancestor.
        if std::mem::replace(&mut seen[node.index()], true) {
            let place = Place::Element("node", node.index() as u64);
            return Err(blame.format(place, "the node has more than one parent or is its own ancestor"));
        }
        let transform = parent.then(&Transform::of(&node.transform()));
        if let Some(mesh) = node.mesh() {
            for primitive in mesh.primitives() {
                attribute_bytes = attributes(&primitive).saturating_add(attribute_bytes);
                let corners = corners(&accessors, &primitive, &transform, node.index())?;
                let faces = faces(&accessors, &primitive, corners.len())?;
                let count = triangles.len() as u64 + faces.len() as u64;
                blame.limit(count)?;
                // A small file may show a mesh many times.
                triangles
                    .try_reserve(faces.len())
                    .map_err(|_| blame.format(Place::File, format!("no memory for {count} triangles or more")))?;
                triangles.extend(faces.iter().map(|face| {
                    let [a, b, c] = face.map(|index| corners[index as usize]);
                    Triangle { a, b, c }
                }));
            }
        }
        let children: Vec<_> = node.children().map(|child| (child, transform)).collect();
        stack.extend(children.into_iter().rev());
    }
    Ok(Loaded { triangles, attribute_bytes })
}

/// Bytes of what a primitive has beside positions.
fn attributes(primitive: &Primitive<'_>) -> u64 {
    let others = primitive.attributes().filter(|(semantic, _)| *semantic != Semantic::Positions);
    let numbers = others
        .map(|(_, accessor)| (accessor.count() as u64).saturating_mul(accessor.dimensions().multiplicity() as u64));
    numbers.fold(0u64, u64::saturating_add).saturating_mul(ATTRIBUTE_NUMBER)
}

/// The valid document in `bytes`, and the binary chunk of a GLB file.
fn parse(blame: Blame<'_>, bytes: &[u8]) -> Result<(Document, Option<Vec<u8>>), SceneError> {
    // The gltf crate subtracts the size of the header from the length in it without a check.
    let length = bytes.get(8..12).and_then(|length| length.try_into().ok()).map(u32::from_le_bytes);
    if let Some(length) = length.filter(|length| bytes.starts_with(b"glTF") && *length < 12) {
        return Err(
            blame.format(Place::File, format!("the header gives a length of {length} bytes, less than its own 12"))
        );
    }
    let explain = |fault: gltf::Error| blame.format(Place::File, fault.to_string());
    let Gltf { document, blob } = Gltf::from_slice_without_validation(bytes).map_err(explain)?;
    let json = document.into_json();
    // The validation of the gltf crate takes the accessor of the positions without a check.
    let positions = Checked::Valid(Semantic::Positions);
    let primitives = json.meshes.iter().flat_map(|mesh| &mesh.primitives);
    for accessor in primitives.filter_map(|primitive| primitive.attributes.get(&positions)) {
        if accessor.value() >= json.accessors.len() {
            let message = format!("there is no such accessor: there are {}", json.accessors.len());
            return Err(blame.format(Place::Element("accessor", accessor.value() as u64), message));
        }
    }
    Ok((Document::from_json(json).map_err(explain)?, blob))
}

fn roots(document: &Document) -> Box<dyn Iterator<Item = Node<'_>> + '_> {
    if let Some(scene) = document.default_scene().or_else(|| document.scenes().next()) {
        return Box::new(scene.nodes());
    }
    let mut is_child = vec![false; document.nodes().len()];
    for child in document.nodes().flat_map(|node| node.children()) {
        is_child[child.index()] = true;
    }
    Box::new(document.nodes().filter(move |node| !is_child[node.index()]))
}

/// The positions of a primitive, moved; none for points and lines.
fn corners(
    accessors: &Accessors<'_>,
    primitive: &Primitive<'_>,
    transform: &Transform,
    node: usize,
) -> Result<Vec<[f32; 3]>, SceneError> {
    if !matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
        return Ok(Vec::new());
    }
    let Some(accessor) = primitive.get(&Semantic::Positions) else { return Ok(Vec::new()) };
    let index = accessor.index();
    let positions = accessors.positions(accessor)?;
    let moved: Vec<_> = positions.iter().map(|position| transform.apply(*position)).collect();
    for (i, (before, after)) in positions.iter().zip(&moved).enumerate() {
        accessors
            .blame
            .finite(Place::Element("vertex", i as u64), *before)
            .map_err(|fault| name(fault, index, node))?;
        accessors.blame.finite(Place::Element("vertex", i as u64), *after).map_err(|fault| name(fault, index, node))?;
    }
    Ok(moved)
}

/// A vertex number alone names no vertex in a file of many meshes.
fn name(fault: SceneError, accessor: usize, node: usize) -> SceneError {
    match fault {
        SceneError::NotFinite { file, place, value } => {
            SceneError::NotFinite { file: format!("{file}, node {node}, accessor {accessor}"), place, value }
        }
        other => other,
    }
}

/// The faces of a primitive, as indices below `corners`.
fn faces(accessors: &Accessors<'_>, primitive: &Primitive<'_>, corners: usize) -> Result<Vec<[u32; 3]>, SceneError> {
    if corners == 0 {
        return Ok(Vec::new());
    }
    let (indices, place) = match primitive.indices() {
        Some(accessor) => {
            let place = Place::Element("accessor", accessor.index() as u64);
            (accessors.indices(accessor)?, place)
        }
        None => ((0..corners as u32).collect(), Place::Element("primitive", primitive.index() as u64)),
    };
    if let Some(index) = indices.iter().find(|index| **index as usize >= corners) {
        return Err(accessors.blame.index(place, index, corners as u64));
    }
    match primitive.mode() {
        Mode::TriangleStrip => Ok(indices
            .windows(3)
            .enumerate()
            .map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] })
            .collect()),
        Mode::TriangleFan => Ok(indices.windows(2).skip(1).map(|edge| [indices[0], edge[0], edge[1]]).collect()),
        _ => match indices.as_chunks::<3>() {
            (faces, []) => Ok(faces.to_vec()),
            _ => Err(accessors
                .blame
                .format(place, format!("{} corners are no whole number of triangles", indices.len()))),
        },
    }
}
