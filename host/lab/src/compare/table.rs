//! The comparison of a scene on the terminal.

use super::data::with_mu;
use super::fitted::{Fitted, fitted};
use super::{MethodRow, RayRates, SceneComparison};
use prbvh::format;

/// A column. Where there is no room for all, those of the highest rank go first.
struct Column {
    header: &'static str,
    rank: u32,
    is_text: bool,
    cell: fn(&MethodRow) -> Option<String>,
}

const COLUMNS: &[Column] = &[
    Column { header: "method", rank: 0, is_text: true, cell: |row| Some(row.method.clone()) },
    number("µ", 2, |row| row.mu.map(|mu| mu.to_string())),
    Column { header: "device", rank: 3, is_text: true, cell: |row| Some(device(row)) },
    number("cost", 1, |row| row.cost.map(cost)),
    number("adaptive", 5, |row| row.adaptive_cost.map(cost)),
    number("build", 4, |row| row.build_s.map(format::seconds)),
    number("kernels", 9, |row| row.device_s.map(format::seconds)),
    number("MRays/s", 6, |row| row.mrays.map(|rates| format::significant(rates.overall))),
    number("prim/shad/sec", 7, |row| row.mrays.map(by_kind)),
    number("box/ray", 12, |row| row.box_tests.map(format::significant)),
    number("tri/ray", 13, |row| row.triangle_tests.map(format::significant)),
    number("depth", 10, |row| row.depth.map(|depth| depth.to_string())),
    number("stack", 14, |row| row.stack.map(|entries| entries.to_string())),
    number("EPO", 8, overlap),
    number("refs", 16, |row| row.references.map(|references| format::count(references.into()))),
    number("iter.", 11, |row| row.iterations.map(|iterations| format::count(iterations.into()))),
    number("memory", 15, |row| row.bytes.map(format::bytes)),
];

const fn number(header: &'static str, rank: u32, cell: fn(&MethodRow) -> Option<String>) -> Column {
    Column { header, rank, is_text: false, cell }
}

fn cost(cost: f64) -> String {
    format!("{cost:.2}")
}

/// The end-point overlap, with its error where it is an estimate.
fn overlap(row: &MethodRow) -> Option<String> {
    let value = format::significant(row.epo?);
    Some(match row.epo_error {
        Some(error) if error > 0.0 => format!("{value}±{}", format::significant(error)),
        _ => value,
    })
}

/// Millions of rays per second, primary, shadow and secondary ones, as in the paper's table.
fn by_kind(rates: RayRates) -> String {
    [rates.primary, rates.shadow, rates.secondary].map(format::significant).join("/")
}

/// Where the rays were traced, which is where the tree was built, but for what runs on the host.
fn device(row: &MethodRow) -> String {
    const MOST: usize = 14;
    format::shortened(row.traced_on.as_ref().unwrap_or(&row.device), MOST)
}

/// Whether rows differ by their device, not only by their method.
fn has_devices(scene: &SceneComparison) -> bool {
    let devices = scene.rows.iter().map(|row| &row.device).filter(|device| !device.starts_with("cpu ("));
    devices.clone().any(|device| devices.clone().next() != Some(device))
}

/// The rows of a scene under a line with its name, at most `width` columns wide where the method's name and cost fit into that. Columns that
/// do not fit are left out; the last line says which.
#[must_use]
pub fn table(scene: &SceneComparison, width: u16) -> String {
    let cells = |column: &Column| -> Vec<String> {
        scene.rows.iter().map(|row| (column.cell)(row).unwrap_or_else(|| "-".to_owned())).collect()
    };
    let columns: Vec<Fitted> = COLUMNS
        .iter()
        .filter(|column| scene.rows.iter().any(|row| (column.cell)(row).is_some()))
        .filter(|column| column.header != "device" || has_devices(scene))
        .map(|column| Fitted {
            header: column.header.to_owned(),
            rank: column.rank,
            is_text: column.is_text,
            cells: cells(column),
        })
        .collect();
    let (table, left_out) = fitted(columns, width);
    let mut text = format!("{} ({} triangles)\n{table}\n", scene.name, format::count(scene.triangles.into()));
    if !left_out.is_empty() {
        text.push_str(&format!("no room for: {}\n", left_out.join(", ")));
    }
    text
}

/// A line below the table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// The line.
    pub text: String,
    /// Whether it tells of something that went wrong.
    pub is_fault: bool,
}

/// What the table does not say: rows that failed, trees that were too deep, PRBVH's cost as a part of the others', and its speed against
/// RBVH.
#[must_use]
pub fn notes(scene: &SceneComparison) -> Vec<Note> {
    let note = |text| Note { text, is_fault: false };
    let mut notes = Vec::new();
    for row in scene.rows.iter().filter(|row| row.status != "ok") {
        let text = format!("{} on {}: {}", name(row), row.device, row.status);
        notes.push(Note { text, is_fault: true });
    }
    for row in &scene.rows {
        if let Some(bound) = row.bound {
            let text = format!("{}, --max-depth {}: {bound}", name(row), bound.max_depth);
            if notes.iter().all(|note| note.text != text) {
                notes.push(note(text));
            }
        }
    }
    notes.extend(ratios(scene).map(note));
    let mut told = Vec::new();
    for row in &scene.rows {
        if let Some(against) = row.against_rbvh
            && !told.contains(&row.mu)
        {
            told.push(row.mu);
            let [rbvh, prbvh] = [against.rbvh_s, against.prbvh_s].map(format::seconds);
            let (times, cost) = (format::significant(against.speed_up), cost(against.cost));
            let name = name(row);
            notes.push(note(format!("to cost {cost}, one thread: rbvh {rbvh}, {name} {prbvh}: {times} × the speed")));
        }
    }
    notes
}

/// Method and µ.
fn name(row: &MethodRow) -> String {
    with_mu(&row.method, row.mu)
}

/// The adaptive cost of PRBVH with the last µ, as the paper counts, divided by that of each other method.
fn ratios(scene: &SceneComparison) -> Option<String> {
    let prbvh = scene.rows.iter().rev().find(|row| row.method == "prbvh" && row.adaptive_cost.is_some())?;
    let mut parts: Vec<String> = Vec::new();
    for row in scene.rows.iter().filter(|row| row.device == prbvh.device || row.device.starts_with("cpu (")) {
        if row.method != "prbvh"
            && let Some(cost) = row.adaptive_cost
        {
            let part = format!("{} {:.3}", row.method, prbvh.adaptive_cost? / cost);
            if !parts.contains(&part) {
                parts.push(part);
            }
        }
    }
    (!parts.is_empty()).then(|| format!("adaptive cost of {} ÷ that of: {}", name(prbvh), parts.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::super::AgainstRbvh;
    use super::*;
    use prbvh::bvh::DepthBound;

    fn scene() -> SceneComparison {
        let row = |method: &str, mu, device: &str, cost| MethodRow {
            scene: "hall".to_owned(),
            method: method.to_owned(),
            mu,
            device: device.to_owned(),
            traced_on: Some("CPU, 2 threads".to_owned()),
            cost: Some(cost),
            adaptive_cost: Some(cost / 2.0),
            build_s: Some(0.0123),
            device_s: Some(0.0101),
            mrays: Some(RayRates { overall: 3.21, primary: 7.0, shadow: 2.0, secondary: 1.0 }),
            box_tests: Some(41.0),
            triangle_tests: Some(5.5),
            depth: Some(31),
            bytes: Some(123 << 20),
            iterations: mu.map(|_| 40),
            status: "ok".to_owned(),
            ..MethodRow::default()
        };
        let mut rows = vec![
            row("lbvh", None, "CPU, 2 threads", 200.0),
            row("rbvh", None, "cpu (host)", 101.0),
            row("prbvh", Some(9), "CPU, 2 threads", 100.0),
        ];
        rows[2].against_rbvh = Some(AgainstRbvh { cost: 101.0, rbvh_s: 50.0, prbvh_s: 2.0, speed_up: 25.0 });
        rows.push(MethodRow {
            method: "obvhs best".to_owned(),
            device: "cpu (peer)".to_owned(),
            status: "timed out after 60 s".to_owned(),
            ..MethodRow::default()
        });
        SceneComparison {
            name: "hall".to_owned(),
            hash: String::new(),
            triangles: 250_000,
            notes: Vec::new(),
            rows,
            runs: Vec::new(),
            errors: None,
            pictures: Vec::new(),
        }
    }

    #[test]
    fn it_fits_the_width_and_says_what_it_leaves_out() {
        let scene = scene();
        for width in [40u16, 60, 80, 100, 120, 200] {
            let text = table(&scene, width);
            let widest =
                text.lines().filter(|line| !line.starts_with("no room")).map(|line| line.chars().count()).max();
            assert!(widest.unwrap() <= width.into(), "{width}:\n{text}");
            assert!(text.contains("200.00") && text.contains("obvhs best"), "{text}");
            assert_eq!(text.contains("no room for"), !text.contains("123 MiB"), "{text}");
        }
        assert!(table(&scene, 80).contains("MRays/s") && table(&scene, 200).contains("123 MiB"));
        assert!(table(&scene, 100).contains("7.00/2.00/1.00"));
        assert!(!table(&scene, 200).contains("device"), "one device needs no column");
        let mut two = scene.clone();
        two.rows[2].device = "llvmpipe (LLVM 15.0.6, 256 bits)".to_owned();
        two.rows[2].traced_on = None;
        assert!(table(&two, 80).contains("llvmpipe (LLV…"));
        assert!(!table(&scene, 200).contains("EPO"), "a column without numbers");
        let mut overlapping = scene.clone();
        (overlapping.rows[0].epo, overlapping.rows[0].epo_error) = (Some(12.34), Some(0.567));
        (overlapping.rows[1].epo, overlapping.rows[1].epo_error) = (Some(56.78), Some(0.0));
        let text = table(&overlapping, 200);
        assert!(text.contains("12.3±0.57") && text.contains("56.8 "), "{text}");
    }

    #[test]
    fn notes_tell_once_what_a_bound_on_the_depth_changed() {
        let mut scene = scene();
        let bound = serde_json::from_value::<DepthBound>(serde_json::json!({
            "max_depth": 63,
            "depth_before": 80,
            "depth_after": 63,
            "cost_before": 100.0,
            "cost_after": 100.5,
            "subtrees": 1,
            "nodes": 20
        }))
        .unwrap();
        (scene.rows[0].bound, scene.rows[2].bound) = (Some(bound), Some(bound));
        scene.rows.push(scene.rows[2].clone());
        let notes = notes(&scene);
        let told: Vec<&str> = notes
            .iter()
            .map(|note| &*note.text)
            .filter(|text| text.contains("--max-depth 63: depth 80 to 63"))
            .collect();
        assert!(told.len() == 2 && told[0].starts_with("lbvh") && told[1].contains("(+0.50 %)"), "{told:?}");
    }

    #[test]
    fn notes_tell_faults_ratios_and_the_speed_up() {
        let notes = notes(&scene());
        let faults: Vec<&str> = notes.iter().filter(|note| note.is_fault).map(|note| note.text.as_str()).collect();
        assert_eq!(faults, ["obvhs best on cpu (peer): timed out after 60 s"]);
        let text: Vec<&str> = notes.iter().map(|note| note.text.as_str()).collect();
        assert!(text.iter().any(|line| line.contains("÷ that of: lbvh 0.500, rbvh 0.990")), "{text:?}");
        assert!(text.iter().any(|line| line.contains("25.0 × the speed")), "{text:?}");
    }
}
