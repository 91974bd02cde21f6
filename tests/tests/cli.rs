//! The `prbvh` command, driven as a user would.

use prbvh_tests::command::{Ended, run, start};
use prbvh_tests::devices::without_vulkan;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};
use tempfile::{TempDir, tempdir};

const PRBVH: &str = env!("CARGO_BIN_EXE_prbvh-under-test");

const OUTPUTS: [&str; 4] = ["convergence.svg", "iterations.csv", "report.json", "tree.bvh"];

/// Runs the command in a folder of its own.
fn prbvh(arguments: &[&str]) -> Ended {
    run(PRBVH, tempdir().unwrap().path(), arguments)
}

/// Runs `prbvh optimize` on 3,000 triangles of the built-in scene.
fn optimize(folder: &Path, arguments: &[&str]) -> Ended {
    run(PRBVH, folder, &[&["optimize", "--triangles", "3000"], arguments].concat())
}

/// A folder with a scene of one triangle in it.
fn with_one_triangle() -> TempDir {
    let folder = tempdir().unwrap();
    std::fs::write(folder.path().join("one.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    folder
}

/// Names and contents of the files in a folder.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap().map(Result::unwrap);
    entries.map(|e| (e.file_name().into_string().unwrap(), std::fs::read(e.path()).unwrap_or_default())).collect()
}

/// The value of a line `name   value` of `prbvh stats`.
fn line<'a>(stats: &'a Ended, name: &str) -> &'a str {
    let found = stats.stdout.lines().find_map(|line| line.strip_prefix(name));
    found.unwrap_or_else(|| panic!("no {name} in {}", stats.stdout)).trim()
}

#[test]
fn json_is_one_object_and_the_hash_is_the_same_on_every_device() {
    let folder = tempdir().unwrap();
    let hash_with = |arguments: &[&str]| -> String {
        let report = optimize(folder.path(), &[arguments, &["--json"]].concat()).ok().json();
        assert_eq!((&report["scene"], &report["triangles"]), (&"hall".into(), &3000.into()));
        assert!(report["device"].as_str().is_some_and(|name| !name.is_empty()));
        let number = |key: &str| report[key].as_f64().unwrap_or_else(|| panic!("{key} is {}", report[key]));
        assert!(number("final_cost") > 0.0 && number("final_cost") < 0.8 * number("initial_cost"));
        assert!(number("iterations") >= 9.0 && number("time_s") > 0.0);
        let phases = report["phases"].as_array().unwrap();
        let own: &[&str] =
            if arguments.contains(&"published") { &["cost", "lock", "check"] } else { &["select", "unfold"] };
        let shared = ["morton", "sort", "hierarchy", "search", "reinsert", "refit"];
        for label in shared.iter().chain(own) {
            assert!(
                phases.iter().any(|phase| phase["label"] == *label && phase["calls"].as_u64() > Some(0)),
                "{label}"
            );
        }
        let hash = report["tree_hash"].as_str().unwrap();
        assert!(hash.len() == 32 && hash.bytes().all(|digit| digit.is_ascii_hexdigit()), "{hash}");
        hash.to_owned()
    };
    let hash = hash_with(&["--device", "cpu"]);
    assert_eq!(hash_with(&["--device", "cpu", "--threads", "1"]), hash);
    assert_ne!(hash_with(&["--device", "cpu", "--order", "published"]), hash, "the hash says nothing");
    if !without_vulkan() {
        assert_eq!(hash_with(&["--device", "vulkan"]), hash);
    }
    assert!(contents(folder.path()).is_empty(), "nothing is written without --out");
}

#[test]
fn the_conservative_strategy_falls_as_it_says() {
    let folder = tempdir().unwrap();
    let run = |device: &str, strategy: &str| {
        optimize(folder.path(), &["--device", device, "--order", "published", "--strategy", strategy, "--json"])
            .ok()
            .json()
    };
    let report = run("cpu", "conservative");
    assert_eq!(report["settings"]["strategy"], "conservative");
    let paths =
        |report: &Value| report["plan"].as_array().unwrap().iter().any(|line| line.as_str().unwrap().contains("paths"));
    let aggressive = run("cpu", "aggressive");
    assert!(paths(&aggressive) && !paths(&report), "what the strategy leaves out");
    assert_ne!(aggressive["tree_hash"], report["tree_hash"]);
    let rows = report["rows"].as_array().unwrap();
    let number = |row: &Value, key: &str| row[key].as_f64().unwrap();
    assert!(rows.len() > 10);
    for pair in rows.windows(2) {
        let falls = number(&pair[0], "cost") - number(&pair[1], "cost");
        let said = number(&pair[1], "predicted_decrease");
        assert!((falls - said).abs() < 1e-6 * number(&pair[0], "cost"), "{falls}, not {said}");
    }
    if !without_vulkan() {
        assert_eq!(run("vulkan", "conservative")["tree_hash"], report["tree_hash"]);
    }
}

#[test]
fn atrbvh_is_an_initial_tree_with_a_treelet_of_its_own() {
    let folder = tempdir().unwrap();
    let report = |arguments: &[&str]| {
        optimize(folder.path(), &[arguments, &["--device", "cpu", "--max-iterations", "0", "--json"]].concat())
            .ok()
            .json()
    };
    let initial_cost = |report: &Value| report["initial_cost"].as_f64().unwrap();
    let plain = report(&[]);
    assert!(plain["settings"]["treelet"].is_null());
    let restructured = report(&["--initial", "atrbvh"]);
    assert_eq!(
        (&restructured["settings"]["initial"], &restructured["settings"]["treelet"]),
        (&"atrbvh".into(), &20.into())
    );
    assert!(initial_cost(&restructured) < 0.9 * initial_cost(&plain));
    let phases = restructured["phases"].as_array().unwrap();
    assert!(phases.iter().any(|phase| phase["label"] == "restructure"));
    let small = report(&["--initial", "atrbvh", "--treelet", "5"]);
    assert_eq!(small["settings"]["treelet"], 5);
    assert_ne!(small["tree_hash"], restructured["tree_hash"]);

    optimize(folder.path(), &["--initial", "atrbvh", "--treelet", "33"])
        .refused(&["--treelet", "4 to 32 leaves, not 33"]);
}

#[test]
fn trbvh_hploc_and_rotations_have_settings_of_their_own() {
    let folder = tempdir().unwrap();
    let report =
        |arguments: &[&str]| optimize(folder.path(), &[arguments, &["--device", "cpu", "--json"]].concat()).ok().json();
    let optimal = report(&["--initial", "trbvh", "--passes", "1", "--max-iterations", "0"]);
    assert_eq!((&optimal["settings"]["initial"], &optimal["settings"]["passes"]), (&"trbvh".into(), &1.into()));
    let more = report(&["--initial", "trbvh", "--max-iterations", "0"]);
    assert_eq!(more["settings"]["passes"], 3);
    let cost = |report: &Value, key: &str| report[key].as_f64().unwrap();
    assert!(cost(&more, "initial_cost") < cost(&optimal, "initial_cost"));
    let hploc = report(&["--initial", "hploc", "--radius", "3", "--max-iterations", "0"]);
    assert_eq!((&hploc["settings"]["initial"], &hploc["settings"]["radius"]), (&"hploc".into(), &3.into()));
    let binned = report(&["--initial", "sah-binned", "--bins", "8", "--max-iterations", "0"]);
    assert_eq!((&binned["settings"]["initial"], &binned["settings"]["bins"]), (&"sah-binned".into(), &8.into()));
    let rotated = report(&["--optimizer", "rotations", "--annealing", "3"]);
    let settings = &rotated["settings"];
    assert_eq!((&settings["optimizer"], &settings["rotations"]["annealing_passes"]), (&"rotations".into(), &3.into()));
    assert!(settings["rbvh"].is_null() && cost(&rotated, "final_cost") < 0.9 * cost(&rotated, "initial_cost"));
    optimize(folder.path(), &["--initial", "lbvh", "--passes", "3"]).refused(&["--passes", "trbvh"]);
}

#[test]
fn the_outputs_say_the_same() {
    let folder = tempdir().unwrap();
    let ran = optimize(folder.path(), &["--device", "cpu", "--out", "a/b", "--json"]).ok();
    let out = folder.path().join("a/b");
    assert!(contents(&out).into_keys().eq(OUTPUTS), "{:?}", contents(&out).keys());

    let report: Value = serde_json::from_slice(&std::fs::read(out.join("report.json")).unwrap()).unwrap();
    assert_eq!(report, ran.json());
    let csv = std::fs::read_to_string(out.join("iterations.csv")).unwrap();
    let (header, lines) = csv.split_once('\n').unwrap();
    let column = |name| header.split(',').position(|column| column == name).unwrap();
    let (iteration, cost) = (column("iteration"), column("cost"));
    let rows = report["rows"].as_array().unwrap();
    assert_eq!(rows.len() as u64, report["iterations"].as_u64().unwrap() + 1);
    assert_eq!(lines.lines().count(), rows.len());
    for (line, row) in lines.lines().zip(rows) {
        let fields: Vec<&str> = line.split(',').collect();
        assert_eq!(fields[iteration].parse::<u64>().unwrap(), row["iteration"].as_u64().unwrap());
        assert_eq!(fields[cost].parse::<f64>().unwrap(), row["cost"].as_f64().unwrap());
    }

    let stats = run(PRBVH, &out, &["stats", "tree.bvh"]).ok();
    assert_eq!(line(&stats, "tree hash"), report["tree_hash"]);
    assert!(line(&stats, "valid").starts_with("yes"));
    let final_cost = report["final_cost"].as_f64().unwrap();
    assert!(line(&stats, "SAH cost").starts_with(&format!("{final_cost:.3}")));
    assert_eq!((line(&stats, "nodes"), line(&stats, "triangles")), ("5999", "3000"));
    let stats = run(PRBVH, &out, &["stats", "tree.bvh", "--json"]).ok().json();
    assert_eq!((&stats["tree_hash"], &stats["sah_cost"]), (&report["tree_hash"], &report["final_cost"]));
    assert_eq!((&stats["valid"], &stats["max_depth"]), (&true.into(), &report["quality"]["final"]["max_depth"]));
}

#[test]
fn the_optimizer_is_chosen_and_said() {
    let folder = tempdir().unwrap();
    let with = |optimizer: &str| {
        let arguments = ["optimize", "built-in", "--triangles", "2000", "--device", "cpu", "--json", "--optimizer"];
        let report = run(PRBVH, folder.path(), &[&arguments[..], &[optimizer]].concat()).ok().json();
        assert_eq!(report["settings"]["optimizer"], optimizer);
        assert_eq!(report["settings"]["rbvh"].is_object(), optimizer == "rbvh");
        report
    };
    let cost = |report: &Value| report["final_cost"].as_f64().unwrap();
    let (none, rbvh, prbvh) = (with("none"), with("rbvh"), with("prbvh"));
    assert_eq!((&none["final_cost"], &none["iterations"]), (&none["initial_cost"], &0.into()));
    assert_eq!(none["stop_reason"], "no optimiser");
    assert_eq!((&rbvh["stop_reason"], &rbvh["settings"]["rbvh"]["seed"]), (&"converged".into(), &1.into()));
    assert!(cost(&rbvh) < 0.8 * cost(&none) && cost(&prbvh) < 1.1 * cost(&rbvh));
    assert!(rbvh["phases"].as_array().unwrap().iter().any(|phase| phase["label"] == "reinsert"));
    assert_eq!(with("rbvh")["tree_hash"], rbvh["tree_hash"]);
}

#[test]
fn stats_says_by_what_rule_a_root_without_area_costs() {
    let folder = tempdir().unwrap();
    std::fs::write(folder.path().join("line.obj"), "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 3 0 0\nf 1 2 3\nf 2 3 4\n").unwrap();
    let _ = run(PRBVH, folder.path(), &["optimize", "line.obj", "--device", "cpu", "--out", "."]).ok();
    let stats = run(PRBVH, folder.path(), &["stats", "tree.bvh"]).ok();
    assert!(line(&stats, "SAH cost").starts_with("7.000") && stats.stdout.contains("has no area"), "{}", stats.stdout);
    assert_eq!(run(PRBVH, folder.path(), &["stats", "tree.bvh", "--json"]).ok().json()["is_root_flat"], true);
}

#[test]
fn stats_checks_the_tree_against_its_scene() {
    let folder = tempdir().unwrap();
    let _ = optimize(folder.path(), &["--device", "cpu", "--out", "."]).ok();
    let stats = |arguments: &[&str]| run(PRBVH, folder.path(), &[&["stats", "tree.bvh"], arguments].concat());
    let own = stats(&["--scene", "built-in", "--triangles", "3000"]).ok();
    assert_eq!(line(&own, "valid"), "yes (leaf boxes checked)");
    let tree = prbvh::bvh::file::read(&folder.path().join("tree.bvh")).unwrap().tree;
    let scene = prbvh::scene::built_in(3000);
    let epo = prbvh::bvh::epo(&tree, &scene.triangles, &Default::default());
    assert!(epo.is_exact() && epo.value > 0.0);
    assert!(line(&own, "EPO").starts_with(&format!("{:.3} (", epo.value)), "{}", own.stdout);
    let json = stats(&["--scene", "built-in", "--triangles", "3000", "--json"]).ok().json();
    assert_eq!((json["epo"].as_f64(), json["epo_error"].as_f64()), (Some(epo.value), Some(0.0)));
    assert_eq!((&json["epo_drawn"], &json["is_root_flat"]), (&0.into(), &false.into()));
    let without = stats(&["--json"]).ok().json();
    assert_eq!((&without["epo"], &without["epo_error"]), (&Value::Null, &Value::Null));
    let hash_of = |triangles| prbvh::scene::built_in(triangles).hash;
    assert_eq!(line(&own, "scene hash"), hash_of(3000));
    stats(&["--scene", "built-in", "--triangles", "3001"]).refused(&[&hash_of(3000), &hash_of(3001)]);

    let file = folder.path().join("tree.bvh");
    let good = std::fs::read(&file).unwrap();
    for at in [0, 9, 30, good.len() / 2, good.len() - 1] {
        let mut bad = good.clone();
        bad[at] ^= 0x04;
        std::fs::write(&file, bad).unwrap();
        stats(&[]).refused(&["tree.bvh", "at byte"]);
        stats(&["--json"]).refused(&["tree.bvh"]);
    }
    for length in [0, 63, good.len() - 1] {
        std::fs::write(&file, &good[..length]).unwrap();
        stats(&[]).refused(&["tree.bvh", "at byte"]);
    }
    run(PRBVH, folder.path(), &["stats", "gone.bvh"]).refused(&["gone.bvh"]);
    run(PRBVH, folder.path(), &["stats", "."]).refused(&["not a regular file"]);
}

#[test]
fn without_arguments_the_built_in_scene_is_optimised_and_reported() {
    let folder = tempdir().unwrap();
    let ran = run(PRBVH, folder.path(), &[]).ok();
    assert!(contents(&folder.path().join("prbvh-report")).into_keys().eq(OUTPUTS));
    for part in ["hall", "250,000", "initial cost", "final cost", "tree hash", "search"] {
        assert!(ran.stdout.contains(part), "{part}: {}", ran.stdout);
    }
}

#[test]
fn devices_are_listed() {
    let text = prbvh(&["devices"]).ok().stdout;
    assert!(text.starts_with("cpu "), "{text}");
    let json = prbvh(&["devices", "--json"]).ok().json();
    assert_eq!(json["cpu"]["kind"], "cpu");
    if !without_vulkan() {
        assert_ne!(json["vulkan"], Value::Array(Vec::new()));
        for device in json["vulkan"].as_array().unwrap() {
            assert!(text.contains(device["name"].as_str().unwrap()), "{text}");
        }
        assert!(text.contains("maxStorageBufferRange"), "{text}");
    }
}

#[test]
fn a_driver_tells_what_it_makes_of_the_kernels_or_that_it_does_not() {
    // Mesa's driver for AMD, where it is installed, compiles for a GPU that is not there.
    let mut command = Command::new(PRBVH);
    let json =
        start(command.env("RADV_FORCE_FAMILY", "navi21").args(["devices", "--kernels", "--json"])).wait().ok().json();
    let of = |key: &str| json[key].as_array().unwrap().clone();
    assert_eq!(of("kernels").len(), of("vulkan").len());
    assert!(without_vulkan() || !of("kernels").is_empty());
    for (device, told) in of("vulkan").iter().zip(of("kernels")) {
        let kernels = told["kernels"].as_array().unwrap();
        let error = told["error"].as_str().unwrap_or_default();
        assert_ne!(kernels.is_empty(), error.is_empty(), "{device}: {told}");
        if device["driver"].as_str().unwrap().starts_with("radv") {
            let search = kernels.iter().find(|kernel| kernel["kernel"] == "dual_search").unwrap();
            let statistics = search["executables"][0]["statistics"].as_array().unwrap();
            let registers = statistics.iter().find(|statistic| statistic["name"] == "VGPRs").unwrap();
            assert!(registers["value"].as_u64().unwrap() > 0, "{search}");
        }
    }
}

#[test]
fn help_and_version_go_to_stdout() {
    let help = prbvh(&["--help"]).ok().stdout;
    for part in ["optimize", "stats", "devices"] {
        assert!(help.contains(part), "{part}: {help}");
    }
    let help = prbvh(&["optimize", "--help"]).ok().stdout;
    for part in [
        "--initial",
        "--order",
        "--strategy",
        "--mu",
        "--epsilon",
        "--max-time",
        "--max-iterations",
        "--max-depth",
        "--device",
        "--threads",
        "--out",
        "--json",
        "--triangles",
        "--validate",
    ] {
        assert!(help.contains(part), "{part}: {help}");
    }
    assert_eq!(prbvh(&["--version"]).ok().stdout, format!("prbvh {}\n", env!("CARGO_PKG_VERSION")));
}

#[test]
fn bad_arguments_are_named() {
    let folder = with_one_triangle();
    let cases: [(&[&str], &[&str]); 28] = [
        (&["--frobnicate"], &["--frobnicate"]),
        (&["--mu", "0"], &["--mu", "0"]),
        (&["--mu", "x"], &["--mu", "'x'"]),
        (&["--mu", "-3"], &["--mu", "-3"]),
        (&["--mu", "4294967296"], &["--mu", "4294967296"]),
        (&["--epsilon", "-1"], &["--epsilon", "-1", "at least 0"]),
        (&["--epsilon", "nan"], &["--epsilon", "nan"]),
        (&["--epsilon", "inf"], &["--epsilon", "inf", "finite"]),
        (&["--epsilon-absolute", "-0.5"], &["--epsilon-absolute", "-0.5"]),
        (&["--epsilon", "1", "--epsilon-absolute", "1"], &["--epsilon", "--epsilon-absolute"]),
        (&["--mu", "4"], &["--mu", "--order published", "worst-first"]),
        (&["--order", "largest-first"], &["--order", "largest-first", "worst-first", "published"]),
        (&["--moves", "dual"], &["--moves"]),
        (&["--max-time", "-1"], &["--max-time", "-1", "at least 0"]),
        (&["--max-time", "soon"], &["--max-time", "soon"]),
        (&["--max-iterations", "-1"], &["--max-iterations", "-1"]),
        (&["--device", "gpu"], &["--device", "gpu", "vulkan:N"]),
        (&["--device", "vulkan:x"], &["--device", "vulkan:x"]),
        (&["--threads", "5000"], &["--threads", "5000", "1024"]),
        (&["--threads", "-1"], &["--threads", "-1"]),
        (&["--initial", "magic"], &["--initial", "magic", "lbvh"]),
        (&["--initial", "ploc", "--radius", "-1"], &["--radius", "-1"]),
        (&["--initial", "sah-sweep", "--radius", "5"], &["--radius", "sah-sweep"]),
        (&["--strategy", "shy"], &["--strategy", "shy", "aggressive", "conservative"]),
        (&["--morton-bits", "31"], &["--morton-bits", "31", "60"]),
        (&["one.obj", "--triangles", "5"], &["--triangles", "one.obj"]),
        (&["one.obj", "one.obj", "--triangles", "5"], &["--triangles", "one.obj"]),
        (&["--list", "gone.txt"], &["--list", "gone.txt"]),
    ];
    for (arguments, parts) in cases {
        run(PRBVH, folder.path(), &[&["optimize", "--out", "out"], arguments].concat()).refused(parts);
    }
    for triangles in ["0", "-5", "x", "99999999999", "99999999999999999999"] {
        run(PRBVH, folder.path(), &["optimize", "--triangles", triangles]).refused(&["--triangles", triangles]);
    }
    run(PRBVH, folder.path(), &["optimize", "one.obj", "--initial", "gone.bvh"]).refused(&["gone.bvh"]);
    prbvh(&["frobnicate"]).refused(&["frobnicate"]);
    prbvh(&["stats"]).refused(&["TREE"]);
    assert!(contents(folder.path()).into_keys().eq(["one.obj"]), "a refused run leaves nothing");
}

#[test]
fn a_vulkan_device_that_is_not_there_is_named() {
    if !without_vulkan() {
        prbvh(&["optimize", "--device", "vulkan:99"]).refused(&["Vulkan device 99", "there are 0: "]);
    }
}

#[test]
fn without_a_vulkan_driver_the_install_command_is_named_and_the_cpu_taken() {
    const INSTALL: &str = "apt-get install mesa-vulkan-drivers";
    let folder = with_one_triangle();
    let driverless = |arguments: &[&str]| {
        let mut command = Command::new(PRBVH);
        command.env("VK_DRIVER_FILES", "/nonexistent").env("VK_ICD_FILENAMES", "/nonexistent");
        start(command.current_dir(folder.path()).args(arguments)).wait()
    };
    driverless(&["optimize", "one.obj", "--device", "vulkan"]).refused(&["Vulkan", INSTALL]);
    let ran = driverless(&["optimize", "one.obj", "--device", "auto", "--json"]).ok();
    assert_eq!(ran.json()["device_details"]["kind"], "cpu");
    assert!(ran.stderr.contains("on the CPU: no Vulkan") && ran.stderr.contains(INSTALL), "{}", ran.stderr);
    let devices = driverless(&["devices"]).ok();
    assert!(devices.stdout.contains("cpu ") && devices.stdout.contains(INSTALL), "{}", devices.stdout);
    assert!(driverless(&["devices", "--json"]).ok().json()["no_vulkan"].as_str().unwrap().contains(INSTALL));
}

#[test]
fn the_log_has_a_row_per_iteration_and_can_be_silenced() {
    let folder = tempdir().unwrap();
    let arguments = ["--device", "cpu", "--max-iterations", "4", "--json"];
    let log = optimize(folder.path(), &arguments).ok().stderr;
    let rows: Vec<&str> = log.lines().filter(|line| line.contains("iteration ")).collect();
    assert_eq!(rows.len(), 5, "{log}");
    for part in ["cost", "found", "owned", "applied", "searched"] {
        assert!(rows.iter().all(|row| row.contains(part)), "{part}: {log}");
    }
    assert_eq!(optimize(folder.path(), &[&arguments[..], &["-q"]].concat()).ok().stderr, "");
}

#[test]
fn limits_end_a_run_well() {
    let folder = tempdir().unwrap();
    let stopped = |arguments: &[&str]| {
        let report = optimize(folder.path(), &[arguments, &["--device", "cpu", "--json"]].concat()).ok().json();
        (report["stop_reason"].as_str().unwrap().to_owned(), report["iterations"].as_u64().unwrap())
    };
    assert_eq!(stopped(&["--max-iterations", "2"]), ("iteration limit".to_owned(), 2));
    assert_eq!(stopped(&["--max-time", "0"]), ("time limit".to_owned(), 0));
    assert_eq!(stopped(&["--max-time", "1e300"]).0, "converged");
    assert_eq!(stopped(&["--order", "published", "--epsilon", "0"]).0, "converged");
}

#[test]
fn an_output_folder_that_cannot_be_made_is_refused_before_the_run() {
    let folder = with_one_triangle();
    std::fs::write(folder.path().join("file"), "mine").unwrap();
    for out in ["file", "file/below"] {
        let ran = optimize(folder.path(), &["--device", "cpu", "--out", out]);
        ran.refused(&["--out", out]);
        assert!(!ran.stderr.contains("iteration"), "{}", ran.stderr);
    }
    assert_eq!(std::fs::read_to_string(folder.path().join("file")).unwrap(), "mine");
    assert!(contents(folder.path()).into_keys().eq(["file", "one.obj"]));
}

#[test]
fn a_failed_run_leaves_an_earlier_report_whole() {
    let folder = with_one_triangle();
    let _ = optimize(folder.path(), &["--device", "cpu", "--out", "out"]).ok();
    let out = folder.path().join("out");
    let before = contents(&out);
    run(PRBVH, folder.path(), &["optimize", "gone.obj", "--out", "out"]).refused(&["gone.obj", "no such file"]);
    assert!(contents(&out) == before);

    // A folder in the place of a file: the others are still whole, and the outcome is not lost.
    std::fs::remove_file(out.join("report.json")).unwrap();
    std::fs::create_dir(out.join("report.json")).unwrap();
    let ran = run(PRBVH, folder.path(), &["optimize", "one.obj", "--device", "cpu", "--out", "out", "--json"]);
    assert_eq!(ran.code, Some(1), "{}", ran.stderr);
    assert!(ran.stderr.contains("report.json") && ran.stderr.contains("could not be written"), "{}", ran.stderr);
    assert_eq!(ran.json()["scene"], "one");
    let after = contents(&out);
    assert!(after.keys().eq(before.keys()), "{:?}", after.keys());
    assert!(after["iterations.csv"] == before["iterations.csv"] && after["tree.bvh"] != before["tree.bvh"]);
    let stats = run(PRBVH, &out, &["stats", "tree.bvh", "--json"]).ok().json();
    assert_eq!(stats["tree_hash"], ran.json()["tree_hash"]);
}

/// Runs with a reader of stdout or stderr that goes away at once.
fn unread(arguments: &[&str], stdout: Stdio, stderr: Stdio) -> Option<i32> {
    let folder = with_one_triangle();
    let mut command = Command::new(PRBVH);
    command.current_dir(folder.path()).args(arguments).stdin(Stdio::null()).stdout(stdout).stderr(stderr);
    let mut child = command.spawn().unwrap();
    drop((child.stdout.take(), child.stderr.take()));
    child.wait().unwrap().code()
}

#[test]
fn readers_may_go_away() {
    for arguments in ["devices", "devices --json", "--help", "optimize one.obj --device cpu --json"] {
        let arguments: Vec<&str> = arguments.split(' ').collect();
        let log = tempfile::NamedTempFile::new().unwrap();
        assert_eq!(unread(&arguments, Stdio::piped(), log.reopen().unwrap().into()), Some(0), "{arguments:?}");
        assert!(!std::fs::read_to_string(&log).unwrap().contains("panicked"), "{arguments:?}");
    }
    // A lost log costs no result.
    let json = tempfile::NamedTempFile::new().unwrap();
    let arguments = ["optimize", "--triangles", "3000", "--device", "cpu", "--json"];
    assert_eq!(unread(&arguments, json.reopen().unwrap().into(), Stdio::piped()), Some(0));
    let report: Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    assert_eq!(report["triangles"], 3000);
    assert_eq!(unread(&["optimize", "gone.obj", "--device", "cpu"], Stdio::null(), Stdio::piped()), Some(1));
    assert_eq!(unread(&["--frobnicate"], Stdio::null(), Stdio::piped()), Some(2));
}
