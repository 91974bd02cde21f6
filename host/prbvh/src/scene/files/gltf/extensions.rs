//! Which extensions change positions.

use super::document::Document;
use crate::scene::Place;
use crate::scene::error::{Blame, SceneError};
use crate::scene::files::notes::Notes;
use std::collections::BTreeMap;

/// Shows a mesh many times.
pub(super) const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// Extensions that are read.
const READ: [&str; 2] = ["KHR_mesh_quantization", INSTANCING];

/// Extensions that pack positions; where one is only used, the file has them plain as well.
const PACKED: [&str; 3] = ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Beginnings of the names of extensions that leave positions alone: looks, lights, sounds, and data about the scene.
const HARMLESS: [&str; 33] = [
    "KHR_materials_",
    "KHR_texture_",
    "KHR_lights_",
    "KHR_animation_",
    "KHR_audio",
    "KHR_xmp",
    "KHR_techniques_webgl",
    "KHR_interactivity",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_environment_map",
    "KHR_physics_",
    "KHR_collision_shapes",
    "EXT_materials_",
    "EXT_texture_",
    "EXT_lights_",
    "EXT_mesh_features",
    "EXT_instance_features",
    "EXT_structural_metadata",
    "EXT_feature_metadata",
    "EXT_mesh_primitive_edge_visibility",
    "EXT_mesh_manifold",
    "MSFT_texture_",
    "MSFT_packing_",
    "MSFT_lod",
    "MSFT_audio",
    "ADOBE_materials_",
    "NV_materials_",
    "AGI_stk_metadata",
    "FB_geometry_metadata",
    "GODOT_single_root",
    "VRM",
    "OMI_",
];

fn is_harmless(name: &str) -> bool {
    HARMLESS.iter().any(|beginning| name.starts_with(beginning))
}

/// Refuses what is required and not read, and notes what is used and not read.
pub(super) fn check(blame: Blame<'_>, document: &Document, notes: &mut Notes) -> Result<(), SceneError> {
    for name in &document.extensions_required {
        let name = name.as_str();
        if !READ.contains(&name) && !is_harmless(name) {
            let what = if PACKED.contains(&name) { "packs positions and is not read" } else { "is not known" };
            return Err(blame.format(Place::File, format!("the file requires the extension {name}, which {what}")));
        }
    }
    for name in &document.extensions_used {
        let name = name.as_str();
        if PACKED.contains(&name) {
            notes.add(Place::File, format!("extension {name} is not read; the plain positions are"));
        } else if !READ.contains(&name) && !is_harmless(name) {
            notes.add(Place::File, format!("extension {name} is not known"));
        }
    }
    Ok(())
}

/// The first extension of an object that packs what it holds.
pub(super) fn packed<T>(extensions: &BTreeMap<String, T>) -> Option<&str> {
    extensions.keys().map(String::as_str).find(|name| PACKED.contains(name))
}
