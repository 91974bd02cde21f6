//! Each format gives the triangles that are in it.

use super::*;
use proptest::prelude::*;

fn assert_fan(name: &str, bytes: impl AsRef<[u8]>) {
    let scene = load_bytes(name, bytes).unwrap();
    assert_eq!(scene.triangles, fan(), "{name}");
    assert_eq!(scene.hash, Scene::from_triangles("fan", fan()).unwrap().hash, "{name}");
}

#[test]
fn every_format_gives_the_same_fan() {
    assert_fan("a.obj", OBJ);
    assert_fan("a.OBJ", OBJ);
    assert_fan("a.ply", PLY);
    assert_fan("a.ply", ply_binary(false));
    assert_fan("a.ply", ply_binary(true));
    assert_fan("a.stl", stl_text(&fan()));
    assert_fan("a.stl", stl_binary(b"", &fan()));
}

#[test]
fn every_packing_of_every_format_is_read() {
    let formats: [(&str, Vec<u8>); 4] =
        [("obj", OBJ.into()), ("ply", PLY.into()), ("stl", stl_text(&fan()).into()), ("stl", stl_binary(b"", &fan()))];
    for (format, bytes) in formats {
        assert_fan(&format!("a.{format}.gz"), gzip(&bytes));
        assert_fan(&format!("a.{format}.xz"), xz(&bytes));
        assert_fan(&format!("a.{format}.zst"), zstd(&bytes));
    }
}

#[test]
fn packed_files_of_several_parts_are_read_whole() {
    let (first, second) = OBJ.as_bytes().split_at(40);
    assert_fan("a.obj.gz", [gzip(first), gzip(second)].concat());
    assert_fan("a.obj.xz", [xz(first), xz(second)].concat());
    let skippable = [0x184d_2a50_u32.to_le_bytes().as_slice(), &3_u32.to_le_bytes(), b"abc"].concat();
    assert_fan("a.obj.zst", [skippable.clone(), zstd(first), skippable, zstd(second)].concat());
}

#[test]
fn name_and_source_come_from_the_path() {
    let file = file("big.room.obj.gz", gzip(OBJ.as_bytes()));
    let scene = load(&file.path).unwrap();
    assert_eq!(scene.name, "big.room");
    assert_eq!(scene.source, file.path.display().to_string());
}

#[test]
fn obj_indices_may_count_backwards_or_come_first() {
    let vertices: String = CORNERS.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    assert_fan("a.obj", format!("{vertices}f -4 -3 -2 -1\n"));
    assert_fan("a.obj", format!("f 1 2 3 4\n{vertices}"));
    assert_fan("a.obj", format!("{vertices}v 9 9 9\nf -5//-1 -4//-1 -3//-1 -2//-1"));
}

#[test]
fn obj_statements_without_triangles_are_passed_over() {
    let mut text = OBJ.as_bytes().to_vec();
    text.extend_from_slice(b"f\nf 1\nf 1 2\nl 1 2 3\np 4\ncurv 0 1 9 99\ng \xff\xfe not UTF-8\nvn nan nan nan\n");
    assert_fan("a.obj", text);
}

#[test]
fn obj_lines_may_be_joined_and_end_in_any_way() {
    assert_fan("a.obj", OBJ.replace('\n', "\r\n"));
    assert_fan("a.obj", OBJ.replace("2/1 ", "2/1 \\\n  "));
    assert_fan("a.obj", OBJ.replace("v 1.5", "  v\t1.5"));
}

#[test]
fn ply_elements_may_be_in_any_order_and_of_any_type() {
    let text = "ply\nformat ascii 1.0\nelement face 2\nproperty uchar flags\nproperty list uchar short vertex_index\nelement edge 1\nproperty int a\nelement vertex 4\nproperty double z\nproperty double y\nproperty double x\nend_header\n0 2 0 1\n0 4 0 1 2 3\n5\n0 0 0\n0 0 1.5\n0 2.25 1.5\n-0.5 2.25 0.1\n";
    assert_fan("a.ply", text);
}

#[test]
fn stl_text_may_hold_several_solids() {
    let [first, second] = [&fan()[..1], &fan()[1..]].map(stl_text);
    assert_fan("a.stl", format!("{first}\n{second}"));
    assert_fan("a.stl", format!("{}{second}", first.replace("solid\n", "solid part one\n")));
}

#[test]
fn stl_binary_may_begin_like_text() {
    assert_fan("a.stl", stl_binary(b"solid made by an exporter", &fan()));
}

proptest! {
    #[test]
    fn text_gives_back_the_same_float32(bits in prop::collection::vec(any::<u32>(), 9)) {
        let x: Vec<f32> = bits.iter().map(|bits| f32::from_bits(*bits)).map(|x| if x.is_finite() { x } else { 0.5 }).collect();
        let want = triangle([x[0], x[1], x[2]], [x[3], x[4], x[5]], [x[6], x[7], x[8]]);
        let obj = format!("v {} {} {}\nv {:e} {:e} {:e}\nv {} {} {}\nf 1 2 3\n", x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8]);
        let bytes = |scene: Scene| bytemuck::cast_slice::<_, u32>(&scene.triangles).to_vec();
        let have = bytes(load_bytes("a.obj", obj).unwrap());
        prop_assert_eq!(have.as_slice(), bytemuck::cast_slice::<f32, u32>(&x));
        prop_assert_eq!(&bytes(load_bytes("a.stl", stl_text(&[want])).unwrap()), &have);
        prop_assert_eq!(&bytes(load_bytes("a.stl", stl_binary(b"", &[want])).unwrap()), &have);
    }
}
