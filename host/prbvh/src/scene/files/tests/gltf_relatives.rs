//! glTF files as exporters and optimisers leave them: extensions, packed numbers, instances, parts that are missing.

use super::gltf_files::base64;
use super::*;
use serde_json::{Value, json};

const STRICT: LoadOptions = LoadOptions { strict: true, format: None };

/// The unit square: corners as float32, then indices of 16 bits, then what is added.
fn document(more: &[u8]) -> Value {
    let mut bytes: Vec<u8> =
        [0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.].iter().flat_map(|x: &f32| x.to_le_bytes()).collect();
    bytes.extend([0_u16, 1, 2, 1, 3, 2].iter().flat_map(|index| index.to_le_bytes()));
    bytes.extend(more);
    json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3" },
            { "bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR" },
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": 48 },
            { "buffer": 0, "byteOffset": 48, "byteLength": 12 },
            { "buffer": 0, "byteOffset": 60, "byteLength": more.len() },
        ],
        "buffers": [{ "byteLength": bytes.len(), "uri": format!("data:;base64,{}", base64(&bytes)) }],
    })
}

/// The document with values at JSON pointers less their first slash, which are made where they are missing.
fn with<const N: usize>(mut document: Value, changes: [(&str, Value); N]) -> Value {
    for (pointer, value) in changes {
        let pointer = format!("/{pointer}");
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        let parent = document.pointer_mut(parent).unwrap_or_else(|| panic!("no {parent}"));
        match parent {
            Value::Array(list) if key == "-" => list.push(value),
            Value::Array(list) => list[key.parse::<usize>().unwrap()] = value,
            parent => parent[key] = value,
        }
    }
    document
}

fn square<const N: usize>(changes: [(&str, Value); N]) -> Value {
    with(document(&[]), changes)
}

#[track_caller]
fn assert_whole(what: &str, document: &Value) {
    let file = file("a.gltf", document.to_string());
    let scene = load_with(&file.path, &STRICT).unwrap_or_else(|error| panic!("{what}: {error}"));
    assert_square(what, &scene.triangles);
}

#[track_caller]
fn assert_noted(document: &Value, notes: &[&str]) {
    let file = file("a.gltf", document.to_string());
    let scene = load(&file.path).unwrap_or_else(|error| panic!("{notes:?}: {error}"));
    assert_square(notes[0], &scene.triangles);
    assert_eq!(said(&scene), notes);
    assert!(matches!(load_with(&file.path, &STRICT), Err(SceneError::NotWhole { .. })), "{notes:?}");
}

#[track_caller]
fn assert_refused(document: &Value, parts: &[&str]) {
    let message = refusal("a.gltf", document.to_string());
    for part in parts {
        assert!(message.contains(part), "\"{part}\" is missing in: {message}");
    }
}

#[test]
fn extensions_that_leave_positions_alone_are_of_no_matter() {
    for name in [
        "KHR_materials_unlit",
        "KHR_materials_pbrSpecularGlossiness",
        "KHR_materials_variants",
        "KHR_texture_basisu",
        "KHR_texture_transform",
        "KHR_lights_punctual",
        "KHR_animation_pointer",
        "KHR_xmp_json_ld",
        "EXT_texture_avif",
        "EXT_lights_image_based",
        "EXT_mesh_features",
        "EXT_structural_metadata",
        "MSFT_texture_dds",
        "VRMC_vrm",
    ] {
        assert_whole(name, &square([("extensionsUsed", json!([name])), ("extensionsRequired", json!([name]))]));
    }
}

#[test]
fn what_positions_do_not_need_may_be_of_any_shape() {
    assert_whole(
        "looks and animations",
        &square([
            ("extensionsRequired", json!(["EXT_texture_webp"])),
            // No source but in the extension; a material that is not there.
            ("textures", json!([{ "extensions": { "EXT_texture_webp": { "source": 0 } } }])),
            (
                "materials",
                json!([{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 9 } }, "alphaMode": "NEW" }]),
            ),
            ("meshes/0/primitives/0/material", json!(7)),
            ("meshes/0/primitives/0/attributes/TEXCOORD_0", json!(99)),
            ("cameras", json!([{ "type": "fisheye" }])),
            ("nodes/0/camera", json!(3)),
            ("nodes/0/extensions", json!({ "KHR_lights_punctual": { "light": 0 } })),
            ("animations", json!([{ "channels": [], "samplers": [{}] }])),
            ("extras", json!({ "a": [1, null] })),
            ("images", json!([{ "uri": "gone.webp" }])),
            ("buffers/-", json!({ "byteLength": 99, "uri": "gone.bin" })),
        ]),
    );
    assert_whole("numbers with fractions", &square([("accessors/0/count", json!(4.0)), ("nodes/0/mesh", json!(0.0))]));
    assert_whole("a version without zero", &square([("asset", json!({ "version": "2" }))]));
    assert_whole("no asset", &square([("asset", json!({}))]));
}

#[test]
fn scenes_may_be_empty_or_missing() {
    let mut document = square([]);
    document.as_object_mut().unwrap().remove("scene");
    assert_whole("no default", &document);
    document["scenes"] = json!([]);
    assert_whole("no scenes", &document);
    assert_whole("a second without nodes", &square([("scenes/-", json!({ "name": "b" }))]));
    let (default, second) = (("scene", json!(1)), ("scenes/-", json!({})));
    let message = refusal("a.gltf", square([second.clone(), default]).to_string());
    assert!(message.contains("no triangles; a node with a mesh that is in another scene, or in none"), "{message}");
    let other = square([("nodes/-", json!({ "mesh": 0 })), ("scenes/-", json!({ "nodes": [1] }))]);
    assert_noted(&other, &["a node with a mesh that is in another scene, or in none, is not read (node 1)"]);
    assert_refused(&square([("scene", json!(3))]), &["scene 3", "there are 1"]);
}

#[test]
fn extensions_that_change_positions_are_named() {
    for name in ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"] {
        let used = ("extensionsUsed", json!([name]));
        let required = square([used.clone(), ("extensionsRequired", json!([name]))]);
        assert_refused(&required, &["requires the extension", name, "packs positions"]);
        let note = format!("extension {name} is not read; the plain positions are");
        assert_noted(&square([used.clone()]), &[&note]);
    }
    // Only used, but without plain positions: zeros would be wrong.
    let draco = ("meshes/0/primitives/0/extensions", json!({ "KHR_draco_mesh_compression": { "bufferView": 2 } }));
    assert_noted(
        &square([("extensionsUsed", json!(["KHR_draco_mesh_compression"])), draco.clone()]),
        &["extension KHR_draco_mesh_compression is not read; the plain positions are"],
    );
    let mut packed = square([draco]);
    packed["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert_refused(&packed, &["accessor 0", "KHR_draco_mesh_compression packs them"]);
    let fallback = json!([{ "byteLength": 60, "extensions": { "EXT_meshopt_compression": { "fallback": true } } }]);
    assert_refused(&square([("buffers", fallback)]), &["buffer 0", "EXT_meshopt_compression"]);

    let unknown = ("extensionsUsed", json!(["MAKER_twist"]));
    assert_noted(&square([unknown.clone()]), &["extension MAKER_twist is not known"]);
    assert_refused(&square([unknown, ("extensionsRequired", json!(["MAKER_twist"]))]), &["requires", "MAKER_twist"]);
}

#[test]
fn positions_may_be_whole_numbers() {
    let corners = [[0_i16, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]];
    for (kind, size, one) in [(5120, 1, 127_i64), (5121, 1, 255), (5122, 2, 32767), (5123, 2, 65535)] {
        for normalized in [false, true] {
            let scale = if normalized { one } else { 1 };
            // A stride of 4 or 8, as the format wants it.
            let bytes: Vec<u8> = corners
                .iter()
                .flat_map(|corner| {
                    corner.iter().chain(&[7]).flat_map(|x| (i64::from(*x) * scale).to_le_bytes()[..size].to_vec())
                })
                .collect();
            let document = with(
                document(&bytes),
                [
                    (
                        "accessors/0",
                        json!({ "bufferView": 2, "componentType": kind, "count": 4, "type": "VEC3", "normalized": normalized }),
                    ),
                    ("bufferViews/2/byteStride", json!(4 * size)),
                    ("extensionsRequired", json!(["KHR_mesh_quantization"])),
                ],
            );
            assert_whole(&format!("{kind} {normalized}"), &document);
        }
    }
    // The least of a signed type is -1 too.
    let bytes: Vec<u8> = [-128_i8, -127, 0].iter().map(|x| *x as u8).cycle().take(12).collect();
    let document = with(
        document(&bytes),
        [(
            "accessors/0",
            json!({ "bufferView": 2, "componentType": 5120, "count": 4, "type": "VEC3", "normalized": true }),
        )],
    );
    assert_eq!(load_bytes("a.gltf", document.to_string()).unwrap().triangles[0].a, [-1.0, -1.0, 0.0]);
    assert_refused(&square([("accessors/0/componentType", json!(5125))]), &["accessor 0", "three float32", "5125"]);
}

/// The first triangle of each copy of the square in a document with this instancing.
fn first_of_each(more: &[u8], attributes: Value, accessors: &[Value]) -> Vec<Triangle> {
    let mut document = document(more);
    document["accessors"].as_array_mut().unwrap().extend(accessors.iter().cloned());
    document["nodes"][0] = json!({
        "mesh": 0, "translation": [10, 0, 0],
        "extensions": { "EXT_mesh_gpu_instancing": { "attributes": attributes } },
    });
    document["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let file = file("a.gltf", document.to_string());
    let scene = load_with(&file.path, &STRICT).unwrap();
    scene.triangles.into_iter().step_by(2).collect()
}

#[test]
fn instances_are_moved_turned_and_scaled() {
    let floats = |values: &[f32]| values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>();
    let bytes = floats(&[0., 0., 0., 5., 6., 7., 1., 1., 1., 2., 3., 4.]);
    let vectors =
        |offset| json!({ "bufferView": 2, "byteOffset": offset, "componentType": 5126, "count": 2, "type": "VEC3" });
    let attributes = json!({ "TRANSLATION": 2, "SCALE": 3 });
    let made = first_of_each(&bytes, attributes, &[vectors(0), vectors(24)]);
    let plain = triangle([10., 0., 0.], [11., 0., 0.], [10., 1., 0.]);
    assert_eq!(made, [plain, triangle([15., 6., 7.], [17., 6., 7.], [15., 9., 7.])]);

    // A quarter turn about z, as bytes that stand for -1 to 1; a half as nearly as they can.
    let turns = json!({ "bufferView": 2, "componentType": 5122, "normalized": true, "count": 1, "type": "VEC4" });
    let bytes: Vec<u8> = [0_i16, 0, 23170, 23170].iter().flat_map(|x| x.to_le_bytes()).collect();
    let made = first_of_each(&bytes, json!({ "ROTATION": 2, "_ID": 2 }), &[turns]);
    assert_eq!(made, [triangle([10., 0., 0.], [10., 1., 0.], [9., 0., 0.])]);
}

#[test]
fn instances_that_are_wrong_are_refused() {
    let instanced = |attributes: Value| {
        square([("nodes/0/extensions", json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } }))])
    };
    assert_refused(&instanced(json!({ "TRANSLATION": 9 })), &["accessor 9"]);
    assert_refused(&instanced(json!({ "TRANSLATION": 0, "SCALE": 1 })), &["6 instances", "4 elements"]);
    assert_refused(&instanced(json!({ "ROTATION": 0 })), &["accessor 0", "four numbers"]);
    // Copies that no bytes stand for are limited like other elements without data.
    let mut many = instanced(json!({ "TRANSLATION": 2 }));
    many["accessors"].as_array_mut().unwrap().push(json!({ "componentType": 5126, "count": 300_000, "type": "VEC3" }));
    assert_refused(&many, &["accessor 2", "elements without data"]);
    assert_whole("no attributes", &instanced(json!({})));
}

#[test]
fn sparse_elements_may_come_in_any_order_and_without_a_base() {
    // Corners 3 and 1 of zeros, of which the third is left out: then it lies at the first.
    let mut bytes: Vec<u8> = vec![3, 1, 2, 0];
    bytes.extend([1_f32, 1., 0., 1., 0., 0., 0., 1., 0.].iter().flat_map(|x| x.to_le_bytes()));
    let sparse = json!({
        "count": 3, "indices": { "bufferView": 2, "componentType": 5121 }, "values": { "bufferView": 2, "byteOffset": 4 },
    });
    let accessor = json!({ "componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse });
    assert_whole("any order", &with(document(&bytes), [("accessors/0", accessor.clone())]));
    bytes[0] = 4;
    assert_refused(&with(document(&bytes), [("accessors/0", accessor)]), &["accessor 0", "sparse element 4 of 4"]);
}

#[test]
fn indices_without_data_are_zeros() {
    let zeros = json!({ "componentType": 5123, "count": 3, "type": "SCALAR" });
    let primitive = json!({ "attributes": { "POSITION": 0 }, "indices": 2 });
    let document = square([("accessors/-", zeros), ("meshes/0/primitives/-", primitive)]);
    let scene = load_bytes("a.gltf", document.to_string()).unwrap();
    assert_square("zeros", &scene.triangles[..2]);
    assert_eq!(scene.triangles[2..], [triangle([0.0; 3], [0.0; 3], [0.0; 3])]);
}

#[test]
fn primitives_that_make_no_triangles_are_said() {
    for (mode, note) in [
        (0, "a primitive of points is not read (node 0)"),
        (1, "a primitive of lines is not read (node 0)"),
        (3, "a primitive of lines is not read (node 0)"),
        (7, "a primitive of mode 7, which is not known, is not read (node 0)"),
    ] {
        let primitive = json!({ "attributes": { "POSITION": 0 }, "mode": mode });
        assert_noted(&square([("meshes/0/primitives/-", primitive)]), &[note]);
    }
}

#[test]
fn shapes_at_rest_are_said() {
    let posed = square([
        ("nodes/0/skin", json!(0)),
        ("skins", json!([{ "joints": [0] }])),
        ("meshes/0/primitives/0/targets", json!([{ "POSITION": 0 }])),
        ("meshes/0/weights", json!([1.0])),
    ]);
    assert_noted(
        &posed,
        &[
            "a skin is not applied: the mesh is read as it is at rest (node 0)",
            "morph targets are not applied: the base shape is read (node 0)",
        ],
    );
}

/// A GLB file of these chunks.
fn glb(version: u32, chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
    let mut bytes = [b"glTF".as_slice(), &version.to_le_bytes(), &[0; 4]].concat();
    for (kind, chunk) in chunks {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend_from_slice(*kind);
        bytes.extend_from_slice(chunk);
    }
    let length = bytes.len() as u32;
    bytes[8..12].copy_from_slice(&length.to_le_bytes());
    bytes
}

#[test]
fn containers_are_read_as_they_are_found() {
    let json = square([]).to_string();
    let padded = [json.as_bytes(), b"  \0\0"].concat();
    for chunks in [
        &[(b"JSON", json.as_bytes())][..],
        // Zero bytes in place of blanks, and a chunk of another kind.
        &[(b"JSON", &padded), (b"MORE", b"1234")],
        &[(b"MORE", b"1234"), (b"JSON", json.as_bytes())],
    ] {
        assert_square("chunks", &load_bytes("a.glb", glb(2, chunks)).unwrap().triangles);
    }
    let whole = glb(2, &[(b"JSON", json.as_bytes())]);
    let mut short = whole.clone();
    short[8..12].copy_from_slice(&40_u32.to_le_bytes());
    assert_eq!(load_bytes("a.glb", short).unwrap().notes, []);
    let scene = load_bytes("a.glb", [whole.as_slice(), b"more"].concat()).unwrap();
    assert_eq!(said(&scene), ["a byte after the end of the GLB file is left out (4 times)"]);
    for (bytes, part) in [
        (glb(1, &[(b"JSON", json.as_bytes())]), "GLB version 1 is not read"),
        (glb(2, &[(b"MORE", b"1234")]), "no JSON chunk"),
        (whole[..whole.len() - 1].to_vec(), "truncated"),
        (b"glTF\x02\0\0\0".to_vec(), "the GLB header has 12 bytes"),
    ] {
        let message = refusal("a.glb", bytes);
        assert!(message.contains(part), "{part}: {message}");
    }
}

#[test]
fn texts_are_read_as_they_are_found() {
    let json = square([("nodes/0/name", json!("grXn"))]).to_string();
    for text in [
        json.replace('X', "ü").into_bytes(),
        json.bytes().map(|byte| if byte == b'X' { 0xfc } else { byte }).collect(),
        format!("\u{feff}{json}").into_bytes(),
        format!("{json}\n\0\0").into_bytes(),
    ] {
        assert_square("text", &load_bytes("a.gltf", &text).unwrap().triangles);
        assert_square("text", &load_bytes("a", &text).unwrap().triangles);
    }
    let utf16: Vec<u8> = [0xfeff].into_iter().chain(json.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    assert!(refusal("a.gltf", utf16).contains("UTF-16"));
    let first = r#"{"asset":{"version":"1.0"},"meshes":{"a":{}},"buffers":{}}"#;
    assert!(refusal("a.gltf", first).contains("glTF 1.0 is not read"));
    assert!(refusal("a.gltf", r#"{"asset":{"version":"3.0"}}"#).contains("glTF 3.0 is not read"));
}

#[test]
fn buffers_are_found_beside_the_scene() {
    for (uri, name) in
        [("a%20b.bin", "a b.bin"), ("a b.bin", "a b.bin"), ("a%20b.bin", "a%20b.bin"), ("c\\d.bin", "c/d.bin")]
    {
        let mut document = square([]);
        let bytes = document["buffers"][0]["uri"].take();
        document["buffers"][0]["uri"] = json!(uri);
        let scene = file("a.gltf", document.to_string());
        std::fs::create_dir(scene.path.with_file_name("c")).unwrap();
        let (_, bytes) = bytes.as_str().unwrap().split_once(',').unwrap();
        let bytes = data_url::forgiving_base64::decode_to_vec(bytes.as_bytes()).unwrap();
        std::fs::write(scene.path.with_file_name(name), bytes).unwrap();
        assert_square(uri, &load(&scene.path).unwrap().triangles);
    }
}

#[test]
fn a_pointer_in_the_place_of_a_buffer_is_named() {
    let document = square([("buffers/0/uri", json!("a.bin"))]);
    let scene = file("a.gltf", document.to_string());
    std::fs::write(scene.path.with_file_name("a.bin"), "version https://git-lfs.github.com/spec/v1\n").unwrap();
    let message = load(&scene.path).unwrap_err().to_string();
    assert!(message.contains("buffer 0") && message.contains("a Git LFS pointer"), "{message}");
}

#[test]
fn transforms_that_cancel_leave_what_was_there() {
    let move_by = |x: f64| json!([x, 0.0, 0.0]);
    let nodes = json!([{ "children": [1], "translation": move_by(-16_777_217.0) }, { "mesh": 0, "translation": move_by(16_777_217.0) }]);
    assert_whole("translations that float32 does not have", &square([("nodes", nodes)]));
}

#[test]
fn a_later_version_that_is_needed_is_named() {
    assert_refused(&square([("asset", json!({ "version": "2.0", "minVersion": "2.1" }))]), &["glTF 2.1"]);
}
