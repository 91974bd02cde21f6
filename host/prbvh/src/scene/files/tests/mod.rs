//! Tests of scenes: files of each format as a user would have them, good and bad.

mod bad_input;
mod cases;
mod formats;
mod gltf_files;
mod gltf_relatives;
mod names;
mod polygons;
mod relatives;
mod shared;

use super::*;
use flate2::write::GzEncoder;
use std::io::Write;
use std::path::PathBuf;
use tempfile::TempDir;

/// A folder with one file in it.
struct File {
    _folder: TempDir,
    path: PathBuf,
}

fn file(name: &str, bytes: impl AsRef<[u8]>) -> File {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    File { _folder: folder, path }
}

fn load_bytes(name: &str, bytes: impl AsRef<[u8]>) -> Result<Scene, SceneError> {
    load(&file(name, bytes).path)
}

/// What `load` says of a bad file, which must name the file.
fn refusal(name: &str, bytes: impl AsRef<[u8]>) -> String {
    let file = file(name, bytes);
    let message = load(&file.path).expect_err("a bad file was loaded").to_string();
    let rest = message.strip_prefix(&file.path.display().to_string());
    rest.unwrap_or_else(|| panic!("no file name in: {message}")).to_string()
}

fn triangle(a: [f32; 3], b: [f32; 3], c: [f32; 3]) -> Triangle {
    Triangle { a, b, c }
}

const CORNERS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [1.5, 2.25, 0.0], [0.1, 2.25, -0.5]];

/// The polygon of the four [`CORNERS`] as a fan.
fn fan() -> Vec<Triangle> {
    let [a, b, c, d] = CORNERS;
    vec![triangle(a, b, c), triangle(a, c, d)]
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn xz(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = lzma_rust2::XzWriter::new(Vec::new(), lzma_rust2::XzOptions::default()).unwrap();
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn zstd(bytes: &[u8]) -> Vec<u8> {
    ruzstd::encoding::compress_to_vec(bytes, ruzstd::encoding::CompressionLevel::Fastest)
}

const OBJ: &str = "# a quad\nmtllib gone.mtl\no quad\nv 0 0 0\nv 1.5 0 0 1 0 0\nv 1.5 2.25 0\nv 0.1 2.25 -0.5\nvt 0 0\nusemtl grey\ns off\nf 1/1/1 2/1 3//1 4\n";

const PLY: &str = "ply\nformat ascii 1.0\ncomment a quad\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 7\n1.5 0 0 7\n1.5 2.25 0 7\n0.1 2.25 -0.5 7\n4 0 1 2 3\n";

fn ply_binary(big_endian: bool) -> Vec<u8> {
    let order = if big_endian { "big" } else { "little" };
    let mut bytes = format!("ply\nformat binary_{order}_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar uint vertex_index\nend_header\n").into_bytes();
    for x in CORNERS.into_iter().flatten() {
        bytes.extend(if big_endian { x.to_be_bytes() } else { x.to_le_bytes() });
    }
    bytes.push(4);
    for index in 0..4_u32 {
        bytes.extend(if big_endian { index.to_be_bytes() } else { index.to_le_bytes() });
    }
    bytes
}

fn stl_binary(header: &[u8], triangles: &[Triangle]) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, b' ');
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        bytes.extend_from_slice(bytemuck::bytes_of(triangle));
        bytes.extend([0; 2]);
    }
    bytes
}

fn stl_text(triangles: &[Triangle]) -> String {
    let facet = |t: &Triangle| {
        let vertex = |[x, y, z]: [f32; 3]| format!("vertex {x} {y} {z}\n");
        format!("facet normal 0 0 0\nouter loop\n{}{}{}endloop\nendfacet\n", vertex(t.a), vertex(t.b), vertex(t.c))
    };
    format!("solid\n{}endsolid\n", triangles.iter().map(facet).collect::<String>())
}

/// The notes as a user sees them.
fn said(scene: &Scene) -> Vec<String> {
    scene.notes.iter().map(ToString::to_string).collect()
}

trait Area {
    fn area(&self) -> f64;
}

impl Area for Triangle {
    fn area(&self) -> f64 {
        let [u, v] = [self.b, self.c].map(|to| [0, 1, 2].map(|k| f64::from(to[k]) - f64::from(self.a[k])));
        let cross = [0, 1, 2].map(|k| u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3]);
        0.5 * cross.iter().map(|x| x * x).sum::<f64>().sqrt()
    }
}

/// Asserts that these are the halves of the unit square in the plane of x and y.
#[track_caller]
fn assert_square(name: &str, triangles: &[Triangle]) {
    assert_eq!(triangles.len(), 2, "{name}");
    let corners = |t: &Triangle| [t.a, t.b, t.c].map(|corner| corner.map(|x| x as i32));
    let mut all: Vec<_> = triangles.iter().flat_map(corners).collect();
    // Each lacks a corner, and these two are opposite.
    assert_eq!([0, 1].map(|k| all.iter().map(|corner| corner[k]).sum::<i32>()), [3, 3], "{name}");
    all.sort_unstable();
    all.dedup();
    assert_eq!(all, [[0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0]], "{name}");
    assert_eq!(triangles.iter().map(Area::area).collect::<Vec<_>>(), [0.5, 0.5], "{name}");
}
