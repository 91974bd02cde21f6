//! What a user may get wrong with the methods: a right result or a clear error, of `optimize`, `render` and `compare`.

use prbvh_tests::command::{Ended, run};
use std::path::Path;
use tempfile::{TempDir, tempdir};

const PRBVH: &str = env!("CARGO_BIN_EXE_prbvh-under-test");

const SMALL: [&str; 4] = ["--triangles", "400", "--device", "cpu"];
const FEW_RAYS: [&str; 4] = ["--size", "24x16", "--bounces", "1"];

fn prbvh(folder: &Path, arguments: &[&str]) -> Ended {
    run(PRBVH, folder, arguments)
}

/// A folder with `tree.bvh` over the built-in scene of 400 triangles.
fn with_a_tree() -> TempDir {
    let folder = tempdir().unwrap();
    let _ = prbvh(folder.path(), &[&["optimize", "--out", ".", "-q"], &SMALL[..]].concat()).ok();
    folder
}

#[test]
fn mu_and_radius_out_of_range_are_refused_by_name() {
    let folder = tempdir().unwrap();
    let cases: [(&[&str], &[&str]); 14] = [
        (&["--mu", "0"], &["--mu", "'0'", "not in 1.."]),
        (&["--mu", "4,0"], &["--mu", "'0'"]),
        (&["--mu", "x"], &["--mu", "'x'"]),
        (&["--radius", "0"], &["--radius", "not in 1.."]),
        (&["--radius", "-5"], &["--radius", "-5"]),
        (&["--methods", "lbvh,magic"], &["--methods", "`magic`", "lbvh", "ploc", "prbvh", "sah-sweep"]),
        (&["--device", "cpu,gpu"], &["--device", "`gpu`", "or all"]),
        (&["--repeat", "0"], &["--repeat"]),
        (&["--rays", "some"], &["--rays", "off"]),
        (&["--size", "0x9"], &["--size", "0x9"]),
        (&["--views", "4"], &["--views", "4"]),
        (&["--light-samples", "17"], &["--light-samples"]),
        (&["--peer-timeout", "-1"], &["--peer-timeout", "at least 0"]),
        (&["gone.obj"], &["gone.obj", "no such file"]),
    ];
    for (arguments, parts) in cases {
        prbvh(folder.path(), &[&["compare", "--out", "out"], arguments].concat()).refused(parts);
    }
    prbvh(folder.path(), &["compare", "a.obj", "--triangles", "9"]).refused(&["--triangles", "built-in"]);
    prbvh(folder.path(), &["optimize", "--initial", "ploc", "--radius", "0"]).refused(&["--radius"]);
    prbvh(folder.path(), &["peer", "magic", "--scene-file", "a", "--out", "b"]).refused(&["no peer `magic`"]);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "a refused comparison leaves nothing");
}

#[test]
fn mu_beyond_the_nodes_and_a_radius_beyond_the_triangles_work() {
    let folder = tempdir().unwrap();
    let optimized = |arguments: &[&str]| {
        let json = prbvh(folder.path(), &[&["optimize", "--json"], &SMALL[..], arguments].concat()).ok().json();
        let [initial, last] = ["initial_cost", "final_cost"].map(|key| json[key].as_f64().unwrap());
        assert!(last < initial, "{arguments:?}: {initial}, then {last}");
    };
    // One node or none an iteration: what stops it is the limit of iterations.
    optimized(&["--order", "published", "--mu", "2000"]);
    optimized(&["--order", "published", "--mu", "4294967295", "--max-iterations", "2000"]);
    optimized(&["--initial", "ploc", "--radius", "10000"]);
}

#[test]
fn trees_that_are_none_or_of_another_scene() {
    let folder = with_a_tree();
    let good = std::fs::read(folder.path().join("tree.bvh")).unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    let mut flipped = good.clone();
    flipped[good.len() / 2] ^= 0x10;
    write("flipped.bvh", &flipped);
    write("short.bvh", &good[..good.len() - 7]);
    write("empty.bvh", b"");
    write("text.bvh", b"this is no tree, but some text that is longer than the header of a tree file would be");
    let uses: [&[&str]; 2] = [&["optimize", "--initial"], &["render", "--size", "8x8", "--tree"]];
    for name in ["flipped.bvh", "short.bvh", "empty.bvh", "text.bvh", "gone.bvh"] {
        for arguments in uses {
            prbvh(folder.path(), &[arguments, &[name], &SMALL].concat()).refused(&[name]);
        }
    }
    for arguments in uses {
        let other = ["tree.bvh", "--triangles", "401", "--device", "cpu"];
        prbvh(folder.path(), &[arguments, &other].concat()).refused(&["tree.bvh", "hash"]);
        let _ = prbvh(folder.path(), &[arguments, &["tree.bvh"], &SMALL].concat()).ok();
    }
    prbvh(folder.path(), &["compare", "tree.bvh"]).refused(&["tree.bvh", "unknown extension"]);
}

#[test]
fn nothing_in_view_and_an_eye_in_a_box() {
    let folder = with_a_tree();
    let render = |arguments: &[&str]| {
        let arguments = [&["render", "--tree", "tree.bvh", "--json"], &SMALL[..], &FEW_RAYS, arguments].concat();
        prbvh(folder.path(), &arguments).ok()
    };
    let away = render(&["--eye", "1000,1000,1000", "--look-at", "2000,2000,2000"]);
    assert!(away.stderr.contains("no triangle is in view"), "{}", away.stderr);
    let json = away.json();
    assert_eq!((&json["primary"]["hits"], &json["shadow"]["rays"]), (&0.into(), &0.into()));
    // In the middle of the hall: inside the boxes of many nodes.
    let json = render(&["--view", "1"]).json();
    assert!(json["primary"]["hits"].as_u64() > Some(0), "{json}");
}

#[test]
fn scenes_without_extent_are_compared() {
    let folder = tempdir().unwrap();
    let write = |name: &str, text: String| std::fs::write(folder.path().join(name), text).unwrap();
    write("point.obj", "v 3 3 3\nv 3 3 3\nv 3 3 3\n".to_owned() + &"f 1 2 3\n".repeat(20));
    write("line.obj", (0..30).map(|k| format!("v {k} 0 0\n")).collect::<String>() + &lines_of_faces(28));
    write("one.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".to_owned());
    let scenes = ["point.obj", "line.obj", "one.obj"];
    // Other libraries may fail on these, which is their row's matter.
    let methods = ["--methods", "lbvh,ploc,prbvh,sah-sweep,sah-binned", "--device", "cpu", "--json"];
    let json = prbvh(folder.path(), &[&["compare"], &scenes[..], &methods, &FEW_RAYS].concat()).ok().json();
    let rows = json["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 3 * 7);
    for row in rows {
        assert!(row["status"] == "ok" && row["cost"].as_f64().is_some_and(f64::is_finite), "{row}");
    }
}

fn lines_of_faces(count: usize) -> String {
    (1..=count).map(|k| format!("f {k} {} {}\n", k + 1, k + 2)).collect()
}
