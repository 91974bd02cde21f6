//! `summary.jsonl`: what became of each of many scenes, a line each. The last line of a scene counts.

use anyhow::Context;
use prbvh::bvh;
use prbvh_lab::report::RunReport;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Name of the file.
pub(super) const SUMMARY: &str = "summary.jsonl";

/// Version of a line; grows when a key changes its meaning or goes away.
const SCHEMA: u32 = 1;

/// Of a report, what a line has.
const OUTCOME: [&str; 12] = [
    "triangles",
    "device",
    "initial_cost",
    "final_cost",
    "adaptive_cost",
    "leaves",
    "depth",
    "iterations",
    "build_s",
    "time_s",
    "tree_hash",
    "stop_reason",
];

/// What became of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Status {
    /// Optimised, and its set is whole.
    Done,
    /// Done before, and left as it was.
    Skipped,
    /// Ended by a signal, with the best tree so far.
    Interrupted,
    /// There is no tree, or it is not to be trusted.
    Failed,
}

/// A line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Line {
    schema: u32,
    /// As it was named to the program.
    pub(super) scene: String,
    /// Of its folder.
    pub(super) name: String,
    pub(super) status: Status,
    /// Why it failed.
    pub(super) error: Option<String>,
    scene_hash: Option<String>,
    /// What the tree follows from, beside the triangles.
    settings: Option<Value>,
    #[serde(flatten)]
    outcome: Map<String, Value>,
}

impl Line {
    pub(super) fn failed(scene: String, name: String, error: String) -> Self {
        Self {
            schema: SCHEMA,
            scene,
            name,
            status: Status::Failed,
            error: Some(error),
            scene_hash: None,
            settings: None,
            outcome: Map::new(),
        }
    }

    /// Of a run with a report, by the settings that [`Summary::done`] is to compare.
    pub(super) fn of(
        scene: String,
        name: String,
        status: Status,
        settings: Value,
        report: &RunReport,
    ) -> serde_json::Result<Self> {
        let all = serde_json::to_value(report)?;
        let outcome = OUTCOME.into_iter().map(|key| (key.to_owned(), all[key].clone())).collect();
        let scene_hash = Some(report.scene_details.hash.clone());
        Ok(Self { schema: SCHEMA, scene, name, status, error: None, scene_hash, settings: Some(settings), outcome })
    }

    /// The same of a scene that was done before.
    pub(super) fn left_as_it_was(mut self) -> Self {
        self.status = Status::Skipped;
        self
    }

    /// A number of the outcome.
    pub(super) fn number(&self, key: &str) -> Option<f64> {
        self.outcome.get(key)?.as_f64()
    }

    /// Whether the folder holds the whole set that the line is about.
    fn is_whole(&self, folder: &Path) -> bool {
        let read = || -> Option<bool> {
            let tree = bvh::file::read(&folder.join("tree.bvh")).ok()?;
            let report: Value = serde_json::from_slice(&std::fs::read(folder.join("report.json")).ok()?).ok()?;
            let hash = Value::from(bvh::tree_hash(&tree.tree));
            let is_of = |said: Option<&Value>| said == Some(&hash);
            let has_bytes =
                |name: &&str| folder.join(name).metadata().is_ok_and(|file| file.is_file() && file.len() > 0);
            let others = ["iterations.csv", "convergence.svg"].iter().all(has_bytes);
            Some(
                others
                    && is_of(self.outcome.get("tree_hash"))
                    && is_of(report.get("tree_hash"))
                    && self.scene_hash.as_ref() == Some(&tree.scene_hash),
            )
        };
        read().unwrap_or(false)
    }
}

/// The file, open for more lines.
#[derive(Debug)]
pub(super) struct Summary {
    path: PathBuf,
    file: File,
    /// The last line of each folder.
    last: HashMap<String, Line>,
}

impl Summary {
    /// Reads the lines of earlier runs. What a run that was killed left of a line is cut off.
    pub(super) fn open(folder: &Path) -> anyhow::Result<Self> {
        let path = folder.join(SUMMARY);
        let bytes = match std::fs::read(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
            read => read.with_context(|| path.display().to_string())?,
        };
        let whole = bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |at| at + 1);
        let lines = bytes[..whole].split(|&byte| byte == b'\n');
        let lines = lines.filter_map(|line| serde_json::from_slice::<Line>(line).ok());
        let last = lines.map(|line| (line.name.clone(), line)).collect();
        let open = || -> io::Result<File> {
            let mut file = OpenOptions::new().create(true).truncate(false).write(true).open(&path)?;
            file.set_len(whole as u64)?;
            file.seek(SeekFrom::End(0))?;
            Ok(file)
        };
        let file = open().with_context(|| path.display().to_string())?;
        Ok(Self { path, file, last })
    }

    /// Appends a line, whole.
    pub(super) fn append(&mut self, line: &Line) -> anyhow::Result<()> {
        let mut bytes = serde_json::to_vec(line)?;
        bytes.push(b'\n');
        let appended = self.file.write_all(&bytes).and_then(|()| self.file.sync_data());
        appended.with_context(|| format!("{}: no line for {}", self.path.display(), line.scene))?;
        self.last.insert(line.name.clone(), line.clone());
        Ok(())
    }

    /// The line of a scene that is done: with the same triangles and settings, and all its files there. `folder` is that of the scene.
    pub(super) fn done(&self, name: &str, folder: &Path, scene_hash: &str, settings: &Value) -> Option<&Line> {
        let line = self.last.get(name).filter(|line| line.status == Status::Done)?;
        let is_same = line.scene_hash.as_deref() == Some(scene_hash) && line.settings.as_ref() == Some(settings);
        (is_same && line.is_whole(folder)).then_some(line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_again_and_a_torn_one_is_cut_off() {
        let folder = tempfile::tempdir().unwrap();
        let line = |name: &str, error: &str| Line::failed(format!("{name}.obj"), name.to_owned(), error.to_owned());
        let mut summary = Summary::open(folder.path()).unwrap();
        for (name, error) in [("a", "one"), ("b", "two"), ("a", "three")] {
            summary.append(&line(name, error)).unwrap();
        }
        drop(summary);
        let path = folder.path().join(SUMMARY);
        let whole = std::fs::read_to_string(&path).unwrap();
        assert_eq!(whole.lines().count(), 3);
        std::fs::write(&path, whole.clone() + r#"{"schema":1,"scene":"c.o"#).unwrap();
        let mut summary = Summary::open(folder.path()).unwrap();
        assert_eq!(summary.last.get("a"), Some(&line("a", "three")));
        assert_eq!((summary.last.len(), std::fs::read_to_string(&path).unwrap()), (2, whole.clone()));
        summary.append(&line("c", "four")).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.starts_with(&whole) && text.lines().count() == 4 && text.ends_with('\n'), "{text}");
        assert!(summary.done("a", folder.path(), "", &Value::Null).is_none(), "what failed is not done");
    }
}
