//! Splits through the command: report, tree file, stats, pictures and rows of a comparison.

use prbvh::pipeline::Initial;
use prbvh::scene::built_in;
use prbvh_kernel::setup::Triangle;
use prbvh_tests::command::{Ended, run};
use serde_json::Value;
use std::path::Path;
use tempfile::tempdir;

const PRBVH: &str = env!("CARGO_BIN_EXE_prbvh-under-test");

fn prbvh(folder: &Path, arguments: &str) -> Ended {
    run(PRBVH, folder, &arguments.split(' ').collect::<Vec<_>>())
}

/// Triangles of the scene.
const COUNT: u64 = 1000;

/// The built-in hall turned by 45° around two axes, as OBJ.
fn scene() -> String {
    let half = 0.5f32.sqrt();
    let turn = |p: [f32; 3]| {
        let [x, y, z] = [half * (p[0] - p[2]), p[1], half * (p[0] + p[2])];
        [x, half * (y - z), half * (y + z)]
    };
    let triangle = |t: &Triangle| {
        let corners = [t.a, t.b, t.c].map(turn).map(|[x, y, z]| format!("v {x} {y} {z}\n"));
        corners.concat() + "f -3 -2 -1\n"
    };
    built_in(COUNT as usize).triangles.iter().map(triangle).collect()
}

#[test]
fn a_tree_with_splits_goes_all_the_way() {
    let folder = tempdir().unwrap();
    std::fs::write(folder.path().join("walls.obj"), scene()).unwrap();
    for (asked, out) in [("--presplit=0.5", "presplit"), ("--initial sbvh", "sbvh")] {
        let optimize = format!("optimize walls.obj {asked} --device cpu --json --out {out}");
        let report = prbvh(folder.path(), &optimize).ok().json();
        let (references, built) = (report["references"].as_u64().unwrap(), report["splits"]["built"].as_u64().unwrap());
        assert_eq!(report["triangles"], COUNT);
        assert!(
            references > COUNT && references <= built && built <= 3 * COUNT / 2,
            "{asked}: {references} of {built}"
        );
        assert_eq!(report["reference"], Value::Null, "{asked}");

        let stats = |more: &str| prbvh(folder.path(), &format!("stats {out}/tree.bvh{more}"));
        let measured = stats(" --scene walls.obj --json").ok().json();
        assert_eq!((&measured["references"], &measured["triangles"]), (&report["references"], &COUNT.into()));
        assert_eq!(measured["tree_hash"], report["tree_hash"]);
        assert!(measured["epo"].as_f64().unwrap() > 0.0);
        assert!(stats(" --scene walls.obj").ok().stdout.contains("per triangle)"));
        stats("").refused(&["--scene", "pieces of triangles"]);

        let picture = |tree: &str| {
            let render = format!("render walls.obj{tree} --device cpu --size 24x16 --samples 1 -o {out}.png");
            let _ = prbvh(folder.path(), &render).ok();
            std::fs::read(folder.path().join(format!("{out}.png"))).unwrap()
        };
        assert!(picture("") == picture(&format!(" --tree {out}/tree.bvh")), "{asked}: another picture");
        for layout in ["soa", "cwbvh"] {
            let wide = format!("{asked} --width 8 --layout {layout} --device cpu --out {out}-{layout}");
            let _ = prbvh(folder.path(), &format!("optimize walls.obj {wide}")).ok();
            let tree = format!("{out}-{layout}/wide.bvh");
            let _ = prbvh(folder.path(), &format!("stats {tree} --scene walls.obj")).ok();
            assert!(picture("") == picture(&format!(" --tree {tree}")), "{wide}: another picture");
        }
        prbvh(folder.path(), &format!("optimize walls.obj --initial {out}/tree.bvh --device cpu"))
            .refused(&["tree with splits"]);
    }
    assert!(prbvh(folder.path(), "optimize walls.obj --presplit --device cpu").ok().stdout.contains("per triangle, "));
    assert_eq!(Initial::Sbvh.to_string(), "sbvh");
}

#[test]
fn a_comparison_has_rows_of_splits_and_takes_no_error_from_them() {
    let folder = tempdir().unwrap();
    std::fs::write(folder.path().join("walls.obj"), scene()).unwrap();
    let rays = "--size 24x16 --samples 1 --bounces 1 --views 2";
    let compare = format!("compare walls.obj --device cpu --methods lbvh,worst-first,presplit,sbvh {rays} --json");
    let json = prbvh(folder.path(), &compare).ok().json();
    let rows = json["rows"].as_array().unwrap();
    let methods: Vec<&str> = rows.iter().map(|row| row["method"].as_str().unwrap()).collect();
    let split = ["presplit + lbvh + prbvh", "presplit + sah-sweep + prbvh", "sbvh", "sbvh + prbvh"];
    assert_eq!(methods, [&["lbvh", "prbvh worst first"], &split[..]].concat());
    for row in rows {
        let is_split = split.contains(&row["method"].as_str().unwrap());
        assert_eq!(row["status"], "ok", "{row}");
        assert_eq!(row["references"].as_u64().unwrap() > COUNT, is_split, "{row}");
        assert_eq!(row["relative_error"].is_null(), is_split, "{row}");
        assert!(row["epo"].as_f64().unwrap() >= 0.0 && row["box_tests"].as_f64().unwrap() > 0.0, "{row}");
    }
    let whole = rows.iter().find(|row| row["method"] == "prbvh worst first").unwrap();
    let error = whole["relative_error"].as_f64().unwrap();
    assert!(error < 1e-6, "{error}: the lowest cost is of a tree without splits");
}
