//! `prbvh optimize` of many scenes in a row.

use prbvh_tests::command::{Ended, run, start};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::SystemTime;
use tempfile::{TempDir, tempdir};

const PRBVH: &str = env!("CARGO_BIN_EXE_prbvh-under-test");

fn square(side: u32) -> String {
    format!("v 0 0 0\nv {side} 0 0\nv {side} {side} 0\nv 0 {side} 0\nf 1 2 3\nf 1 3 4\n")
}

/// `a/chair.obj`, `b/chair.obj`, `lamp.obj`, and `broken.obj`, which is none.
fn with_scenes() -> TempDir {
    let folder = tempdir().unwrap();
    for sub in ["a", "b"] {
        fs::create_dir(folder.path().join(sub)).unwrap();
    }
    for (name, text) in [("a/chair.obj", square(1)), ("b/chair.obj", square(2)), ("lamp.obj", square(3))] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    fs::write(folder.path().join("broken.obj"), "v 0 0 0\nf 1 2 3\n").unwrap();
    folder
}

fn optimize(folder: &Path, arguments: &[&str]) -> Ended {
    run(PRBVH, folder, &[&["optimize"], arguments, &["--device", "cpu", "--out", "out", "--json"]].concat())
}

fn lines(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Scene and status of each line.
fn told(lines: &[Value]) -> Vec<(&str, &str)> {
    lines.iter().map(|line| (line["scene"].as_str().unwrap(), line["status"].as_str().unwrap())).collect()
}

fn summary(folder: &Path) -> Vec<Value> {
    lines(&fs::read_to_string(folder.join("out/summary.jsonl")).unwrap())
}

fn names(folder: &Path) -> BTreeSet<String> {
    fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

#[test]
fn each_scene_has_a_folder_and_a_line_and_a_failure_ends_nothing() {
    let folder = with_scenes();
    let ended = optimize(folder.path(), &["a/chair.obj", "broken.obj", "b/chair.obj", "gone.obj", "lamp.obj"]);
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    for part in ["2 of 5 scenes failed", "broken.obj, line 2", "gone.obj: no such file"] {
        assert!(ended.stderr.contains(part), "{part}: {}", ended.stderr);
    }
    let said = lines(&ended.stdout);
    let expected = [
        ("a/chair.obj", "done"),
        ("broken.obj", "failed"),
        ("b/chair.obj", "done"),
        ("gone.obj", "failed"),
        ("lamp.obj", "done"),
    ];
    assert_eq!((told(&said), summary(folder.path())), (expected.to_vec(), said.clone()));
    assert!(said[1]["error"].as_str().unwrap().contains("line 2") && said[0]["error"].is_null());

    let out = folder.path().join("out");
    let done = [&said[0], &said[2], &said[4]];
    let folders: Vec<&str> = done.iter().map(|line| line["name"].as_str().unwrap()).collect();
    assert!(folders[0].starts_with("chair-") && folders[1].starts_with("chair-") && folders[0] != folders[1]);
    assert_eq!(folders[2], "lamp");
    let expected = folders.iter().copied().chain(["summary.jsonl"]).map(str::to_owned).collect();
    assert_eq!(names(&out), expected);
    for line in done {
        let own = out.join(line["name"].as_str().unwrap());
        assert!(names(&own).iter().eq(["convergence.svg", "iterations.csv", "report.json", "tree.bvh"]));
        let report: Value = serde_json::from_slice(&fs::read(own.join("report.json")).unwrap()).unwrap();
        for key in ["tree_hash", "initial_cost", "final_cost", "triangles", "stop_reason"] {
            assert_eq!(line[key], report[key], "{key}");
        }
        assert_eq!(line["scene_hash"], report["scene_details"]["hash"]);
        let stats = run(PRBVH, &own, &["stats", "tree.bvh", "--json"]).ok().json();
        assert_eq!(line["tree_hash"], stats["tree_hash"]);
    }
}

#[test]
fn a_scene_in_a_row_has_the_tree_and_the_memory_that_it_has_alone() {
    let folder = with_scenes();
    let _ = optimize(folder.path(), &["built-in", "lamp.obj", "--triangles", "5000"]).ok();
    let report =
        |path: &str| -> Value { serde_json::from_slice(&fs::read(folder.path().join(path)).unwrap()).unwrap() };
    let row = report("out/lamp/report.json");
    let _ = run(PRBVH, folder.path(), &["optimize", "lamp.obj", "--device", "cpu", "--out", "alone"]).ok();
    let alone = report("alone/report.json");
    for key in ["tree_hash", "memory", "plan", "settings"] {
        assert_eq!(row[key], alone[key], "{key}");
    }
}

#[test]
fn resume_leaves_what_is_done_and_does_what_changed() {
    let folder = with_scenes();
    let path = |name: &str| folder.path().join(name);
    let all = ["lamp.obj", "a/chair.obj", "broken.obj"];
    let resume = |more: &[&str]| optimize(folder.path(), &[&all[..], &["--resume"], more].concat());
    let statuses = |ended: &Ended| -> Vec<String> {
        lines(&ended.stdout).iter().map(|line| line["status"].as_str().unwrap().to_owned()).collect()
    };
    let changed = |name: &str| -> SystemTime { fs::metadata(path(name)).unwrap().modified().unwrap() };
    assert_eq!(statuses(&resume(&[])), ["done", "done", "failed"]);
    let before = (changed("out/lamp/tree.bvh"), changed("out/chair/report.json"));
    let again = resume(&[]);
    assert_eq!((again.code, &*statuses(&again)), (Some(1), &["skipped", "skipped", "failed"].map(str::to_owned)[..]));
    assert_eq!((changed("out/lamp/tree.bvh"), changed("out/chair/report.json")), before);
    assert_eq!(lines(&again.stdout)[0]["tree_hash"], summary(folder.path())[0]["tree_hash"]);

    // Another scene of the same name, a set that is not whole, one of two runs.
    fs::write(path("broken.obj"), square(5)).unwrap();
    fs::write(path("lamp.obj"), square(4)).unwrap();
    assert_eq!(statuses(&resume(&[])), ["done", "skipped", "done"]);
    assert_eq!(statuses(&resume(&[])), ["skipped", "skipped", "skipped"]);
    fs::remove_file(path("out/lamp/convergence.svg")).unwrap();
    let _ = fs::copy(path("out/broken/tree.bvh"), path("out/chair/tree.bvh")).unwrap();
    assert_eq!(statuses(&resume(&[])), ["done", "done", "skipped"]);
    assert_eq!(statuses(&resume(&["--max-iterations", "3"])), ["done", "done", "done"]);
    assert_eq!(statuses(&resume(&["--max-iterations", "3", "--threads", "1"])), ["skipped", "skipped", "skipped"]);
    // Without it all is done anew; earlier lines stay.
    let before = summary(folder.path()).len();
    assert_eq!(statuses(&optimize(folder.path(), &all)), ["done", "done", "done"]);
    assert_eq!(summary(folder.path()).len(), before + 3);

    // What was left of a line when a run was killed.
    let text = fs::read_to_string(path("out/summary.jsonl")).unwrap();
    fs::write(path("out/summary.jsonl"), text.trim_end().to_owned() + "\n{\"schema\":1,\"sce").unwrap();
    assert_eq!(statuses(&resume(&[])), ["skipped", "skipped", "skipped"]);
    assert_eq!(fs::read_to_string(path("out/summary.jsonl")).unwrap(), text);
}

#[test]
fn a_list_names_scenes_and_one_alone_is_a_row_too() {
    let folder = with_scenes();
    fs::write(folder.path().join("list.txt"), "# furniture\n\nlamp.obj\r\n").unwrap();
    let ended = optimize(folder.path(), &["--list", "list.txt"]).ok();
    assert_eq!(told(&lines(&ended.stdout)), [("lamp.obj", "done")]);
    assert!(folder.path().join("out/lamp/tree.bvh").is_file());

    fs::write(folder.path().join("list.txt"), "# none\n").unwrap();
    optimize(folder.path(), &["--list", "list.txt"]).refused(&["list.txt", "no scene"]);
    run(PRBVH, folder.path(), &["optimize", "lamp.obj", "--resume"]).refused(&["--out"]);

    let mut command = Command::new(PRBVH);
    command.current_dir(folder.path()).args(["optimize", "--list", "-", "--device", "cpu"]);
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    std::io::Write::write_all(&mut child.stdin.take().unwrap(), b"lamp.obj\na/chair.obj").unwrap();
    let ended = child.wait_with_output().unwrap();
    let text = String::from_utf8(ended.stdout).unwrap();
    assert!(ended.status.success() && text.lines().count() == 3, "{text}");
    assert!(text.contains("lamp") && text.contains("chair") && text.contains("final cost"), "{text}");
}

#[test]
fn a_plan_takes_the_same_scenes() {
    let folder = with_scenes();
    fs::write(folder.path().join("list.txt"), "lamp.obj\n").unwrap();
    let json = run(PRBVH, folder.path(), &["plan", "a/chair.obj", "--list", "list.txt", "--device", "cpu", "--json"]);
    assert_eq!(json.ok().json()["plans"].as_array().unwrap().len(), 2);
}

#[cfg(unix)]
#[test]
fn a_signal_keeps_what_is_whole_and_resume_goes_on_there() {
    let folder = with_scenes();
    let arguments =
        "optimize lamp.obj built-in a/chair.obj --triangles 100000 --order published --epsilon 0 -v --resume";
    let arguments: Vec<&str> = arguments.split(' ').chain(["--device", "cpu", "--out", "out", "--json"]).collect();
    for first in ["done", "skipped"] {
        let mut running = start(Command::new(PRBVH).current_dir(folder.path()).args(&arguments));
        running.until(&["hall: 100000 triangles", "iteration   2 "]);
        running.signal("INT");
        let ended = running.wait();
        assert_eq!(ended.code, Some(130), "{}", ended.stderr);
        assert_eq!(told(&lines(&ended.stdout)), [("lamp.obj", first), ("built-in", "interrupted")]);
        assert!(ended.stderr.contains("1 were not begun"), "{}", ended.stderr);
        let expected = ["built-in", "lamp", "summary.jsonl"].map(str::to_owned).into();
        assert_eq!(names(&folder.path().join("out")), expected);
        let stats = run(PRBVH, folder.path(), &["stats", "out/built-in/tree.bvh", "--json"]).ok().json();
        assert_eq!(summary(folder.path()).last().unwrap()["tree_hash"], stats["tree_hash"]);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_stdout_costs_no_scene() {
    for json in [&["--json"][..], &[]] {
        let folder = with_scenes();
        let full = fs::File::options().write(true).open("/dev/full").unwrap();
        let mut command = Command::new(PRBVH);
        command.current_dir(folder.path()).args([
            "optimize",
            "a/chair.obj",
            "lamp.obj",
            "--device",
            "cpu",
            "--out",
            "out",
        ]);
        let ended = command.args(json).stdin(Stdio::null()).stdout(full).output().unwrap();
        let stderr = String::from_utf8_lossy(&ended.stderr);
        assert!(ended.status.code() == Some(1) && stderr.contains("stdout: No space left on device"), "{stderr}");
        assert_eq!(told(&summary(folder.path())), [("a/chair.obj", "done"), ("lamp.obj", "done")]);
    }
}
