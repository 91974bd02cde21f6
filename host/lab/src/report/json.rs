//! `report.json`.

use super::RunReport;
use std::io::{self, Write};

/// Writes the report, indented, with a line end.
pub(super) fn write(report: &RunReport, out: &mut dyn Write) -> io::Result<()> {
    serde_json::to_writer_pretty(&mut *out, report)?;
    out.write_all(b"\n")
}

#[cfg(test)]
mod tests {
    use super::super::{RunSettings, testing::report};
    use super::*;
    use serde_json::Value;

    fn parsed(report: &RunReport) -> Value {
        let mut bytes = Vec::new();
        write(report, &mut bytes).unwrap();
        serde_json::from_slice(&bytes).unwrap()
    }

    #[test]
    fn the_keys_that_programs_rely_on_are_flat() {
        let report = report(4);
        let json = parsed(&report);
        assert_eq!(json["schema"], 3);
        assert_eq!(json["scene"], report.scene);
        assert_eq!(json["triangles"], report.triangles);
        assert_eq!(json["device"], report.device);
        assert_eq!(json["initial_cost"], report.initial_cost);
        assert_eq!(json["final_cost"], report.final_cost);
        assert_eq!(json["iterations"], 4);
        assert_eq!(json["time_s"], report.time_s);
        assert_eq!(json["tree_hash"], report.tree_hash);
        assert_eq!(json["phases"][0]["label"], "search");
        for key in ["seconds", "calls", "share"] {
            assert!(json["phases"][0][key].is_number(), "{key}");
        }
    }

    #[test]
    fn what_explains_the_outcome_is_there() {
        let report = report(4);
        let json = parsed(&report);
        assert_eq!(json["rows"].as_array().unwrap().len(), 5);
        assert_eq!(json["rows"][4]["cost"], report.rows[4].cost);
        assert_eq!(json["quality"]["initial"]["sah_cost"], report.initial_cost);
        assert_eq!(json["quality"]["final"]["sah_cost"], report.final_cost);
        assert_eq!(json["settings"]["max_time_s"], Value::Null);
        assert_eq!(json["settings"]["initial"], "lbvh");
        assert_eq!(serde_json::from_value::<RunSettings>(json["settings"].clone()).unwrap(), report.settings);
        assert_eq!(json["device_details"]["kind"], "cpu");
        assert_eq!(json["scene_details"]["census"]["duplicates"], 7);
        assert_eq!(json["program"]["version"], env!("CARGO_PKG_VERSION"));
        assert!(json["machine"]["cores"].as_u64().unwrap() >= 1);
    }
}
