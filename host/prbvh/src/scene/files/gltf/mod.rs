//! glTF and GLB: the positions of the meshes of a scene, moved by its nodes. Skins and morph targets stay at rest.

mod accessor;
mod buffers;
mod container;
mod document;
mod extensions;
mod instances;
mod transform;

use super::open::Opened;
use super::{ATTRIBUTE_NUMBER, Loaded};
use crate::scene::Place;
use crate::scene::error::{Blame, SceneError};
use crate::scene::files::notes::Notes;
use accessor::{Accessors, MOST_IMPLIED};
use buffers::Buffers;
use document::{Document, Mesh, Node, Primitive, Whole, get};
use instances::Instances;
use prbvh_kernel::setup::Triangle;
use std::cell::Cell;
use std::path::Path;
use transform::Transform;

/// The attribute of a primitive that holds its positions.
const POSITION: &str = "POSITION";

/// Reads a glTF file: the default scene, else the first one, else all nodes.
pub(super) fn read(mut opened: Opened, path: &Path) -> Result<Loaded, SceneError> {
    opened.check_encoding()?;
    let bytes = opened.read_all()?;
    let blame = Blame(&opened.origin.file);
    let mut notes = Notes::default();
    let (document, blob) = container::parse(blame, &bytes, &mut notes)?;
    extensions::check(blame, &document, &mut notes)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let buffers = Buffers::new(blame, &document.buffers, blob, folder);
    let accessors = Accessors { blame, document: &document, buffers, implied: Cell::new(MOST_IMPLIED) };
    let mut shown = Shown { blame, accessors, triangles: Vec::new(), attribute_bytes: 0, notes };

    let mut seen = vec![false; document.nodes.len()];
    let mut stack: Vec<(Whole, Transform)> =
        roots(blame, &document)?.into_iter().map(|node| (node, Transform::IDENTITY)).collect();
    stack.reverse();
    while let Some((index, parent)) = stack.pop() {
        let node = get(blame, &document.nodes, index, "node")?;
        // The format wants a forest, but nothing in a file keeps a node from being its own ancestor.
        if std::mem::replace(&mut seen[index.0], true) {
            let place = Place::Element("node", index.0 as u64);
            return Err(blame.format(place, "the node has more than one parent or is its own ancestor"));
        }
        let transform = parent.then(&Transform::of(node));
        if let Some(mesh) = node.mesh {
            let mesh = get(blame, &document.meshes, mesh, "mesh")?;
            shown.node(index, node, mesh, &transform)?;
        }
        stack.extend(node.children.iter().rev().map(|child| (*child, transform)));
    }
    for (index, _) in (0..).zip(&document.nodes).filter(|(index, node)| !seen[*index] && node.mesh.is_some()) {
        let place = Place::Element("node", index as u64);
        shown.notes.add(place, "a node with a mesh that is in another scene, or in none, is not read");
    }
    let Shown { triangles, attribute_bytes, notes, .. } = shown;
    Ok(Loaded { triangles, attribute_bytes, notes })
}

fn roots(blame: Blame<'_>, document: &Document) -> Result<Vec<Whole>, SceneError> {
    if let Some(scene) = document.scene {
        return Ok(get(blame, &document.scenes, scene, "scene")?.nodes.clone());
    }
    if let Some(scene) = document.scenes.first() {
        return Ok(scene.nodes.clone());
    }
    let mut is_child = vec![false; document.nodes.len()];
    for child in document.nodes.iter().flat_map(|node| &node.children) {
        get(blame, &document.nodes, *child, "node")?;
        is_child[child.0] = true;
    }
    Ok((0..is_child.len()).filter(|node| !is_child[*node]).map(Whole).collect())
}

/// What has been read of a scene.
struct Shown<'a> {
    blame: Blame<'a>,
    accessors: Accessors<'a>,
    triangles: Vec<Triangle>,
    attribute_bytes: u64,
    notes: Notes,
}

impl Shown<'_> {
    /// Adds the mesh of a node.
    fn node(&mut self, index: Whole, node: &Node, mesh: &Mesh, transform: &Transform) -> Result<(), SceneError> {
        let place = Place::Element("node", index.0 as u64);
        if node.skin.is_some() {
            self.notes.add(place, "a skin is not applied: the mesh is read as it is at rest");
        }
        let instancing = node.extensions.instancing.as_ref();
        let instances =
            instancing.map(|instancing| Instances::read(&self.accessors, instancing)).transpose()?.flatten();
        let copies = Copies { node: index, transform, instances };
        for (number, primitive) in (0..).zip(&mesh.primitives) {
            self.attribute_bytes = self.attributes(primitive).saturating_add(self.attribute_bytes);
            if let Some(why) = passed_over(primitive) {
                self.notes.add(place, why);
                continue;
            }
            if !primitive.targets.is_empty() {
                self.notes.add(place, "morph targets are not applied: the base shape is read");
            }
            self.primitive(Place::Element("primitive", number), primitive, &copies)?;
        }
        Ok(())
    }

    fn primitive(&mut self, place: Place, primitive: &Primitive, copies: &Copies<'_>) -> Result<(), SceneError> {
        let Some(&accessor) = primitive.attributes.get(POSITION) else { return Ok(()) };
        if let Some(name) = extensions::packed(&primitive.extensions) {
            for (accessor, what) in [(Some(accessor), "positions"), (primitive.indices, "indices")] {
                if let Some(accessor) = accessor
                    && self.accessors.get(accessor)?.buffer_view.is_none()
                {
                    let message = format!("its {what} are there only as {name} packs them, which is not read");
                    return Err(self.accessors.fault(accessor, message));
                }
            }
        }
        let positions = self.accessors.positions(accessor)?;
        self.finite(&positions, accessor, copies.node)?;
        let faces = self.faces(primitive, place, positions.len())?;
        let copies_count = copies.count();
        if let Some(instances) = &copies.instances {
            instances.imply(&self.accessors, faces.len())?;
        }
        let count = faces.len() as u64 * copies_count as u64 + self.triangles.len() as u64;
        self.blame.limit(count)?;
        // A small file may show a mesh many times.
        let no_memory = |_| self.blame.format(Place::File, format!("no memory for {count} triangles or more"));
        self.triangles.try_reserve(faces.len() * copies_count).map_err(no_memory)?;
        for copy in 0..copies_count {
            let transform = copies.transform(copy);
            let moved: Vec<_> = positions.iter().map(|position| transform.apply(*position)).collect();
            self.finite(&moved, accessor, copies.node)?;
            self.triangles.extend(faces.iter().map(|face| {
                let [a, b, c] = face.map(|index| moved[index as usize]);
                Triangle { a, b, c }
            }));
        }
        Ok(())
    }

    fn finite(&self, positions: &[[f32; 3]], accessor: Whole, node: Whole) -> Result<(), SceneError> {
        (0..).zip(positions).try_for_each(|(vertex, position)| {
            let checked = self.blame.finite(Place::Element("vertex", vertex), *position);
            checked.map_err(|fault| name(fault, accessor, node))
        })
    }

    /// The faces of a primitive, as indices below `corners`.
    fn faces(&self, primitive: &Primitive, place: Place, corners: usize) -> Result<Vec<[u32; 3]>, SceneError> {
        let (indices, place) = match primitive.indices {
            Some(accessor) => (self.accessors.indices(accessor)?, Place::Element("accessor", accessor.0 as u64)),
            None => ((0..corners as u32).collect(), place),
        };
        if let Some(index) = indices.iter().find(|index| **index as usize >= corners) {
            return Err(self.blame.index(place, index, corners as u64));
        }
        match primitive.mode.0 {
            STRIP => Ok(indices
                .windows(3)
                .enumerate()
                .map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] })
                .collect()),
            FAN => Ok(indices.windows(2).skip(1).map(|edge| [indices[0], edge[0], edge[1]]).collect()),
            _ => match indices.as_chunks::<3>() {
                (faces, []) => Ok(faces.to_vec()),
                _ => {
                    let message = format!("{} corners are no whole number of triangles", indices.len());
                    Err(self.blame.format(place, message))
                }
            },
        }
    }

    /// Bytes of what a primitive has beside positions.
    fn attributes(&self, primitive: &Primitive) -> u64 {
        let others = primitive.attributes.iter().filter(|(name, _)| *name != POSITION);
        let numbers = others.filter_map(|(_, index)| self.accessors.document.accessors.get(index.0)).map(|accessor| {
            let each = match accessor.shape.as_str() {
                "VEC2" => 2,
                "VEC3" => 3,
                "VEC4" | "MAT2" => 4,
                "MAT3" => 9,
                "MAT4" => 16,
                _ => 1,
            };
            (accessor.count.0 as u64).saturating_mul(each)
        });
        numbers.fold(0u64, u64::saturating_add).saturating_mul(ATTRIBUTE_NUMBER)
    }
}

/// Where a mesh stands, once or many times.
struct Copies<'a> {
    node: Whole,
    transform: &'a Transform,
    instances: Option<Instances>,
}

impl Copies<'_> {
    fn count(&self) -> usize {
        self.instances.as_ref().map_or(1, |instances| instances.count)
    }

    fn transform(&self, copy: usize) -> Transform {
        self.instances.as_ref().map_or(*self.transform, |instances| self.transform.then(&instances.transform(copy)))
    }
}

const TRIANGLES: usize = 4;
const STRIP: usize = 5;
const FAN: usize = 6;

/// Why a primitive makes no triangles.
fn passed_over(primitive: &Primitive) -> Option<String> {
    match primitive.mode.0 {
        0 => Some("a primitive of points is not read".to_owned()),
        1..=3 => Some("a primitive of lines is not read".to_owned()),
        TRIANGLES..=FAN if primitive.attributes.contains_key(POSITION) => None,
        TRIANGLES..=FAN => Some("a primitive without positions is passed over".to_owned()),
        mode => Some(format!("a primitive of mode {mode}, which is not known, is not read")),
    }
}

/// A vertex number alone names no vertex in a file of many meshes.
fn name(fault: SceneError, accessor: Whole, node: Whole) -> SceneError {
    match fault {
        SceneError::NotFinite { file, place, value } => {
            SceneError::NotFinite { file: format!("{file}, node {}, accessor {}", node.0, accessor.0), place, value }
        }
        other => other,
    }
}
