//! Costs in `compare.json` and `report.json`.

use super::{ReferenceCost, ReferenceError};
use prbvh::bvh::SahModel;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::path::Path;

/// A cost in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The cost; NaN where a row that ended well has none.
    pub cost: ReferenceCost,
    /// Wall time from triangles, seconds.
    pub build_s: Option<f64>,
}

#[derive(Deserialize)]
struct Program {
    commit: String,
}

/// What is read of `compare.json`.
#[derive(Deserialize)]
struct CompareFile {
    program: Program,
    scenes: Vec<CompareScene>,
}

#[derive(Deserialize)]
struct CompareScene {
    name: String,
    hash: String,
    triangles: u32,
    rows: Vec<CompareRow>,
}

#[derive(Deserialize)]
struct CompareRow {
    method: String,
    mu: Option<u32>,
    device: String,
    cost: Option<f64>,
    build_s: Option<f64>,
    #[serde(default)]
    references: Option<u32>,
    status: String,
}

/// What is read of `report.json`.
#[derive(Deserialize)]
struct ReportFile {
    scene: String,
    triangles: u32,
    #[serde(default)]
    references: Option<u32>,
    device: String,
    final_cost: Option<f64>,
    time_s: f64,
    build_s: f64,
    settings: ReportSettings,
    scene_details: ReportScene,
    program: Program,
}

#[derive(Deserialize)]
struct ReportSettings {
    initial: String,
    optimizer: String,
    sah: SahModel,
}

#[derive(Deserialize)]
struct ReportScene {
    hash: String,
}

/// The costs of every row of a `compare.json` that ended well, or the final one of a `report.json`; all with one triangle per leaf.
///
/// # Errors
/// If the file cannot be read or is neither.
pub fn read(path: &Path) -> Result<Vec<Found>, ReferenceError> {
    let text =
        std::fs::read_to_string(path).map_err(|source| ReferenceError::Read { path: path.to_owned(), source })?;
    costs(&path.display().to_string(), &text)
}

fn costs(name: &str, text: &str) -> Result<Vec<Found>, ReferenceError> {
    let value: serde_json::Value = parse(name, text)?;
    if value.get("scenes").is_some() { parse(name, text).map(of_comparison) } else { parse(name, text).map(of_report) }
}

pub(super) fn parse<T: DeserializeOwned>(name: &str, text: &str) -> Result<T, ReferenceError> {
    serde_json::from_str(text).map_err(|error| ReferenceError::Parse {
        name: name.to_owned(),
        line: error.line(),
        why: error.to_string(),
    })
}

fn of_comparison(file: CompareFile) -> Vec<Found> {
    let mut found = Vec::new();
    for scene in file.scenes {
        for row in scene.rows.into_iter().filter(|row| row.status == "ok") {
            // A tree with splits has other costs.
            if row.references.is_some_and(|references| references > scene.triangles) {
                continue;
            }
            let method = row.mu.map_or_else(|| row.method.clone(), |mu| format!("{} µ={mu}", row.method));
            let cost = ReferenceCost {
                scene: scene.name.clone(),
                hash: scene.hash.clone(),
                triangles: scene.triangles,
                sah: SahModel::default(),
                cost: row.cost.unwrap_or(f64::NAN),
                method: format!("{method} on {}", row.device),
                commit: file.program.commit.clone(),
            };
            found.push(Found { cost, build_s: row.build_s });
        }
    }
    found
}

fn of_report(file: ReportFile) -> Vec<Found> {
    if file.references.is_some_and(|references| references > file.triangles) {
        return Vec::new();
    }
    let cost = ReferenceCost {
        scene: file.scene,
        hash: file.scene_details.hash,
        triangles: file.triangles,
        sah: file.settings.sah,
        cost: file.final_cost.unwrap_or(f64::NAN),
        method: format!("{} from {} on {}", file.settings.optimizer, file.settings.initial, file.device),
        commit: file.program.commit,
    };
    vec![Found { cost, build_s: Some(file.build_s + file.time_s) }]
}

#[cfg(test)]
mod tests {
    use super::*;

    const COMPARISON: &str = r#"{ "program": { "commit": "c" }, "scenes": [{ "name": "hall", "hash": "h", "triangles": 9, "rows": [
        { "method": "lbvh", "mu": null, "device": "gpu", "cost": 80.0, "build_s": 1.0, "status": "ok" },
        { "method": "prbvh", "mu": 9, "device": "gpu", "cost": null, "build_s": 2.0, "status": "ok" },
        { "method": "obvhs", "mu": null, "device": "cpu (peer)", "cost": 5.0, "build_s": null, "status": "timed out" }] }] }"#;

    #[test]
    fn rows_that_ended_well_are_found() {
        let found = costs("f", COMPARISON).unwrap();
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].cost.cost, found[0].cost.method.as_str()), (80.0, "lbvh on gpu"));
        assert_eq!((found[0].cost.hash.as_str(), found[0].build_s), ("h", Some(1.0)));
        assert!(found[1].cost.cost.is_nan() && found[1].cost.method == "prbvh µ=9 on gpu");
    }

    #[test]
    fn other_files_are_refused() {
        for (text, part) in [
            ("{}", "missing field `scene`"),
            ("[1", "EOF"),
            (r#"{ "scenes": [] }"#, "missing field `program`"),
            (&COMPARISON.replace("80.0", "\"low\""), "line 2: invalid type: string"),
        ] {
            let error = costs("f", text).unwrap_err().to_string();
            assert!(error.starts_with("f, line") && error.contains(part), "{error}");
        }
    }
}
