//! `compare.json` and `compare.csv`.

use super::{Comparison, MethodRow, TimesToError};
use prbvh::write::{WriteError, write_atomically};
use serde::Serialize;
use std::io;
use std::path::{Path, PathBuf};

impl Comparison {
    /// The rows of all scenes.
    pub fn rows(&self) -> impl Iterator<Item = &MethodRow> {
        self.scenes.iter().flat_map(|scene| &scene.rows)
    }

    /// Writes all that is known as `compare.json` and the rows as `compare.csv` into `folder`, each whole or not at all. Returns their
    /// paths.
    ///
    /// # Errors
    /// At the first file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, WriteError> {
        let paths = ["compare.json", "compare.csv"].map(|name| folder.join(name));
        write_atomically(&paths[0], |out| {
            serde_json::to_writer_pretty(&mut *out, self)?;
            out.write_all(b"\n")
        })?;
        write_atomically(&paths[1], |out| write_csv(self.rows(), out))?;
        Ok(paths.into())
    }
}

/// A row without nesting: the columns of `compare.csv`.
#[derive(Serialize)]
struct Flat<'a> {
    scene: &'a str,
    method: &'a str,
    mu: Option<u32>,
    device: &'a str,
    traced_on: Option<&'a str>,
    threads: u32,
    cost: Option<f64>,
    adaptive_cost: Option<f64>,
    build_s: Option<f64>,
    device_s: Option<f64>,
    mrays_overall: Option<f64>,
    mrays_primary: Option<f64>,
    mrays_shadow: Option<f64>,
    mrays_secondary: Option<f64>,
    box_tests: Option<f64>,
    triangle_tests: Option<f64>,
    depth: Option<u32>,
    stack: Option<u32>,
    depth_before_bound: Option<u32>,
    cost_before_bound: Option<f64>,
    epo: Option<f64>,
    epo_error: Option<f64>,
    bytes: Option<u64>,
    iterations: Option<u32>,
    tree_hash: Option<&'a str>,
    status: &'a str,
    faster_than_rbvh: Option<f64>,
    relative_error: Option<f64>,
    wall_s_to_10_percent: Option<f64>,
    wall_s_to_5_percent: Option<f64>,
    wall_s_to_2_percent: Option<f64>,
    wall_s_to_1_percent: Option<f64>,
    wall_s_to_0_1_percent: Option<f64>,
    device_s_to_10_percent: Option<f64>,
    device_s_to_5_percent: Option<f64>,
    device_s_to_2_percent: Option<f64>,
    device_s_to_1_percent: Option<f64>,
    device_s_to_0_1_percent: Option<f64>,
}

impl<'a> From<&'a MethodRow> for Flat<'a> {
    fn from(row: &'a MethodRow) -> Self {
        let TimesToError { wall_s, device_s } = row.time_to.unwrap_or_default();
        Self {
            scene: &row.scene,
            method: &row.method,
            mu: row.mu,
            device: &row.device,
            traced_on: row.traced_on.as_deref(),
            threads: row.threads,
            cost: row.cost,
            adaptive_cost: row.adaptive_cost,
            build_s: row.build_s,
            device_s: row.device_s,
            mrays_overall: row.mrays.map(|rates| rates.overall),
            mrays_primary: row.mrays.map(|rates| rates.primary),
            mrays_shadow: row.mrays.map(|rates| rates.shadow),
            mrays_secondary: row.mrays.map(|rates| rates.secondary),
            box_tests: row.box_tests,
            triangle_tests: row.triangle_tests,
            depth: row.depth,
            stack: row.stack,
            depth_before_bound: row.bound.map(|bound| bound.depth_before),
            cost_before_bound: row.bound.map(|bound| bound.cost_before),
            epo: row.epo,
            epo_error: row.epo_error,
            bytes: row.bytes,
            iterations: row.iterations,
            tree_hash: row.tree_hash.as_deref(),
            status: &row.status,
            faster_than_rbvh: row.against_rbvh.map(|against| against.speed_up),
            relative_error: row.relative_error,
            wall_s_to_10_percent: wall_s[0],
            wall_s_to_5_percent: wall_s[1],
            wall_s_to_2_percent: wall_s[2],
            wall_s_to_1_percent: wall_s[3],
            wall_s_to_0_1_percent: wall_s[4],
            device_s_to_10_percent: device_s[0],
            device_s_to_5_percent: device_s[1],
            device_s_to_2_percent: device_s[2],
            device_s_to_1_percent: device_s[3],
            device_s_to_0_1_percent: device_s[4],
        }
    }
}

fn write_csv<'a>(rows: impl Iterator<Item = &'a MethodRow>, out: &mut dyn io::Write) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(out);
    for row in rows {
        csv.serialize(Flat::from(row))?;
    }
    csv.flush()
}

#[cfg(test)]
mod tests {
    use super::super::RayRates;
    use super::*;

    #[test]
    fn a_row_is_a_line_and_what_is_not_known_is_empty() {
        let rates = RayRates { overall: 0.1, primary: 0.2, shadow: 0.3, secondary: 0.4 };
        let known = MethodRow {
            method: "ploc r=100".to_owned(),
            cost: Some(1.0 / 3.0),
            mrays: Some(rates),
            status: "ok".to_owned(),
            ..MethodRow::default()
        };
        let unknown = MethodRow { status: "a, \"b\"".to_owned(), ..MethodRow::default() };
        let mut bytes = Vec::new();
        write_csv([&known, &unknown].into_iter(), &mut bytes).unwrap();
        let mut reader = csv::Reader::from_reader(&bytes[..]);
        let header = reader.headers().unwrap().clone();
        let column = |name: &str| header.iter().position(|column| column == name).unwrap();
        let records: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        assert_eq!(records[0][column("cost")].parse::<f64>().unwrap(), 1.0 / 3.0);
        assert_eq!(&records[0][column("mrays_secondary")], "0.4");
        assert_eq!((&records[1][column("cost")], &records[1][column("status")]), ("", "a, \"b\""));
    }
}
