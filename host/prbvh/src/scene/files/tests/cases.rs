//! Files in `tests/corpus` that other readers get wrong or refuse: the right triangles, and what is said of the rest.

use super::*;

/// A file that the fuzzer starts from too.
fn case(name: &str) -> PathBuf {
    let (_, extension) = name.rsplit_once('.').unwrap();
    let folder = if extension == "glb" { "gltf" } else { extension };
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/corpus").join(folder).join("valid").join(name)
}

#[track_caller]
fn load_case(name: &str) -> Scene {
    load(&case(name)).unwrap_or_else(|error| panic!("{error}"))
}

/// Files of a unit square that are read whole.
const WHOLE: [&str; 19] = [
    "bom-then-vertex.obj",
    "comment-ends-in-backslash.obj",
    "usemtl-ends-in-backslash.obj",
    "fo-statement.obj",
    "comment-after-face.obj",
    "face-and-tristrips.ply",
    "tristrips-only.ply",
    "blank-line.ply",
    "latin-1-comment.ply",
    "latin-1-endsolid.stl",
    "uppercase.stl",
    "end-solid-in-two-words.stl",
    "nan-normals.stl",
    "requires-ext-texture-webp.glb",
    "requires-texture-transform.glb",
    "quantized-positions.glb",
    "second-scene-without-nodes.glb",
    "bom.gltf",
    "accessor-without-buffer-view.glb",
];

#[test]
fn files_of_a_square_are_read_whole() {
    for name in WHOLE {
        let mut scene = load_case(name);
        if name == "accessor-without-buffer-view.glb" {
            // By the standard its elements are zeros.
            assert_eq!(scene.triangles.pop(), Some(triangle([0.0; 3], [0.0; 3], [0.0; 3])));
        }
        assert_eq!(scene.notes, [], "{name}");
        assert_square(name, &scene.triangles);
        let strict = LoadOptions { strict: true, ..LoadOptions::default() };
        assert!(load_with(&case(name), &strict).is_ok(), "{name}");
    }
}

#[test]
fn what_is_left_out_is_said() {
    for (name, what) in [
        ("binary-solid-header-one-byte-more.stl", "a byte after the last facet of a binary file is left out (facet 2)"),
        ("primitive-without-position.glb", "a primitive without positions is passed over (node 0)"),
    ] {
        let scene = load_case(name);
        assert_square(name, &scene.triangles);
        assert_eq!(said(&scene), [what], "{name}");
        let strict = LoadOptions { strict: true, ..LoadOptions::default() };
        let refused = load_with(&case(name), &strict).unwrap_err();
        assert_eq!(refused.to_string(), format!("{}: not read whole: {what}", case(name).display()));
    }
}

#[test]
fn instances_are_read() {
    let scene = load_case("gpu-instancing-used.glb");
    assert_eq!((scene.triangles.len(), scene.census.duplicates, scene.notes.len()), (6, 0, 0));
    for square in scene.triangles.chunks(2) {
        assert_eq!(square[0].area() + square[1].area(), 1.0);
    }
}

#[test]
fn a_concave_polygon_has_its_own_area() {
    let scene = load_case("concave-polygon.obj");
    assert_eq!(scene.triangles.iter().map(Area::area).sum::<f64>(), 10.0);
    assert_eq!((scene.triangles.len(), scene.notes), (3, Vec::new()));
}
