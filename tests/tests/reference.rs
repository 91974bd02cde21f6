//! Errors against the lowest cost known, targets, presets, and the tasks that keep their files, as a user runs them.

use prbvh_tests::command::{Ended, run};
use serde_json::Value;
use std::path::Path;
use tempfile::tempdir;

const PRBVH: &str = env!("CARGO_BIN_EXE_prbvh-under-test");
const CHOICES: &str = env!("CARGO_BIN_EXE_prbvh-choices");

const EMPTY: &str = "{\n  \"schema\": 1,\n  \"costs\": []\n}\n";

/// Runs `prbvh optimize` on 3,000 triangles of the built-in scene, whose lowest cost is known.
fn optimize(folder: &Path, arguments: &[&str]) -> Ended {
    let arguments = [&["optimize", "--triangles", "3000", "--device", "cpu", "--json"], arguments].concat();
    run(PRBVH, folder, &arguments)
}

fn number(report: &Value, key: &str) -> f64 {
    report[key].as_f64().unwrap_or_else(|| panic!("{key} is {}", report[key]))
}

#[test]
fn a_target_ends_either_optimiser() {
    let folder = tempdir().unwrap();
    for optimizer in ["prbvh", "rbvh"] {
        let whole = optimize(folder.path(), &["--optimizer", optimizer]).ok().json();
        let target = 0.5 * (number(&whole, "initial_cost") + number(&whole, "final_cost"));
        let arguments = ["--optimizer", optimizer, "--target-cost", &target.to_string()];
        let ended = optimize(folder.path(), &arguments).ok().json();
        assert_eq!(ended["stop_reason"], "target cost reached", "{optimizer}");
        let settings = &ended["settings"];
        let limits = if optimizer == "rbvh" { &settings["rbvh"] } else { settings };
        assert_eq!(limits["target_cost"], target);
        assert!(number(&ended, "final_cost") <= target * (1.0 + 1e-5), "{optimizer}");
        let iterations = number(&ended, "iterations");
        assert!(iterations >= 1.0 && iterations < number(&whole, "iterations"), "{optimizer}");
        let rows = ended["rows"].as_array().unwrap();
        assert!(rows[..rows.len() - 1].iter().all(|row| number(row, "cost") > target), "{optimizer} went on");
        // One that is reached at once, and one that never is.
        let arguments = ["--optimizer", optimizer, "--target-cost", "1e9"];
        assert_eq!(optimize(folder.path(), &arguments).ok().json()["iterations"], 0);
        let never = optimize(folder.path(), &["--optimizer", optimizer, "--target-cost", "1"]).ok().json();
        assert_eq!((&never["stop_reason"], &never["tree_hash"]), (&"converged".into(), &whole["tree_hash"]));
    }
}

#[test]
fn an_error_is_relative_to_the_reference_file() {
    let folder = tempdir().unwrap();
    let ended = optimize(folder.path(), &["--target-error", "0.1"]).ok().json();
    assert_eq!(ended["stop_reason"], "target cost reached");
    let (reference, error) = (&ended["reference"], number(&ended["reference"], "final_error"));
    assert!(error > 0.0 && error <= 0.1 + 1e-5, "{reference}");
    let cost = number(reference, "reference_cost");
    assert!((number(&ended, "final_cost") / cost - 1.0 - error).abs() < 1e-12);
    assert!(reference["source"].as_str().unwrap().contains("commit"), "{reference}");
    let target = number(&ended["settings"], "target_cost");
    assert!((target / cost - 1.1).abs() < 1e-12);

    let unknown = ["optimize", "--triangles", "3001", "--device", "cpu", "--target-error", "0.1"];
    run(PRBVH, folder.path(), &unknown).refused(&["--target-error", "no reference cost", "hash", "--target-cost"]);
    let report =
        run(PRBVH, folder.path(), &["optimize", "--triangles", "3001", "--device", "cpu", "--json"]).ok().json();
    assert_eq!(
        (&report["reference"]["source"], number(&report["reference"], "final_error")),
        (&"this run".into(), 0.0)
    );
}

#[test]
fn targets_and_presets_that_make_no_sense_are_refused_by_name() {
    let folder = tempdir().unwrap();
    for (arguments, parts) in [
        (&["--target-cost", "-1"][..], &["--target-cost", "at least 0"][..]),
        (&["--target-error", "nan"], &["--target-error"]),
        (&["--target-cost", "1", "--target-error", "1"], &["--target-cost", "--target-error"]),
        (&["--optimizer", "none", "--target-cost", "1"], &["--target-cost is for an optimiser"]),
        (&["--preset", "best", "--mu", "1"], &["--preset", "--mu"]),
        (&["--preset", "best", "--initial", "ploc"], &["--preset", "--initial"]),
        (&["--preset", "quick"], &["fast, balanced, best"]),
    ] {
        optimize(folder.path(), arguments).refused(parts);
    }
}

#[test]
fn presets_trade_time_for_cost() {
    let folder = tempdir().unwrap();
    let costs = ["fast", "balanced", "best"].map(|preset| {
        let report = optimize(folder.path(), &["--preset", preset]).ok().json();
        assert_eq!(report["settings"]["preset"], preset);
        number(&report, "final_cost")
    });
    assert!(costs[0] > costs[1] && costs[1] >= costs[2] * 0.99, "{costs:?}");
    let plain = optimize(folder.path(), &[]).ok().json();
    assert_eq!(plain["settings"]["preset"], Value::Null);
}

#[test]
fn a_comparison_tells_errors_in_all_its_files() {
    let folder = tempdir().unwrap();
    let arguments = ["compare", "--triangles", "2000", "--device", "cpu", "--methods", "lbvh,ploc,prbvh"];
    let arguments = [&arguments[..], &["--mu", "1,9", "--rays", "off", "--out", "out"]].concat();
    let ran = run(PRBVH, folder.path(), &arguments).ok();
    for part in ["lowest known", "to 0.1 %", "* Pareto front of time and error: lbvh"] {
        assert!(ran.stdout.contains(part), "{part}: {}", ran.stdout);
    }
    let read = |name: &str| std::fs::read_to_string(folder.path().join("out").join(name)).unwrap();
    let file: Value = serde_json::from_str(&read("compare.json")).unwrap();
    let scene = &file["scenes"][0];
    let errors = &scene["errors"];
    let reference = number(&errors["reference"], "reference_cost");
    let rows = scene["rows"].as_array().unwrap();
    assert_eq!(errors["settings"].as_array().unwrap().len(), rows.len());
    for row in rows {
        let error = number(row, "cost") / reference - 1.0;
        assert!((number(row, "relative_error") - error).abs() < 1e-12 && error > -1e-12, "{row}");
        let times = |key: &str| row["time_to"][key].as_array().unwrap().clone();
        let (wall, device) = (times("wall_s"), times("device_s"));
        // The nearer, the later; the device's part is no longer than the whole.
        let known: Vec<f64> = wall.iter().filter_map(Value::as_f64).collect();
        assert!(known.windows(2).all(|pair| pair[0] <= pair[1]), "{row}");
        assert!(wall[..known.len()].iter().all(|time| !time.is_null()), "{row}");
        for (wall, device) in wall.iter().zip(&device).filter(|(wall, _)| !wall.is_null()) {
            assert!(device.as_f64().unwrap() > 0.0 && device.as_f64() <= wall.as_f64(), "{row}");
        }
        if (error - 0.01).abs() > 1e-5 {
            assert_eq!(error < 0.01, !wall[3].is_null(), "{row}");
        }
    }
    assert!(rows.iter().any(|row| !row["time_to"]["wall_s"][4].is_null()), "someone is the best");
    let csv = read("compare.csv");
    let header = csv.lines().next().unwrap();
    for column in ["relative_error", "wall_s_to_10_percent", "wall_s_to_0_1_percent", "device_s_to_1_percent"] {
        assert!(header.split(',').any(|name| name == column), "{column}: {header}");
    }
    assert!(read("01-hall-error-time.svg").contains("Pareto front"));
    assert!(read("index.html").contains("Time to within an error on hall"));
}

#[test]
fn bless_lowers_and_never_raises() {
    let folder = tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let compare = ["compare", "--triangles", "300", "--device", "cpu", "--methods", "lbvh,prbvh", "--rays", "off"];
    let _ended = run(PRBVH, folder.path(), &[&compare[..], &["--out", "."]].concat()).ok();
    let optimize = ["optimize", "--triangles", "300", "--device", "cpu", "--optimizer", "none", "--out", "."];
    let _ended = run(PRBVH, folder.path(), &optimize).ok();
    std::fs::write(path("costs.json"), EMPTY).unwrap();
    let bless = |file: &str| run(CHOICES, folder.path(), &["bless", "--reference", "costs.json", file]);
    let costs = || std::fs::read_to_string(path("costs.json")).unwrap();

    assert!(bless("compare.json").ok().stdout.contains("hall: new"));
    let blessed = costs();
    let known: Value = serde_json::from_str(&blessed).unwrap();
    let comparison: Value = serde_json::from_slice(&std::fs::read(path("compare.json")).unwrap()).unwrap();
    let rows = comparison["scenes"][0]["rows"].as_array().unwrap();
    let lowest = rows.iter().map(|row| number(row, "cost")).fold(f64::INFINITY, f64::min);
    assert_eq!(number(&known["costs"][0], "cost"), lowest);
    // The same again, and the report of the initial tree, which is worse.
    for file in ["compare.json", "report.json"] {
        let ended = bless(file).ok();
        assert!(ended.stdout.contains("kept") && ended.stdout.contains("nothing changed"), "{}", ended.stdout);
    }
    assert_eq!(costs(), blessed);

    let planted = |cost: Value, status: &str| {
        let mut planted = comparison.clone();
        let rows = planted["scenes"][0]["rows"].as_array_mut().unwrap();
        rows.iter_mut().for_each(|row| row["cost"] = (lowest + 1.0).into());
        (rows[1]["cost"], rows[1]["status"]) = (cost, status.into());
        std::fs::write(path("planted.json"), planted.to_string()).unwrap();
        bless("planted.json")
    };
    assert!(planted((lowest + 0.5).into(), "ok").ok().stdout.contains("nothing changed"), "a higher cost");
    assert!(planted(4.0.into(), "invalid tree").ok().stdout.contains("nothing changed"), "a row that failed");
    for cost in [Value::Null, 0.0.into(), (-1.0).into(), 2.0.into()] {
        planted(cost, "ok").refused(&["planted.json", "no SAH cost", "hall"]);
    }
    assert_eq!(costs(), blessed);
    let lower = planted((lowest - 0.5).into(), "ok").ok().stdout;
    assert!(lower.contains(&format!("lowered from {lowest} to {}", lowest - 0.5)), "{lower}");
    bless("nowhere.json").refused(&["nowhere.json"]);
}

#[test]
fn the_choice_of_presets_can_be_repeated() {
    let folder = tempdir().unwrap();
    let compare = ["compare", "--triangles", "400", "--device", "cpu", "--methods", "candidates", "--rays", "off"];
    let _ended = run(PRBVH, folder.path(), &[&compare[..], &["--out", "."]].concat()).ok();
    std::fs::write(folder.path().join("costs.json"), EMPTY).unwrap();
    let choose = |file: &str| run(CHOICES, folder.path(), &["presets", "--reference", "costs.json", file]);
    let file = folder.path().join("compare.json");
    let mut comparison: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    // Times of so small a scene are chance, so they are planted: each candidate twice as long as the one before, and a little better.
    let rows = comparison["scenes"][0]["rows"].as_array_mut().unwrap();
    let count = rows.len() as i32;
    let cost = |k: i32| 100.0 + 11.7 * f64::from(count - 1 - k) / f64::from(count - 1);
    for (k, row) in (0..).zip(&mut *rows) {
        row["build_s"] = 2f64.powi(k).into();
        row["cost"] = cost(k).into();
    }
    let first_below_10 = (0..count).find(|&k| cost(k) <= 110.0).unwrap();
    let winner = rows[first_below_10 as usize]["method"].as_str().unwrap().to_owned();
    std::fs::write(&file, comparison.to_string()).unwrap();
    let ended = choose("compare.json");
    assert_eq!(ended.code.is_some_and(|code| code == 0), !ended.stdout.contains("the code has"), "{}", ended.stdout);
    for part in ["scenes: hall", &format!("fast: `{winner}`"), "1.00  11.70 %", "best: "] {
        assert!(ended.stdout.contains(part), "{part}: {}", ended.stdout);
    }
    comparison["scenes"][0]["rows"][5]["status"] = "timed out".into();
    std::fs::write(&file, comparison.to_string()).unwrap();
    choose("compare.json").refused(&["every candidate", "--methods candidates", "on hall"]);
}
