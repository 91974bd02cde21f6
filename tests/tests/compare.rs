//! `prbvh compare` as a user runs it.

use prbvh::bvh::MaxDepth;
use prbvh::device::cpu::CpuDevice;
use prbvh::device::{self, Buffer, Device, DeviceError};
use prbvh::scene::built_in;
use prbvh::stop::Stop;
use prbvh_lab::compare::{CompareSettings, MethodSettings, RaySettings, compare as compare_scenes, jobs};
use prbvh_tests::command::{Ended, run, start};
use prbvh_tests::devices::without_vulkan;
use serde_json::Value;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::Command;
use tempfile::tempdir;

const PRBVH: &str = env!("CARGO_BIN_EXE_prbvh-under-test");

/// Rays enough to compare hits, and no more.
const FEW_RAYS: [&str; 8] = ["--size", "32x24", "--samples", "1", "--bounces", "2", "--views", "3"];

fn compare(folder: &Path, arguments: &[&str]) -> Ended {
    run(PRBVH, folder, &[&["compare"], arguments].concat())
}

fn rows(json: &Value) -> &Vec<Value> {
    json["rows"].as_array().unwrap()
}

fn number(row: &Value, key: &str) -> f64 {
    row[key].as_f64().unwrap_or_else(|| panic!("{key} of {row}"))
}

/// What every row of numbers must be.
fn assert_makes_sense(row: &Value, triangles: f64) {
    assert_eq!(row["status"], "ok", "{row}");
    let (cost, adaptive) = (number(row, "cost"), number(row, "adaptive_cost"));
    assert!(cost > 1.0 && cost < 5.0 * triangles && adaptive > 1.0 && adaptive <= cost, "{row}");
    let (build_s, depth) = (number(row, "build_s"), number(row, "depth"));
    assert!(build_s > 0.0 && build_s < 60.0, "{row}");
    assert!(depth >= triangles.log2().floor() && depth < triangles, "{row}");
    if !row["device_s"].is_null() {
        assert!(number(row, "device_s") > 0.0 && number(row, "device_s") <= build_s, "{row}");
        // At least the tree: 32 bytes a node.
        assert!(number(row, "bytes") >= 32.0 * (2.0 * triangles - 1.0), "{row}");
    }
    let hash = row["tree_hash"].as_str().unwrap();
    assert!(hash.len() == 32 && hash.bytes().all(|digit| digit.is_ascii_hexdigit()), "{row}");
    for kind in ["overall", "primary", "shadow", "secondary"] {
        assert!(number(&row["mrays"], kind) > 0.0, "{kind}: {row}");
    }
    assert!(number(row, "box_tests") > 2.0 && number(row, "triangle_tests") > 0.1, "{row}");
    let is_optimizer =
        ["prbvh", "rbvh", "rotations"].iter().any(|name| row["method"].as_str().unwrap().starts_with(name));
    assert_eq!(row["iterations"].as_u64().is_some_and(|iterations| iterations > 3), is_optimizer, "{row}");
}

#[test]
fn every_method_has_its_row_and_devices_agree() {
    let folder = tempdir().unwrap();
    let devices = if without_vulkan() { "cpu" } else { "cpu,vulkan" };
    let arguments = ["built-in", "--triangles", "2000", "--device", devices, "--repeat", "2", "--json", "--out", "out"];
    let json = compare(folder.path(), &[&arguments[..], &FEW_RAYS].concat()).ok().json();
    let rows = rows(&json);
    let count = json["devices"].as_array().unwrap().len();
    let names = |name: &str| rows.iter().filter(|row| row["method"].as_str().unwrap().starts_with(name)).count();
    for name in [
        "lbvh",
        "trbvh",
        "hploc r=8",
        "ploc r=100",
        "rotations annealed",
        "sah-sweep",
        "sah-binned",
        "obvhs default",
        "obvhs best",
        "bvh",
        "prbvh worst first",
    ] {
        assert_eq!(names(name), count, "{name}");
    }
    assert_eq!(rows.iter().filter(|row| row["method"] == "prbvh").count(), 3 * count);
    for row in rows {
        assert_makes_sense(row, 2000.0);
        assert_eq!(row["scene"], "hall");
        let same = |other: &&Value| other["method"] == row["method"] && other["mu"] == row["mu"];
        let twins: Vec<&Value> = rows.iter().filter(same).collect();
        assert_eq!(twins.len(), count);
        for twin in twins {
            for key in ["tree_hash", "cost", "adaptive_cost", "box_tests", "triangle_tests"] {
                assert_eq!(twin[key], row[key], "{key} differs between {} and {}", twin["device"], row["device"]);
            }
        }
    }
    let cost = |method: &str| number(rows.iter().find(|row| row["method"] == method).unwrap(), "cost");
    assert!(cost("prbvh") < 0.7 * cost("lbvh") && cost("prbvh") < cost("sah-sweep"));

    // What is printed, the file and the table say the same.
    let file: Value = serde_json::from_slice(&std::fs::read(folder.path().join("out/compare.json")).unwrap()).unwrap();
    assert_eq!(&file["scenes"][0]["rows"], &json["rows"]);
    let runs = file["scenes"][0]["runs"].as_array().unwrap();
    let prbvh: Vec<&Value> = runs.iter().filter(|run| run["method"] == "prbvh" && run["purpose"] == "table").collect();
    assert_eq!(prbvh.len(), 3 * count);
    assert!(prbvh.iter().all(|run| run["rows"].as_array().unwrap().len() > 4 && run["phases"][0]["label"].is_string()));
    let csv = std::fs::read_to_string(folder.path().join("out/compare.csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + rows.len());
    assert!(csv.starts_with("scene,method,mu,device,"));
}

#[test]
fn the_table_is_for_people() {
    let folder = tempdir().unwrap();
    std::fs::write(folder.path().join("one.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let arguments = ["built-in", "one.obj", "--triangles", "1000", "--device", "cpu", "--methods", "prbvh,lbvh,ploc"];
    let more = ["--mu", "9,1000000", "--radius", "10000", "--rays", "off", "-q"];
    let ran = compare(folder.path(), &[&arguments[..], &more].concat()).ok();
    for part in ["hall (1,000 triangles)", "one (1 triangles)", "ploc r=10000", "1000000", "÷ that of: lbvh 0."] {
        assert!(ran.stdout.contains(part), "{part}: {}", ran.stdout);
    }
    let widest = ran.stdout.lines().filter(|line| line.starts_with('─')).map(|line| line.chars().count()).max();
    assert!(widest.unwrap() <= 100, "{}", ran.stdout);
    assert!(!ran.stdout.contains("MRays") && ran.stderr.is_empty(), "{}{}", ran.stdout, ran.stderr);
    let at = |name: &str| ran.stdout.find(name).unwrap();
    assert!(at("prbvh ") < at("lbvh "), "the order is that of --methods");
}

#[test]
fn figures_add_runs_and_keep_the_rows() {
    let folder = tempdir().unwrap();
    let arguments = ["--triangles", "500", "--device", "cpu", "--methods", "lbvh,prbvh", "--mu", "9", "--figures"];
    let arguments = [&arguments[..], &["--rays", "off", "--json", "--out", "out"]].concat();
    let json = compare(folder.path(), &arguments).ok().json();
    assert_eq!(rows(&json).len(), 2);
    let file: Value = serde_json::from_slice(&std::fs::read(folder.path().join("out/compare.json")).unwrap()).unwrap();
    let runs = file["scenes"][0]["runs"].as_array().unwrap();
    let of = |purpose: &str| runs.iter().filter(|run| run["purpose"] == purpose).collect::<Vec<_>>();
    let mu: Vec<u64> = of("mu").iter().map(|run| run["mu"].as_u64().unwrap()).collect();
    assert_eq!(mu, [1, 2, 4, 6, 12, 16, 24, 32]);
    assert!(of("initial").iter().any(|run| run["initial"] == "ploc"));
    assert_eq!(of("table").len(), 2);
}

#[test]
fn peers_that_panic_hang_or_lie_have_a_status_and_the_others_go_on() {
    let folder = tempdir().unwrap();
    let temporary = tempdir().unwrap();
    let mut command = Command::new(PRBVH);
    for name in ["TMPDIR", "TEMP", "TMP"] {
        command.env(name, temporary.path());
    }
    command.current_dir(folder.path()).args(["compare", "--triangles", "300", "--device", "cpu", "--json"]);
    command.args(["--methods", "planted-panic,planted-hang,planted-wrong,lbvh", "--peer-timeout", "1.5"]);
    let ran = start(command.args(FEW_RAYS)).wait();
    assert_eq!(ran.code, Some(1), "{}", ran.stderr);
    let json = ran.json();
    let [panics, hangs, lies, lbvh] = &rows(&json)[..] else { panic!("{json}") };
    assert_eq!(panics["status"], "panicked: planted: 300 triangles are too many");
    assert_eq!(hangs["status"], "timed out after 1.5 s");
    let status = lies["status"].as_str().unwrap();
    assert!(status.starts_with("invalid tree: ") && status.contains("299"), "{status}");
    for row in [panics, hangs, lies] {
        assert_eq!(row["device"], "cpu (peer)");
        for key in ["cost", "build_s", "mrays", "tree_hash"] {
            assert!(row[key].is_null(), "{key} of {row}");
        }
    }
    assert_makes_sense(lbvh, 300.0);
    assert_eq!(std::fs::read_dir(temporary.path()).unwrap().count(), 0, "files are left");
}

#[test]
fn the_help_names_what_the_paper_has() {
    let help = compare(tempdir().unwrap().path(), &["--help"]).ok().stdout;
    for part in ["--methods", "--mu", "--radius", "--repeat", "--peer-timeout", "--figures", "1024x768", "depth 8"] {
        assert!(help.contains(part), "{part}: {help}");
    }
    assert!(!run(PRBVH, tempdir().unwrap().path(), &["--help"]).ok().stdout.contains("peer"), "the process is hidden");
}

/// A CPU with no memory for the buffers of one label.
struct Refuses {
    device: CpuDevice,
    label: &'static str,
}

impl device::Layer for Refuses {
    fn inner(&self) -> &dyn Device {
        &self.device
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        &mut self.device
    }

    fn allocate(&mut self, label: &'static str, length: usize, bytes: usize) -> Result<Buffer, DeviceError> {
        if label == self.label {
            let device = self.device.info().name.clone();
            return Err(DeviceError::OutOfMemory { what: label.to_owned(), bytes: (length * bytes) as u64, device });
        }
        self.device.allocate(label, length, bytes)
    }
}

#[test]
fn a_method_that_fails_on_a_device_is_a_row_and_leaves_no_buffers() {
    let names = ["ploc", "lbvh", "prbvh"].map(str::to_owned);
    let methods = MethodSettings { mu: vec![9], ..MethodSettings::default() };
    let rays = RaySettings { width: 16, height: 8, samples: 1, bounces: 1, light_samples: 1, views: 1 };
    let settings = CompareSettings {
        jobs: jobs(&names, &methods).unwrap(),
        repeat: 2,
        threads: 1,
        max_depth: MaxDepth::default(),
        rays: Some(rays),
        up: 1,
        pictures: true,
        figures: true,
        peers: None,
        stop: Stop::default(),
    };
    for (label, failing) in
        [("neighbours", &["ploc r=100", "prbvh worst first, for a figure"][..]), ("found", &["prbvh"])]
    {
        let device = Box::new(Refuses { device: CpuDevice::new(1).unwrap(), label });
        let mut devices: Vec<Box<dyn Device>> = vec![device];
        let mut steps = 0;
        let comparison = compare_scenes(&[built_in(200)], &mut devices, &settings, &mut |step| {
            steps += usize::from(step.outcome.is_some());
            ControlFlow::Continue(())
        });
        let rows = &comparison.scenes[0].rows;
        for row in rows {
            let fails = failing.iter().any(|method| row.method.starts_with(method));
            assert_eq!(row.status != "ok", fails, "{label}: {row:?}");
            assert!(!fails || row.status.contains(&format!("no memory for {label}")), "{label}: {row:?}");
            assert_eq!(row.cost.is_none(), fails, "{label}: {row:?}");
        }
        assert!(failing.iter().all(|method| rows.iter().any(|row| row.method.starts_with(method))), "{rows:?}");
        assert!(steps >= 6, "{steps}");
        assert_eq!(devices[0].memory().bytes, 0, "{label}: buffers are left");
        assert!(comparison.scenes[0].pictures.iter().any(|picture| picture.title == "view 0, shaded"));
    }
}
