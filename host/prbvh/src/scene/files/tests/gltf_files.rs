//! glTF and GLB files.

use super::*;
use std::fmt::Write as _;

const BASE64: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

pub(super) fn base64(bytes: &[u8]) -> String {
    let group = |bytes: &[u8]| {
        let word = (0..3).fold(0_u32, |word, i| word << 8 | u32::from(*bytes.get(i).unwrap_or(&0)));
        (0..4)
            .map(move |i| if i <= bytes.len() { BASE64[(word >> (18 - 6 * i) & 63) as usize] as char } else { '=' })
            .collect::<String>()
    };
    bytes.chunks(3).map(group).collect()
}

/// The four corners, then the indices 0 1 2 0 2 3 as 16-bit numbers: 48 + 12 bytes.
fn data() -> Vec<u8> {
    let mut bytes: Vec<u8> = bytemuck::cast_slice(&CORNERS).to_vec();
    for index in [0_u16, 1, 2, 0, 2, 3] {
        bytes.extend(index.to_le_bytes());
    }
    bytes
}

const INDEXED: &str = r#"{"attributes":{"POSITION":0},"indices":1}"#;

/// A document of one mesh; `extra` is added to its accessors.
fn document(uri: &str, nodes: &str, primitive: &str, extra: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":{nodes},
"meshes":[{{"primitives":[{primitive}]}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,-0.5],"max":[1.5,2.25,0]}},
{{"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}}{extra}],
"bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":12}},{{"buffer":0,"byteOffset":24,"byteLength":12}}],
"buffers":[{{"byteLength":60{uri}}}]}}"#
    )
}

fn embedded(nodes: &str, primitive: &str, extra: &str) -> String {
    let uri = format!(r#","uri":"data:application/octet-stream;base64,{}""#, base64(&data()));
    document(&uri, nodes, primitive, extra)
}

fn glb(nodes: &str, primitive: &str, extra: &str) -> Vec<u8> {
    let mut json = document("", nodes, primitive, extra).into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let blob = data();
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((28 + json.len() as u32 + blob.len() as u32).to_le_bytes());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(json);
    bytes.extend((blob.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(blob);
    bytes
}

const PLAIN: &str = r#"[{"mesh":0}]"#;
/// Parent: a quarter turn about z and a shift. Child: a scale.
const MOVED: &str = r#"[{"matrix":[0,1,0,0,-1,0,0,0,0,0,1,0,10,20,30,1],"children":[1]},{"mesh":0,"scale":[2,2,4],"rotation":[0,0,0,1]}]"#;
const SPARSE: &str = r#",{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,-0.5],"max":[1.5,2.25,0],"sparse":{"count":1,"indices":{"bufferView":1,"byteOffset":2,"componentType":5123},"values":{"bufferView":2}}}"#;

#[test]
fn data_uris_blobs_and_files_beside_are_read() {
    assert_eq!(load_bytes("a.gltf", embedded(PLAIN, INDEXED, "")).unwrap().triangles, fan());
    assert_eq!(load_bytes("a.glb", glb(PLAIN, INDEXED, "")).unwrap().triangles, fan());
    assert_eq!(load_bytes("a.glb.zst", zstd(&glb(PLAIN, INDEXED, ""))).unwrap().triangles, fan());
    let beside = file("a.gltf", document(r#","uri":"my%20data.bin""#, PLAIN, INDEXED, ""));
    std::fs::write(beside.path.with_file_name("my data.bin"), data()).unwrap();
    assert_eq!(load(&beside.path).unwrap().triangles, fan());
}

#[test]
fn strips_fans_and_plain_corners_are_read() {
    let [a, b, c, d] = CORNERS;
    let load = |primitive: &str| load_bytes("a.gltf", embedded(PLAIN, primitive, "")).map(|scene| scene.triangles);
    assert_eq!(load(r#"{"attributes":{"POSITION":0},"mode":6}"#).unwrap(), fan());
    assert_eq!(load(r#"{"attributes":{"POSITION":0},"mode":5}"#).unwrap(), [triangle(a, b, c), triangle(b, d, c)]);
    let message = load(r#"{"attributes":{"POSITION":0}}"#).unwrap_err().to_string();
    assert!(message.contains("4 corners are no whole number of triangles"), "{message}");
    for mode in 0..4 {
        let fault = load(&format!(r#"{{"attributes":{{"POSITION":0}},"mode":{mode}}}"#));
        assert!(matches!(fault, Err(SceneError::NoTriangles { .. })), "{fault:?}");
    }
}

#[test]
fn sparse_accessors_replace_values() {
    // Element 1 becomes the third corner.
    let scene = load_bytes("a.gltf", embedded(PLAIN, r#"{"attributes":{"POSITION":2},"mode":6}"#, SPARSE)).unwrap();
    let [a, _, c, d] = CORNERS;
    assert_eq!(scene.triangles, [triangle(a, c, c), triangle(a, c, d)]);
}

#[test]
fn nodes_move_their_meshes() {
    let scene = load_bytes("a.gltf", embedded(MOVED, INDEXED, "")).unwrap();
    let moved = |[x, y, z]: [f32; 3]| [10.0 - 2.0 * y, 20.0 + 2.0 * x, 30.0 + 4.0 * z];
    let want: Vec<_> = fan().iter().map(|t| triangle(moved(t.a), moved(t.b), moved(t.c))).collect();
    assert_eq!(scene.triangles, want);
}

#[test]
fn a_rotation_is_rounded_once() {
    // A third of a turn about (1, 1, 1) permutes the axes exactly, whatever the length of the quaternion.
    let nodes = r#"[{"mesh":0,"rotation":[0.5,0.5,0.5,0.5],"translation":[0,0,0]}]"#;
    let scene = load_bytes("a.gltf", embedded(nodes, INDEXED, "")).unwrap();
    let moved = |[x, y, z]: [f32; 3]| [z, x, y];
    let want: Vec<_> = fan().iter().map(|t| triangle(moved(t.a), moved(t.b), moved(t.c))).collect();
    assert_eq!(scene.triangles, want);
}

#[test]
fn a_node_may_have_many_descendants() {
    let mut nodes = String::from("[");
    for node in 0..20_000 {
        write!(nodes, r#"{{"children":[{}]}},"#, node + 1).unwrap();
    }
    nodes += r#"{"mesh":0}]"#;
    assert_eq!(load_bytes("a.gltf", embedded(&nodes, INDEXED, "")).unwrap().triangles, fan());
}

#[test]
fn faults_name_place_and_value() {
    let cases: [(Vec<u8>, &[&str]); 10] = [
        (embedded(PLAIN, r#"{"attributes":{"POSITION":7}}"#, "").into(), &["accessor 7", "there are 2"]),
        (embedded(r#"[{"mesh":0,"children":[0]}]"#, INDEXED, "").into(), &["node 0", "its own ancestor"]),
        (
            embedded(r#"[{"mesh":0,"scale":[1e38,1,1]},{}]"#, INDEXED, "").replace("1e38", "3e38").into(),
            &["node 0", "accessor 0", "vertex 1", "inf"],
        ),
        (
            embedded(PLAIN, INDEXED, "").replace(r#""count":6"#, r#""count":7"#).into(),
            &["accessor 1", "7 elements from byte 0 pass the 12 bytes"],
        ),
        (embedded(PLAIN, INDEXED, "").replace(r#""count":6"#, r#""count":0"#).into(), &["accessor 1", "no elements"]),
        (embedded(PLAIN, INDEXED, "").replace("5123", "5126").into(), &["accessor 1", "unsigned integer"]),
        (embedded(PLAIN, INDEXED, "").replace("VEC3", "VEC4").into(), &["accessor 0", "three float32"]),
        (
            embedded(PLAIN, INDEXED, "").replace(r#""count":4"#, r#""count":3"#).into(),
            &["accessor 1", "index 3", "3 vertices"],
        ),
        (
            embedded(PLAIN, INDEXED, "").replace(r#""byteLength":60"#, r#""byteLength":61"#).into(),
            &["buffer 0", "60 bytes of 61"],
        ),
        (document(r#","uri":"gone.bin""#, PLAIN, INDEXED, "").into(), &["buffer 0", "gone.bin"]),
    ];
    for (bytes, parts) in cases {
        let message = refusal("a.gltf", &bytes);
        for part in parts {
            assert!(message.contains(part), "\"{part}\" is missing in: {message}");
        }
    }
    let short = [b"glTF\x02\0\0\0".as_slice(), &11_u32.to_le_bytes(), &[0; 8]].concat();
    assert!(refusal("a.glb", short).contains("11 bytes"));
    let good = glb(PLAIN, INDEXED, "");
    assert!(!refusal("a.glb", &good[..good.len() - 1]).is_empty());
}

#[test]
fn accessors_without_data_are_limited() {
    let huge = SPARSE
        .replace(r#""bufferView":0,"componentType":5126,"count":4"#, r#""componentType":5126,"count":4000000000"#);
    let message = refusal("a.gltf", embedded(PLAIN, r#"{"attributes":{"POSITION":2},"mode":6}"#, &huge));
    assert!(message.contains("4000000000 elements without data"), "{message}");
}

#[test]
fn a_coordinate_that_is_not_finite_is_named() {
    let mut bytes = glb(PLAIN, INDEXED, "");
    let start = bytes.len() - 60;
    bytes[start + 12..start + 16].copy_from_slice(&f32::NAN.to_le_bytes());
    let message = refusal("a.glb", bytes);
    assert!(message.contains("vertex 1") && message.contains("NaN"), "{message}");
}
