//! What a file is: by its name, by what it begins with, or by what the user says.

use super::*;

const NO_OPTIONS: LoadOptions = LoadOptions { format: None, strict: false };

#[test]
fn a_file_without_a_known_extension_is_told_by_its_content() {
    let square = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n";
    let comments = "# a long licence\n".repeat(1000) + square;
    for bytes in [
        square.as_bytes().to_vec(),
        comments.clone().into_bytes(),
        format!("\u{feff}\n# x\r\n{square}").into_bytes(),
        format!("mtllib a\n{square}").into_bytes(),
        xz(comments.as_bytes()),
        gzip(square.as_bytes()),
        zstd(square.as_bytes()),
    ] {
        for name in ["scene", "scene.model", "scene.txt"] {
            assert_square(name, &load_bytes(name, &bytes).unwrap().triangles);
        }
    }
    for bytes in [
        PLY.as_bytes().to_vec(),
        PLY.to_uppercase().replace('\n', "\r").into_bytes(),
        ply_binary(true),
        stl_text(&fan()).into_bytes(),
        stl_text(&fan()).to_uppercase().into_bytes(),
        stl_binary(b"made by hand", &fan()),
        stl_binary(b"solid", &fan()),
        OBJ.into(),
        gzip(&stl_binary(b"", &fan())),
    ] {
        assert_eq!(load_bytes("63", &bytes).unwrap().triangles, fan());
    }
}

#[test]
fn an_archive_is_told_by_its_content_too() {
    assert_eq!(load_bytes("a.obj", gzip(OBJ.as_bytes())).unwrap().triangles, fan());
    assert_eq!(load_bytes("a.stl", xz(&stl_binary(b"", &fan()))).unwrap().triangles, fan());
    assert_eq!(load_bytes("a.xz", xz(PLY.as_bytes())).unwrap().triangles, fan());
}

#[test]
fn what_the_user_says_comes_before_the_name() {
    let file = file("scene.obj", PLY);
    let as_format = |format| load_with(&file.path, &LoadOptions { format: Some(format), ..NO_OPTIONS });
    let scene = as_format(Format::Ply).unwrap();
    assert_eq!((scene.name.as_str(), scene.triangles), ("scene", fan()));
    let message = as_format(Format::Stl).unwrap_err().to_string();
    assert!(message.ends_with("read as STL, but it begins as PLY does"), "{message}");
    for (name, format) in [
        ("obj", Format::Obj),
        ("PLY", Format::Ply),
        ("stl", Format::Stl),
        ("glb", Format::Gltf),
        ("gltf", Format::Gltf),
    ] {
        assert_eq!(name.parse(), Ok(format));
    }
    let message = "fbx".parse::<Format>().unwrap_err().to_string();
    assert!(message.contains("\"fbx\"") && message.contains("obj, ply, stl, gltf and glb"), "{message}");
}

#[test]
fn a_wrong_extension_is_said() {
    for (name, bytes, looks) in [
        ("a.obj", PLY.as_bytes().to_vec(), "PLY"),
        ("a.obj", b"glTF\x02\0\0\0".to_vec(), "glTF"),
        ("a.ply", OBJ.into(), "OBJ"),
        ("a.stl", OBJ.into(), "OBJ"),
        ("a.glb", stl_text(&fan()).into(), "STL"),
    ] {
        let message = refusal(name, bytes);
        assert!(message.ends_with(&format!(", but it begins as {looks} does")), "{name}: {message}");
    }
}

#[test]
fn what_stands_in_the_place_of_a_scene_is_named() {
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n";
    for name in ["a.obj", "a.ply", "a.stl", "a.gltf", "a.glb", "a.obj.xz", "a.stl.gz", "a", "a.bin"] {
        let message = refusal(name, pointer);
        assert!(message.contains("a Git LFS pointer") && message.contains("git lfs pull"), "{name}: {message}");
    }
    for (text, part) in [
        ("\n<!DOCTYPE html>\n<html><body>404", "an HTML page"),
        ("<HTML>", "an HTML page"),
        ("\x2fannex/objects/SHA256E-s7--x.obj", "a git-annex pointer"),
        ("Kaydara FBX Binary  \0", "an FBX file"),
    ] {
        let message = refusal("a.obj", text);
        assert!(message.contains(part), "{text}: {message}");
    }
}

#[test]
fn content_that_tells_nothing_is_refused() {
    for bytes in [&b"OFF\n3 1 0\n"[..], b"\x7fELF\x02\x01\x01\0\0\0", b"words in a line", &[0; 200]] {
        let message = refusal("scene", bytes);
        assert!(message.contains("unknown extension \"\", and the content tells no format"), "{message}");
    }
}

#[test]
fn a_note_that_is_planted_is_found() {
    // The lists above would be of no use if a reader never said anything.
    let mut notes = Notes::default();
    notes.add(Place::Line(3), "planted");
    notes.add_many(Place::Element("face", 7), 2, "planted");
    let notes = notes.into_vec();
    assert_eq!(notes.iter().map(ToString::to_string).collect::<Vec<_>>(), ["planted (3 times, first at line 3)"]);
}
