//! Scenes that are wrong or odd: a right tree or a clear error, on every device.

use prbvh::bvh::{Bvh, SahModel, quality, tree_hash, validate};
use prbvh::optimize::StopReason;
use prbvh::pipeline::{Optimized, Settings, optimize};
use prbvh::scene::Scene;
use prbvh_kernel::setup::Triangle;
use prbvh_tests::command::{Ended, run};
use prbvh_tests::devices::{with_devices, without_vulkan};
use prbvh_tests::fixtures::soup;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const PRBVH: &str = env!("CARGO_BIN_EXE_prbvh-under-test");

const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

/// What `--device` can say here.
fn choices() -> Vec<&'static str> {
    if without_vulkan() { vec!["cpu"] } else { vec!["cpu", "vulkan"] }
}

/// Runs `prbvh optimize SCENE --out out --json` on the CPU and on Vulkan.
fn ran(folder: &Path, scene: &str) -> Vec<Ended> {
    let on = |device| run(PRBVH, folder, &["optimize", scene, "--device", device, "--out", "out", "--json"]);
    choices().into_iter().map(on).collect()
}

/// Asserts that the command refuses a file with an error that names it and has these parts, and that it writes nothing.
fn assert_refused(name: &str, bytes: impl AsRef<[u8]>, parts: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(name), bytes).unwrap();
    for ran in ran(folder.path(), name) {
        ran.refused(&[&[name], parts].concat());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "{name}: something was written");
    }
}

#[test]
fn nan_and_infinite_vertices() {
    assert_refused("a.obj", "v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n", &["line 2", "nan"]);
    assert_refused("a.obj", "v 0 0 0\nv 1 0 0\nv 0 -inf 0\nf 1 2 3\n", &["line 3", "-inf"]);
    assert_refused("a.obj", "v 0 0 1e39\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", &["line 1", "1e39"]);
    assert_refused("a.ply", ply("0 nan 0", "0 1 2"), &["line 10", "NaN"]);
    assert_refused("a.ply", ply("0 inf 0", "0 1 2"), &["line 10", "inf"]);
}

#[test]
fn indices_out_of_range() {
    for index in ["4", "0", "-4", "99999999999"] {
        assert_refused("a.obj", format!("{CORNERS}f 1 2 {index}\n"), &["line 4", index]);
    }
    for index in ["3", "-1"] {
        assert_refused("a.ply", ply("0 0 0", &format!("0 1 {index}")), &["line 13", &format!("index {index}")]);
    }
}

/// An ASCII PLY file of one triangle; its first vertex is line 10, its face line 13.
fn ply(vertex: &str, face: &str) -> String {
    let header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                  element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    format!("{header}{vertex}\n1 0 0\n0 1 0\n3 {face}\n")
}

#[test]
fn paths_that_are_no_scene() {
    for name in ["a.obj", "a.ply", "a.stl", "a.gltf", "a.glb", "a.obj.xz", "a.obj.gz", "a.obj.zst"] {
        assert_refused(name, "", &["empty file"]);
    }
    for name in ["a.fbx", "a.off", "scene"] {
        assert_refused(name, "OFF 3 1 0", &["unknown extension", ".obj", ".ply", ".stl", ".gltf", ".glb"]);
    }
    let folder = tempfile::tempdir().unwrap();
    for name in [".", "folder.obj"] {
        std::fs::create_dir_all(folder.path().join(name)).unwrap();
        ran(folder.path(), name).iter().for_each(|ran| ran.refused(&[name, "a directory"]));
    }
    ran(folder.path(), "gone.obj").iter().for_each(|ran| ran.refused(&["gone.obj", "no such file"]));
    assert!(!folder.path().join("out").exists());
}

#[test]
fn truncated_archives() {
    let vertices: String = (0..4000).map(|k| format!("v {} 0 {k}\n", k * 7919 % 4001)).collect();
    let text = vertices + "f 1 2 3\n";
    let mut xz = lzma_rust2::XzWriter::new(Vec::new(), lzma_rust2::XzOptions::with_preset(1)).unwrap();
    xz.write_all(text.as_bytes()).unwrap();
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    gzip.write_all(text.as_bytes()).unwrap();
    let zstd = ruzstd::encoding::compress_to_vec(text.as_bytes(), ruzstd::encoding::CompressionLevel::Fastest);
    let archives = [
        ("a.obj.xz", "xz", xz.finish().unwrap()),
        ("a.obj.gz", "gzip", gzip.finish().unwrap()),
        ("a.obj.zst", "zstd", zstd),
    ];
    for (name, format, bytes) in archives {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(name), &bytes).unwrap();
        assert_eq!(ran(folder.path(), name).remove(0).ok().json()["triangles"], 1, "{name} whole");
        for length in [5, bytes.len() / 2, bytes.len() - 1] {
            assert_refused(name, &bytes[..length], &[format, "truncated or damaged"]);
        }
    }
}

#[test]
fn files_of_no_triangle_to_three() {
    assert_refused("a.obj", CORNERS, &["no triangles"]);
    for n in 1..=3 {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.obj"), CORNERS.to_owned() + &"f 1 2 3\n".repeat(n)).unwrap();
        let mut hashes = Vec::new();
        for ran in ran(folder.path(), "a.obj") {
            let report = ran.ok().json();
            // All boxes are the root's: n leaves at 2, n - 1 internal nodes at 3.
            assert_eq!(report["final_cost"], (5 * n - 3) as f64);
            let stats = run(PRBVH, folder.path(), &["stats", "out/tree.bvh", "--scene", "a.obj", "--json"]).ok().json();
            assert_eq!((&stats["leaves"], &stats["nodes"]), (&n.into(), &(2 * n - 1).into()));
            hashes.push(stats["tree_hash"].clone());
        }
        assert!(hashes.iter().all(|hash| *hash == hashes[0]), "{hashes:?}");
    }
}

#[test]
fn a_hundred_thousand_copies_of_one_triangle_make_a_shallow_tree_quickly() {
    const N: usize = 100_000;
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.obj"), CORNERS.to_owned() + &"f 1 2 3\n".repeat(N)).unwrap();
    let mut hashes = Vec::new();
    for ran in ran(folder.path(), "a.obj") {
        let report = ran.ok().json();
        assert_eq!(report["scene_details"]["census"]["duplicates"], N - 1);
        assert_eq!((&report["initial_cost"], &report["final_cost"]), (&499_997.0.into(), &499_997.0.into()));
        assert!(report["iterations"].as_u64().unwrap() < 20, "there is nothing to gain");
        // Equal codes are told apart by position, which halves: 17 for 100,000.
        let stats = run(PRBVH, folder.path(), &["stats", "out/tree.bvh", "--scene", "a.obj", "--json"]).ok().json();
        assert!(stats["max_depth"].as_u64().unwrap() <= 20, "{stats}");
        hashes.push(stats["tree_hash"].clone());
    }
    assert!(hashes.iter().all(|hash| *hash == hashes[0]), "{hashes:?}");
}

/// Optimises on every device: the trees are the same, valid, of finite cost, and no worse than the initial one.
fn optimised(name: &str, triangles: Vec<Triangle>) -> Optimized {
    let scene = Scene::from_triangles(name, triangles).unwrap();
    with_devices(|devices| {
        let mut first: Option<(String, Optimized)> = None;
        for (on, device) in devices {
            let on = format!("{name} on {on}");
            let result = optimize(&scene, &mut **device, &Settings::default(), &mut |_| ControlFlow::Continue(()))
                .unwrap_or_else(|error| panic!("{on}: {error}"));
            validate(&result.tree, Some(&scene.triangles)).unwrap_or_else(|faults| panic!("{on}: {faults:?}"));
            assert_eq!(result.outcome.stop, StopReason::Converged, "{on}");
            let measured = quality(&result.tree, &SahModel::default());
            assert_eq!(measured, result.quality, "{on}");
            let (initial, last) = (result.initial.sah_cost, measured.sah_cost);
            assert!(initial.is_finite() && last.is_finite() && last > 0.0, "{on}: {initial}, then {last}");
            assert!(last <= initial * (1.0 + 1e-6), "{on}: {initial}, then {last}");
            assert!(result.outcome.rows.iter().all(|row| row.cost.is_finite()), "{on}");
            assert_eq!(device.memory().bytes, 0, "{on}: buffers are left");
            match &first {
                None => first = Some((on, result)),
                Some((before, expected)) => {
                    assert_eq!(tree_hash(&expected.tree), tree_hash(&result.tree), "{before}, and {on}");
                }
            }
        }
        first.expect("there is always the CPU").1
    })
}

/// A soup of which every corner is changed.
fn changed(count: usize, change: impl Fn([f32; 3]) -> [f32; 3]) -> Vec<Triangle> {
    let soup = soup(count, 0.1, 5);
    soup.iter().map(|t| Triangle { a: change(t.a), b: change(t.b), c: change(t.c) }).collect()
}

#[test]
fn all_points_on_a_line() {
    // On an axis no box has an area: each node costs its visit, whatever the tree.
    let on_axis = optimised("axis", changed(300, |[x, ..]| [x, 2.0, -3.0]));
    assert_eq!(on_axis.quality.sah_cost, (5 * 300 - 3) as f64);
    let diagonal = optimised("diagonal", changed(300, |[x, ..]| [x; 3]));
    assert!(diagonal.quality.sah_cost < diagonal.initial.sah_cost);
}

#[test]
fn all_points_in_a_plane() {
    for k in 0..3 {
        let flat = |mut p: [f32; 3]| {
            p[k] = 0.25;
            p
        };
        let flat = optimised("plane", changed(300, flat));
        assert!(flat.quality.sah_cost < flat.initial.sah_cost);
    }
    optimised("tilted plane", changed(300, |[x, y, _]| [x, y, x + y]));
}

#[test]
fn all_triangles_are_one_point() {
    for at in [0.0, -7.5, 1e30, 1e-30, -1e-45, f32::MAX] {
        let point = optimised("point", changed(200, |_| [at; 3]));
        assert_eq!(point.quality.sah_cost, (5 * 200 - 3) as f64, "{at:e}");
    }
}

/// Parents and contents, without the boxes.
fn topology(tree: &Bvh) -> Vec<(u32, prbvh::bvh::Content)> {
    tree.nodes.iter().map(|node| (node.parent, node.content)).collect()
}

#[test]
fn powers_of_two_near_1e30_and_1e_minus_30_change_no_topology() {
    // Multiples of 2^-20, so that nothing is rounded at any of the scales.
    let scaled = |exponent: i32| {
        let factor = 2_f64.powi(exponent);
        changed(400, |p| p.map(|x| (f64::from((x * 1048576.0).round() / 1048576.0) * factor) as f32))
    };
    let plain = optimised("plain", scaled(0));
    for exponent in [100, 126, -100, -126] {
        let result = optimised("scaled", scaled(exponent));
        assert!(topology(&result.tree) == topology(&plain.tree), "2^{exponent}");
        assert!((result.quality.sah_cost / plain.quality.sah_cost - 1.0).abs() < 1e-9, "2^{exponent}");
    }
}

#[test]
fn coordinates_of_1e30_and_1e_minus_30() {
    for factor in [1e30, 1e-30, f32::MAX / 2.0, f32::MIN_POSITIVE, 1e-44] {
        let result = optimised("scaled", changed(300, |p| p.map(|x| x * factor)));
        assert!(result.quality.sah_cost <= result.initial.sah_cost, "{factor:e}");
    }
}

#[test]
fn coordinates_of_1e30_beside_1e_minus_30() {
    let mut mixed = changed(200, |p| p.map(|x| x * 1e-30));
    mixed.extend(changed(200, |p| p.map(|x| x * 1e30)));
    optimised("two scales", mixed);
    optimised("two scales in a triangle", changed(200, |[x, y, z]| [x * 1e30, y * 1e-30, -z]));
    optimised("to the ends", changed(200, |[x, y, z]| [(x - 0.5) * f32::MAX, (y - 0.5) * f32::MAX, z]));
}

#[test]
fn far_from_the_origin() {
    for offset in [1e6, -1e6] {
        optimised("far", changed(400, |p| p.map(|x| x + offset)));
    }
    optimised("far along x", changed(400, |[x, y, z]| [x + 1e6, y, z]));
}

/// Scenes of a unit square in `tests/corpus`, as other tools leave them.
const SQUARES: [&str; 20] = [
    "obj/valid/bom-then-vertex.obj",
    "obj/valid/comment-ends-in-backslash.obj",
    "obj/valid/usemtl-ends-in-backslash.obj",
    "obj/valid/fo-statement.obj",
    "obj/valid/comment-after-face.obj",
    "ply/valid/face-and-tristrips.ply",
    "ply/valid/tristrips-only.ply",
    "ply/valid/blank-line.ply",
    "ply/valid/latin-1-comment.ply",
    "stl/valid/latin-1-endsolid.stl",
    "stl/valid/uppercase.stl",
    "stl/valid/end-solid-in-two-words.stl",
    "stl/valid/nan-normals.stl",
    "stl/valid/binary-solid-header-one-byte-more.stl",
    "gltf/valid/requires-ext-texture-webp.glb",
    "gltf/valid/requires-texture-transform.glb",
    "gltf/valid/quantized-positions.glb",
    "gltf/valid/second-scene-without-nodes.glb",
    "gltf/valid/primitive-without-position.glb",
    "gltf/valid/bom.gltf",
];

fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus")
}

/// Runs `prbvh optimize --json` for the initial tree alone.
fn initial(folder: &Path, arguments: &[&str]) -> Ended {
    run(PRBVH, folder, &[&["optimize", "--optimizer", "none", "--device", "cpu", "--json"], arguments].concat())
}

#[test]
fn a_square_costs_7_however_it_is_written() {
    for name in SQUARES {
        let report = initial(&corpus(), &[name]).ok().json();
        assert_eq!((&report["triangles"], &report["final_cost"]), (&2.into(), &7.0.into()), "{name}");
    }
}

#[test]
fn what_is_not_read_is_a_warning_or_an_error() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.obj"), CORNERS.to_owned() + "f 1 2 3\nl 1 2\nl 2 3\n").unwrap();
    std::fs::write(folder.path().join("whole.obj"), CORNERS.to_owned() + "f 1 2 3\n").unwrap();
    let note = "statement \"l\" (lines) is not read (2 times, first at line 5)";
    let ended = initial(folder.path(), &["a.obj", "--out", "out"]).ok();
    assert!(ended.stderr.contains(&format!("a.obj: {note}")), "{}", ended.stderr);
    let notes = serde_json::json!([{ "what": "statement \"l\" (lines) is not read", "first": "line 5", "count": 2 }]);
    assert_eq!(ended.json()["scene_details"]["notes"], notes);

    let json = |arguments: &[&str]| run(PRBVH, folder.path(), arguments).ok().json();
    assert_eq!(json(&["plan", "a.obj", "--device", "cpu", "--json"])["notes"], notes);
    assert_eq!(json(&["stats", "out/tree.bvh", "--scene", "a.obj", "--json"])["notes"], notes);
    let whole = initial(folder.path(), &["whole.obj", "--strict"]).ok();
    assert_eq!(whole.json()["scene_details"]["notes"], serde_json::json!([]));
    assert!(!whole.stderr.contains("WARN"), "{}", whole.stderr);

    for arguments in [
        &["optimize", "a.obj", "--device", "cpu", "--json"][..],
        &["plan", "a.obj", "--device", "cpu"],
        &["plan", "whole.obj", "a.obj", "--device", "cpu"],
        &["render", "a.obj", "--device", "cpu"],
        &["compare", "whole.obj", "a.obj", "--device", "cpu"],
        &["stats", "out/tree.bvh", "--scene", "a.obj"],
    ] {
        let strict = run(PRBVH, folder.path(), &[arguments, &["--strict"]].concat());
        strict.refused(&["a.obj: not read whole: ", note]);
    }
}

#[test]
fn a_scene_may_come_from_standard_input() {
    let folder = tempfile::tempdir().unwrap();
    let piped = |scene: &str, arguments: &[&str], input: &Path| {
        let mut command = Command::new(PRBVH);
        command.args(["optimize", scene, "--optimizer", "none", "--device", "cpu", "--json"]).args(arguments);
        command.current_dir(folder.path()).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let bytes = std::fs::read(input).unwrap();
        let mut stdin = child.stdin.take().unwrap();
        // In pieces, as pipes bring them; a reader that went away is what some of the cases are about.
        for piece in bytes.chunks(3) {
            let _ = stdin.write_all(piece);
        }
        drop(stdin);
        let output = child.wait_with_output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        Ended {
            arguments: scene.into(),
            code: output.status.code(),
            stdout: text(output.stdout),
            stderr: text(output.stderr),
        }
    };
    for name in SQUARES {
        let report = piped("-", &[], &corpus().join(name)).ok().json();
        assert_eq!((&report["scene"], &report["final_cost"]), (&"stdin".into(), &7.0.into()), "{name}");
    }
    let square = corpus().join(SQUARES[1]);
    if cfg!(unix) {
        assert_eq!(piped("/dev/stdin", &[], &square).ok().json()["final_cost"], 7.0);
    }
    assert_eq!(piped("-", &["--format", "obj"], &square).ok().json()["final_cost"], 7.0);
    piped("-", &["--format", "stl"], &square).refused(&["stdin: read as STL, but it begins as OBJ does"]);
    piped("-", &["--format", "fbx"], &square).refused(&["fbx", "obj, ply, stl, gltf and glb"]);
    let empty = folder.path().join("empty");
    std::fs::write(&empty, "").unwrap();
    piped("-", &[], &empty).refused(&["stdin: empty file"]);
}
