//! Each bad file gives an error that names the file, the line or element, and the value.

use super::*;
use crate::scene::MAX_TRIANGLES;

#[track_caller]
fn assert_says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "\"{part}\" is missing in: {message}");
    }
}

#[test]
fn paths_that_are_no_scene() {
    let folder = tempfile::tempdir().unwrap();
    let gone = folder.path().join("gone.obj");
    assert!(matches!(load(&gone), Err(SceneError::NotFound { file }) if file.ends_with("gone.obj")));
    assert!(matches!(load(folder.path()), Err(SceneError::Directory { .. })));
    let named = folder.path().join("folder.obj");
    std::fs::create_dir(&named).unwrap();
    assert!(matches!(load(&named), Err(SceneError::Directory { .. })));
}

#[test]
fn unknown_extensions_list_the_known_ones() {
    for (name, extension) in [("a.fbx", "\"fbx\""), ("a.fbx.xz", "\"fbx.xz\""), ("a.xz", "\"xz\""), ("scene", "\"\"")] {
        let bytes = if name.ends_with(".xz") { xz(b"x") } else { b"x".to_vec() };
        assert_says(&refusal(name, bytes), &[extension, ".obj", ".ply", ".stl", ".gltf", ".glb", ".xz", ".gz", ".zst"]);
    }
}

#[test]
fn empty_files() {
    for name in ["a.obj", "a.ply", "a.stl", "a.gltf", "a.glb", "a.obj.xz", "a.obj.gz", "a.obj.zst"] {
        assert_eq!(refusal(name, ""), ": empty file", "{name}");
    }
    assert_eq!(refusal("a.obj.xz", xz(b"")), ": empty file");
    assert_eq!(refusal("a.obj.gz", gzip(b"")), ": empty file");
    assert_eq!(refusal("a.obj.zst", zstd(b"")), ": empty file");
}

#[test]
fn archives_cut_anywhere() {
    let text: String = (0..4000).map(|i| format!("v {} 0 {}\n", i * 7919 % 4001, i)).collect::<String>() + "f 1 2 3\n";
    for (name, format, packed) in [
        ("a.obj.xz", "xz", xz(text.as_bytes())),
        ("a.obj.gz", "gzip", gzip(text.as_bytes())),
        ("a.obj.zst", "zstd", zstd(text.as_bytes())),
    ] {
        assert_eq!(load_bytes(name, &packed).unwrap().triangles.len(), 1);
        for cut in [1, 5, 11, 20, packed.len() / 2, packed.len() - 9, packed.len() - 1] {
            assert_says(&refusal(name, &packed[..cut]), &[format, "truncated or damaged"]);
        }
        let mut damaged = packed.clone();
        damaged[packed.len() / 2] ^= 0x10;
        assert!(load_bytes(name, damaged).is_err(), "{name}");
    }
    assert_says(&refusal("a.stl.gz", &gzip(&stl_binary(b"", &fan()))[..60]), &["gzip", "truncated"]);
    assert_says(&refusal("a.obj.xz", "not packed at all"), &["xz"]);
}

#[test]
fn obj_faults_name_line_and_value() {
    let vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    for (text, parts) in [
        ("v 0 0 0\n\nv 1 nan 0\n", ["line 3", "coordinate nan"]),
        ("v 0 0 -inf\n", ["line 1", "coordinate -inf"]),
        ("v 0 1e39 0\n", ["line 1", "coordinate 1e39"]),
        ("v 0 0 0\nv 1 zwei 0\n", ["line 2", "\"zwei\" is not a number"]),
        ("v 0 0\n", ["line 1", "no z"]),
        ("v 0 \\\n0 \\\nq\n", ["line 1", "\"q\""]),
    ] {
        assert_says(&refusal("a.obj", text), &parts);
    }
    for (face, parts) in [
        ("f 1 2 4", ["line 4", "index 4", "there are 3 vertices"]),
        ("f 1 2 0", ["line 4", "index 0", "there are 3 vertices"]),
        ("f 1 2 -4", ["line 4", "index -4", "there are 3 vertices"]),
        ("f 1 2 x/1", ["line 4", "\"x/1\"", "not a vertex index"]),
        ("f 1 2 /1", ["line 4", "\"/1\"", "not a vertex index"]),
        ("f 1 2 1.5", ["line 4", "\"1.5\"", "not a vertex index"]),
        ("f 1 2 99999999999999999999", ["line 4", "99999999999999999999", "not a vertex index"]),
        ("f 1 2 9223372036854775807", ["line 4", "index 9223372036854775807", "there are 3 vertices"]),
        ("f 1 2 -9223372036854775808", ["line 4", "index -9223372036854775808", "there are 3 vertices"]),
    ] {
        assert_says(&refusal("a.obj", format!("{vertices}{face}\nf 1 2 3\n")), &parts);
    }
    let long = format!("v 0 0 {}\n", "z".repeat(100_000));
    assert!(refusal("a.obj", long).len() < 200);
}

#[test]
fn ply_faults_name_place_and_value() {
    for (from, to, parts) in [
        ("1.5 2.25 0 7", "1.5 1e39 0 7", ["line 14", "coordinate inf"]),
        ("1.5 2.25 0 7", "1.5 nan 0 7", ["line 14", "NaN"]),
        ("1.5 2.25 0 7", "1.5 2.25", ["line 14", "does not end with line 15"]),
        ("1.5 2.25 0 7", "1.5 2,25 0 7", ["line 14", "\"2,25\" is not a number"]),
        ("4 0 1 2 3", "4 0 1 2 4", ["line 16", "index 4 is out of range"]),
        ("4 0 1 2 3", "4 0 1 2 -1", ["line 16", "index -1"]),
        ("4 0 1 2 3", "5 0 1 2 3", ["line 16", "0 of 1"]),
        ("4 0 1 2 3", "-1 0 1 2 3", ["line 16", "-1 is no length"]),
        ("4 0 1 2 3", "4 0 1 2 2.5", ["line 16", "2.5"]),
        ("4 0 1 2 3\n", "", ["truncated", "0 of 1"]),
        ("property float y\n", "", ["no property y", ""]),
        ("property float y\n", "property list uchar float y\n", ["no property y", ""]),
        ("element vertex 4", "element vertex x", ["line 4", "element vertex x"]),
        ("ply\n", "", ["line 1", "ply"]),
        ("format ascii 1.0\n", "", ["format", ""]),
        ("list uchar int vertex_indices", "list float int vertex_indices", ["line 10", "list float int"]),
        ("list uchar int vertex_indices", "list uchar float corners", ["line 9", "no list vertex_indices"]),
        ("end_header", "end_of_header", ["line 17", "no end_header"]),
    ] {
        assert_ne!(PLY.replace(from, to), PLY);
        assert_says(&refusal("a.ply", PLY.replace(from, to)), &parts);
    }
    for big_endian in [false, true] {
        let good = ply_binary(big_endian);
        assert_says(&refusal("a.ply", &good[..good.len() - 1]), &["face 0", "truncated"]);
        let start = good.len() - 17 - 48;
        let nan = if big_endian { f32::NAN.to_be_bytes() } else { f32::NAN.to_le_bytes() };
        let bad = [&good[..start + 16], &nan, &good[start + 20..]].concat();
        assert_says(&refusal("a.ply", bad), &["vertex 1", "coordinate NaN"]);
    }
}

#[test]
fn huge_announcements_take_no_memory() {
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let vertex = "property float x\nproperty float y\nproperty float z\n";
        let header = format!("ply\nformat {format} 1.0\nelement vertex 4000000000\n{vertex}end_header\n0 0 0\n");
        assert_says(&refusal("a.ply", header), &["truncated", "of 4000000000"]);
        let bare = format!(
            "ply\nformat {format} 1.0\nelement nothing 18446744073709551615\nelement vertex 0\n{vertex}end_header\n"
        );
        assert_eq!(refusal("a.ply", bare), ": no triangles");
        let list = "element face 1\nproperty list uint uchar vertex_indices\nend_header\n";
        let lists = [format!("ply\nformat {format} 1.0\n{list}").as_bytes(), b"4294967295 1"].concat();
        assert!(refusal("a.ply", lists).contains("1"));
    }
    let mut stl = stl_binary(b"", &fan());
    stl[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    assert_says(&refusal("a.stl", stl), &["facet 2"]);
}

#[test]
fn stl_faults_name_facet_and_value() {
    let text = stl_text(&fan());
    assert_says(&refusal("a.stl", text.replace("-0.5", "nan")), &["line 13", "nan"]);
    assert_says(&refusal("a.stl", text.replace("-0.5", "1e39")), &["line 13", "1e39"]);
    assert_says(&refusal("a.stl", text.replace("-0.5", "zwei")), &["line 13", "\"zwei\" is not a number"]);
    assert_says(&refusal("a.stl", text.replace("-0.5", "")), &["line 13", "no z"]);
    assert_says(&refusal("a.stl", &text[..text.len() - 12]), &["line 9", "truncated"]);
    assert_says(&refusal("a.stl", text.replacen("endfacet\n", "", 1)), &["line 8", "facet of line 2"]);
    assert_says(&refusal("a.stl", text.replacen("facet normal 0 0 0\n", "", 1)), &["line 3", "outside a facet"]);
    let mut infinite = fan();
    infinite[1].b[2] = f32::NEG_INFINITY;
    assert_says(&refusal("a.stl", stl_binary(b"", &infinite)), &["facet 1", "coordinate -inf"]);
    let binary = stl_binary(b"", &fan());
    assert_says(&refusal("a.stl", &binary[..binary.len() - 1]), &["facet 1", "2 facets are announced, 1 are there"]);
    assert!(!refusal("a.stl", b"short").is_empty());
}

#[test]
fn files_without_triangles() {
    for (name, bytes) in [
        ("a.obj", b"# nothing\n".to_vec()),
        ("a.obj", vec![0; 100]),
        ("a.stl", b"solid\nendsolid\n".to_vec()),
        ("a.stl", stl_binary(b"", &[])),
    ] {
        assert_eq!(refusal(name, bytes), ": no triangles", "{name}");
    }
    // What there was in their place is named.
    let lines = refusal("a.obj", "v 0 0 0\nv 1 0 0\nl 1 2\nl 2 1\nf 1 2\n");
    assert_says(
        &lines,
        &["no triangles; ", "\"l\" (lines) is not read (2 times, first at line 3)", "three corners", "line 5"],
    );
    assert_says(&refusal("a.ply", PLY.replace("4 0 1 2 3", "2 0 1")), &["no triangles; ", "three corners", "line 16"]);
}

#[test]
fn one_two_and_three_triangles_load() {
    for count in 1..=3 {
        let triangles = vec![fan()[0]; count];
        assert_eq!(load_bytes("a.stl", stl_binary(b"", &triangles)).unwrap().triangles, triangles);
    }
}

#[test]
fn triangles_of_a_library_user_are_screened() {
    assert!(
        matches!(Scene::from_triangles("mine", Vec::new()), Err(SceneError::NoTriangles { file, .. }) if file == "mine")
    );
    let mut triangles = vec![fan()[0]; 1000];
    triangles[777].c[1] = f32::INFINITY;
    triangles[900].a[0] = f32::NAN;
    let message = Scene::from_triangles("mine", triangles).unwrap_err().to_string();
    assert_eq!(message, "mine, triangle 777: coordinate inf is not a finite float32");
}

#[test]
fn the_limit_of_triangles_is_named() {
    assert!(Blame("a").limit(MAX_TRIANGLES).is_ok());
    let message = Blame("a").limit(MAX_TRIANGLES + 1).unwrap_err().to_string();
    assert_says(&message, &["1073741825", "1073741824"]);
}
