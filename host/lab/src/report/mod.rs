//! What a run did, and the files that say so: `report.json`, `iterations.csv`, `convergence.svg`, of a checked run `accuracy.csv`; and
//! the table on the terminal.

pub(crate) mod axis;
mod csv;
mod json;
pub mod plot;
mod run;
mod table;
#[cfg(test)]
mod testing;

pub use crate::machine::Machine;
pub use crate::phases::{Phase, PhaseTimes};
pub use crate::program::Program;
pub use run::{Memory, QualityReport, RunReference, RunReport, RunSettings, SCHEMA, SceneReport};
pub use table::table;

use prbvh::write::{WriteError, write_atomically};
use std::path::{Path, PathBuf};

impl RunReport {
    /// Names of the files that [`RunReport::write`] writes, the last one only of a checked run.
    pub const FILES: [&str; 4] = ["report.json", "iterations.csv", "convergence.svg", "accuracy.csv"];

    /// Writes `report.json`, `iterations.csv` and `convergence.svg` into `folder`, and `accuracy.csv` if the numbers were checked, each
    /// whole or not at all. Returns their paths.
    ///
    /// # Errors
    /// At the first file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, WriteError> {
        let mut paths = Self::FILES.map(|name| folder.join(name)).to_vec();
        write_atomically(&paths[0], |out| json::write(self, out))?;
        write_atomically(&paths[1], |out| csv::write(&self.rows, out))?;
        write_atomically(&paths[2], |out| {
            let svg = plot::convergence(self).map_err(std::io::Error::other)?;
            out.write_all(svg.as_bytes())
        })?;
        match &self.accuracy {
            Some(accuracy) => write_atomically(&paths[3], |out| csv::write_accuracy(&accuracy.rows, out))?,
            None => paths.truncate(3),
        }
        Ok(paths)
    }
}

#[cfg(test)]
mod tests {
    use super::testing::report;

    #[test]
    fn all_files_are_written_again_and_again() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        for _ in 0..2 {
            let paths = report(5).write(&out).unwrap();
            assert!(paths.iter().all(|path| path.metadata().unwrap().len() > 100));
            assert_eq!(std::fs::read_dir(&out).unwrap().count(), 3);
        }
    }

    #[test]
    fn a_file_in_the_way_is_named_and_left() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        std::fs::write(&out, "mine").unwrap();
        let error = report(5).write(&out).unwrap_err();
        assert!(error.path.ends_with("out/report.json"), "{error}");
        assert_eq!(std::fs::read_to_string(&out).unwrap(), "mine");
    }
}
