//! The data of the page as JSON inside it.

use super::{Drawn, DrawnFigure};
use crate::compare::{Comparison, MethodRow, RaySettings, SceneComparison, SceneErrors};
use crate::page::figures::Figure;
use crate::report::{Machine, Program};
use prbvh::device::DeviceInfo;
use serde::Serialize;
use std::collections::BTreeMap;

/// A comparison without its runs, which may be long: those of their points that are shown are in the figures.
#[derive(Serialize)]
struct Data<'a> {
    schema: u32,
    machine: &'a Machine,
    program: &'a Program,
    devices: &'a [DeviceInfo],
    repeat: u32,
    rays: Option<RaySettings>,
    scenes: Vec<SceneData<'a>>,
    /// By file.
    figures: BTreeMap<&'a str, &'a Figure>,
}

#[derive(Serialize)]
struct SceneData<'a> {
    name: &'a str,
    hash: &'a str,
    triangles: u32,
    rows: &'a [MethodRow],
    errors: Option<&'a SceneErrors>,
}

impl<'a> From<&'a SceneComparison> for SceneData<'a> {
    fn from(scene: &'a SceneComparison) -> Self {
        Self {
            name: &scene.name,
            hash: &scene.hash,
            triangles: scene.triangles,
            rows: &scene.rows,
            errors: scene.errors.as_ref(),
        }
    }
}

/// JSON in which no browser sees a tag.
pub(super) fn json(
    comparison: &Comparison,
    overview: Option<&DrawnFigure>,
    drawn: &[Drawn],
) -> serde_json::Result<String> {
    let figures = overview.into_iter().chain(drawn.iter().flat_map(|scene| &scene.figures));
    let text = serde_json::to_string(&Data {
        schema: comparison.schema,
        machine: &comparison.machine,
        program: &comparison.program,
        devices: &comparison.devices,
        repeat: comparison.repeat,
        rays: comparison.rays,
        scenes: comparison.scenes.iter().map(SceneData::from).collect(),
        figures: figures.map(|drawn| (drawn.file.as_str(), &drawn.figure)).collect(),
    })?;
    Ok(without_tags(&text))
}

/// Inside a string of JSON, the only place where it can stand, `<` may be written as its number: no `</script>` ends the element and no
/// `<!--` changes how it is read.
fn without_tags(json: &str) -> String {
    json.replace('<', "\\u003c")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_name_ends_the_script() {
        let name = "</script><!--<script>alert(1)";
        let json = without_tags(&serde_json::to_string(name).unwrap());
        assert!(!json.contains('<'), "{json}");
        assert_eq!(serde_json::from_str::<String>(&json).unwrap(), name);
    }
}
