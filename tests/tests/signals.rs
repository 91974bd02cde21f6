//! SIGINT and SIGTERM at every moment: the program ends soon, with what is whole and nothing else, and with the exit code of the signal.
#![cfg(target_os = "linux")]

use prbvh_tests::command::{Ended, Fifo, Running, run, start};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;
use std::time::Duration;
use tempfile::tempdir;

const PRBVH: &str = env!("CARGO_BIN_EXE_prbvh-under-test");

/// Signals, and the exit codes of what they ended.
const SIGNALS: [(&str, i32); 2] = [("INT", 130), ("TERM", 143)];

/// A run of the built-in scene that goes on for long: the published order may cycle, and nothing ends it.
const LONG: &str = "optimize --triangles 100000 --order published --epsilon 0 --device cpu";

fn begin(folder: &Path, arguments: &str) -> Running {
    start(Command::new(PRBVH).current_dir(folder).args(arguments.split(' ')))
}

fn names(folder: &Path) -> BTreeSet<String> {
    std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

#[test]
fn while_a_scene_is_read_every_command_ends_at_once() {
    let folder = tempdir().unwrap();
    let _ = run(PRBVH, folder.path(), &["optimize", "--triangles", "100", "--device", "cpu", "--out", "made"]).ok();
    let fifo = Fifo::new(&folder.path().join("scene.obj"));
    let before = names(folder.path());
    let commands = [
        "optimize scene.obj --device cpu --out out",
        "optimize scene.obj scene.obj.gone --device cpu --json",
        "render scene.obj --device cpu",
        "compare scene.obj --device cpu",
        "plan scene.obj --device cpu",
        "stats made/tree.bvh --scene scene.obj",
    ];
    for (arguments, (signal, code)) in commands.iter().flat_map(|command| SIGNALS.map(|signal| (command, signal))) {
        let mut running = begin(folder.path(), arguments);
        let mut writer = fifo.read_by(&mut running);
        std::io::Write::write_all(&mut writer, b"v 0 0 0\n").unwrap();
        running.signal(signal);
        let ended = running.wait();
        assert_eq!((ended.code, &*ended.stdout), (Some(code), ""), "{arguments}, {signal}: {}", ended.stderr);
        assert_eq!(names(folder.path()), before, "{arguments}, {signal}");
    }
}

#[test]
fn an_optimisation_keeps_its_best_tree() {
    for (signal, code) in SIGNALS {
        let folder = tempdir().unwrap();
        let mut running = begin(folder.path(), &format!("{LONG} --out out --json"));
        running.until(&["iteration   2 "]);
        running.signal(signal);
        let ended = running.wait();
        assert_eq!(ended.code, Some(code), "{}", ended.stderr);
        let report = ended.json();
        assert_eq!(report["stop_reason"], "cancelled");
        assert!(report["final_cost"].as_f64() < report["initial_cost"].as_f64());
        let out = names(&folder.path().join("out"));
        assert!(out.iter().eq(["convergence.svg", "iterations.csv", "report.json", "tree.bvh"]), "{out:?}");
        let stats = run(PRBVH, folder.path(), &["stats", "out/tree.bvh", "--json"]).ok().json();
        assert_eq!(stats["tree_hash"], report["tree_hash"]);
    }
}

#[test]
fn of_a_picture_there_is_nothing() {
    for (signal, code) in SIGNALS {
        let folder = tempdir().unwrap();
        std::fs::write(folder.path().join("picture.png"), "mine").unwrap();
        let arguments = "render --triangles 300 --device cpu --size 512x512 --samples 60000 -o picture.png";
        let mut running = begin(folder.path(), arguments);
        running.until(&["rendering on"]);
        running.signal(signal);
        let ended = running.wait();
        assert_eq!((ended.code, &*ended.stdout), (Some(code), ""), "{}", ended.stderr);
        assert!(names(folder.path()).iter().eq(["picture.png"]));
        assert_eq!(std::fs::read_to_string(folder.path().join("picture.png")).unwrap(), "mine");
    }
}

#[test]
fn a_comparison_keeps_the_rows_that_are_whole() {
    for (signal, code) in SIGNALS {
        let folder = tempdir().unwrap();
        let mut command = Command::new(PRBVH);
        command.current_dir(folder.path()).args(["compare", "--triangles", "300", "--device", "cpu", "--rays", "off"]);
        // Longer than the patience of the test: the process of the other library is ended.
        command.args(["--methods", "lbvh,planted-hang,prbvh", "--peer-timeout", "10000", "--json", "--out", "out"]);
        let mut running = start(&mut command);
        running.until(&["lbvh"]);
        running.signal(signal);
        let ended = running.wait();
        assert_eq!(ended.code, Some(code), "{}", ended.stderr);
        let status = |row: &Value| row["status"].as_str().unwrap().to_owned();
        let status: Vec<String> = ended.json()["rows"].as_array().unwrap().iter().map(status).collect();
        assert_eq!(status[0], "ok");
        assert!(status.len() == 5 && status[1..].iter().all(|status| status == "not run: interrupted"), "{status:?}");
        assert!(ended.stderr.contains("interrupted"), "{}", ended.stderr);
        let out = names(&folder.path().join("out"));
        assert!(["compare.json", "compare.csv", "index.html"].iter().all(|name| out.contains(*name)), "{out:?}");
        assert!(out.iter().all(|name| !name.starts_with('.')), "{out:?}");
    }
}

#[test]
fn within_the_rays_of_a_method_its_row_is_not_run() {
    let folder = tempdir().unwrap();
    let many = "--size 512x512 --samples 60000 --views 1";
    let arguments = format!("compare --triangles 300 --device cpu --methods lbvh,ploc --json -v {many}");
    let mut running = begin(folder.path(), &arguments);
    running.until(&[" begins"]);
    // To build takes no time; if this is not enough, the row is not run either.
    std::thread::sleep(Duration::from_millis(300));
    running.signal("INT");
    let ended = running.wait();
    assert_eq!(ended.code, Some(130), "{}", ended.stderr);
    for row in ended.json()["rows"].as_array().unwrap() {
        assert!(row["status"] == "not run: interrupted" && row["cost"].is_null() && row["build_s"].is_null(), "{row}");
    }
}

#[test]
fn a_table_of_stability_has_the_methods_that_are_whole() {
    let folder = tempdir().unwrap();
    let mut running = begin(folder.path(), "stability --device cpu --json");
    running.until(&["case 1 of "]);
    running.signal("TERM");
    let ended = running.wait();
    assert_eq!(ended.code, Some(143), "{}", ended.stderr);
    let json = ended.json();
    assert_eq!((&json["complete"], &json["red"]), (&false.into(), &0.into()));
    assert!(!json["rows"].as_array().unwrap().is_empty());
}

#[test]
fn a_second_signal_ends_what_the_first_one_left() {
    let folder = tempdir().unwrap();
    let fifo = Fifo::new(&folder.path().join("scene"));
    let mut running = begin(folder.path(), "peer planted-hang --scene-file scene --out out");
    let _writer = fifo.read_by(&mut running);
    running.signal("INT");
    std::thread::sleep(Duration::from_millis(200));
    assert!(running.is_running(), "the comparison decides over this process");
    running.signal("TERM");
    let Ended { code, stderr, .. } = running.wait();
    assert_eq!(code, Some(143), "{stderr}");
}
