//! Text formats as writers and editors leave them: other line ends, marks, cases, encodings, and statements that nobody lists.

use super::*;

const STRICT: LoadOptions = LoadOptions { strict: true, format: None };

/// Asserts that a file of the unit square is read whole.
#[track_caller]
fn assert_whole(name: &str, what: &str, bytes: impl AsRef<[u8]>) {
    let file = file(name, bytes);
    let scene = load_with(&file.path, &STRICT).unwrap_or_else(|error| panic!("{what}: {error}"));
    assert_square(what, &scene.triangles);
}

/// Asserts that a file holds the square and what a note says, and that it is refused where nothing may be left out.
#[track_caller]
fn assert_noted(name: &str, bytes: impl AsRef<[u8]>, note: &str) {
    let file = file(name, bytes);
    let scene = load(&file.path).unwrap_or_else(|error| panic!("{note}: {error}"));
    assert_square(note, &scene.triangles);
    assert_eq!(said(&scene), [note]);
    let refused = load_with(&file.path, &STRICT).expect_err(note);
    assert!(matches!(&refused, SceneError::NotWhole { notes, .. } if *notes == scene.notes), "{refused}");
    assert!(refused.to_string().ends_with(&format!(": not read whole: {note}")), "{refused}");
}

#[track_caller]
fn assert_refused(name: &str, bytes: impl AsRef<[u8]>, parts: &[&str]) {
    let message = refusal(name, bytes);
    for part in parts {
        assert!(message.contains(part), "\"{part}\" is missing in: {message}");
    }
}

/// A text as UTF-16 with its mark.
fn utf16(text: &str, big_endian: bool) -> Vec<u8> {
    let units = [0xfeff].into_iter().chain(text.encode_utf16());
    units.flat_map(|unit| if big_endian { unit.to_be_bytes() } else { unit.to_le_bytes() }).collect()
}

const SQUARE_OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n";

/// The square after other lines, before others, or with a line replaced.
fn obj(before: &str, replace: (&str, &str), after: &str) -> String {
    assert!(SQUARE_OBJ.contains(replace.0), "{replace:?}");
    before.to_owned() + &SQUARE_OBJ.replace(replace.0, replace.1) + after
}

#[test]
fn obj_files_that_are_read_whole() {
    let first = ("f 1 2 3\n", "f 1 2 3\n");
    for (what, text) in [
        ("carriage returns", SQUARE_OBJ.replace('\n', "\r")),
        ("both line ends", SQUARE_OBJ.replace('\n', "\r\n")),
        ("no last line end", SQUARE_OBJ.trim_end().to_owned()),
        ("upper case", SQUARE_OBJ.to_uppercase()),
        ("fo in upper case", obj("", ("f 1", "FO 1"), "")),
        ("a mark before a comment", obj("\u{feff}# a comment\n", first, "")),
        ("an indented comment that ends in a backslash", obj("", ("f 1", "  # C:\\\nf 1"), "")),
        ("a comment after a vertex that ends in a backslash", obj("", ("v 1 0 0", "v 1 0 0 # C:\\"), "")),
        ("a comment next to an index", obj("", ("f 1 2 3", "f 1 2 3#x y"), "")),
        ("a comment after a normal", obj("", ("f 1", "vn 0 0 1 # up \\\nf 1"), "")),
        ("names that end in backslashes", obj("mtllib C:\\\no a\\\n", ("f 1", "g C:\\a\\\nf 1"), "")),
        ("a name that is a number sign", obj("", ("f 1", "usemtl #1 \\\nf 1"), "")),
        ("a face on two lines", obj("", ("f 1 2 3", "f 1 2 \\\n3"), "")),
        ("a face on four lines", obj("", ("f 1 2 3", "f \\\r\n1 \\\r\n2\\\r\n3"), "")),
        ("a backslash and blanks", obj("", ("f 1 2 3", "f 1 2 \\  \n3"), "")),
        ("a backslash before the end", obj("", ("f 2 4 3\n", "f 2 4 3 \\"), "")),
        ("texture coordinates on two lines", obj("", ("f 1", "vt 0 \\\n0\nf 1"), "")),
        ("negative indices", obj("", ("f 1 2 3", "f -4 -3 -2"), "")),
        ("all forms of corners", obj("", ("f 1 2 3", "f 1/7/7 2//7 3/"), "")),
        ("colours of no numbers", obj("", ("v 1 0 0", "v 1 0 0 -nan(ind) 1.#IND x"), "")),
        ("files put together", obj("# one\n", ("f 1 2 3", "\u{feff}f 1 2 3"), "")),
        ("weights and colours", obj("", ("v 1 0 0", "v 1 0 0 1.0 0.5 nan"), "")),
        ("blank lines and tabs", obj("\n \t\n", ("f 1 2 3", "\tf\t1\t2\t3"), "\n\n")),
        ("an end of DOS", obj("", first, "\u{1a}")),
        ("zero bytes at the end", obj("", first, "\0\0\0\0")),
        ("looks", obj("", first, "usemtl a\ns 1\ns off\nlod 3\nbevel on\nc_interp off\nshadow_obj a.obj\nmg 1 2\n")),
        ("parameters of curves", obj("", first, "vp 0 1\ncstype bezier\ndeg 3\nparm u 0 1\nend\n")),
    ] {
        assert_whole("a.obj", what, text);
    }
    let latin_1 = [b"# M\xfcller \\\no K\xf6rper\nusemtl gr\xfcn\n", SQUARE_OBJ.as_bytes()].concat();
    assert_whole("a.obj", "Latin-1", latin_1);
}

#[test]
fn obj_statements_that_are_not_read_are_said() {
    let last = ("f 2 4 3\n", "f 2 4 3\n");
    for (after, note) in [
        ("l 1 2\nl 2 3 4\n", "statement \"l\" (lines) is not read (2 times, first at line 7)"),
        ("p 1\n", "statement \"p\" (points) is not read (line 7)"),
        ("curv 0 1 1 2 3\n", "statement \"curv\" (curves) is not read (line 7)"),
        ("surf 0 1 0 1 1 2 \\\n3 4\n", "statement \"surf\" (surfaces) is not read (line 7)"),
        ("bzp 1 2 3 4\n", "statement \"bzp\" (Bézier patches) is not read (line 7)"),
        ("\ncall part.obj\\\n", "statement \"call\" (the statements of another file) is not read (line 8)"),
        ("tetra 1 2 3 4\n", "statement \"tetra\" is not known (line 7)"),
        ("f 1 2\n", "a face of fewer than three corners is left out (line 7)"),
    ] {
        assert_noted("a.obj", obj("", last, after), note);
    }
    // A line that a name's backslash was meant to join is not lost without a word.
    assert_noted("a.obj", obj("", last, "g a \\\nb c\n"), "statement \"b\" is not known (line 8)");
}

#[test]
fn obj_files_that_no_guess_would_put_right() {
    // The backslash joins a statement to the next, whose vertex or face would be lost.
    assert_refused(
        "a.obj",
        obj("", ("v 1 0 0", "v 1 0 0 \\"), ""),
        &["line 2", "a backslash joins the statement \"v\""],
    );
    assert_refused(
        "a.obj",
        obj("", ("f 1 2 3", "f 1 2 3\\"), ""),
        &["line 5", "a backslash joins the statement \"f\""],
    );
    assert_refused("a.obj", obj("", ("v 1 0 0", "v 1,0 0,0 0"), ""), &["line 2", "\"1,0\" is not a number"]);
    for big_endian in [false, true] {
        assert_refused("a.obj", utf16(SQUARE_OBJ, big_endian), &["UTF-16", "UTF-8 is read"]);
    }
}

const PLY_HEADER: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n";
const PLY_BODY: &str = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n3 0 1 2\n3 1 3 2\n";

/// The square with a piece of its header and one of its body replaced.
fn ply_text(header: (&str, &str), body: (&str, &str)) -> String {
    assert!(PLY_HEADER.contains(header.0) && PLY_BODY.contains(body.0), "{header:?} {body:?}");
    PLY_HEADER.replace(header.0, header.1) + &PLY_BODY.replace(body.0, body.1)
}

/// The same as binary; `strips` in place of faces, and so many types of numbers in their lists.
fn ply_bytes(big_endian: bool, list: &str, line_end: &str, strip: bool) -> Vec<u8> {
    let order = if big_endian { "binary_big_endian" } else { "binary_little_endian" };
    let mut header = PLY_HEADER.replace("ascii", order).replace("list uchar int", &format!("list {list}"));
    let mut bytes = Vec::new();
    let mut put = |kind: &str, value: i16| {
        let both = match kind {
            "uchar" | "char" | "uint8" => ([value as u8].to_vec(), [value as u8].to_vec()),
            "ushort" | "short" | "int16" => (value.to_be_bytes().to_vec(), value.to_le_bytes().to_vec()),
            "int" | "uint" => (i32::from(value).to_be_bytes().to_vec(), i32::from(value).to_le_bytes().to_vec()),
            "uint64" => (i64::from(value).to_be_bytes().to_vec(), i64::from(value).to_le_bytes().to_vec()),
            _ => (f32::from(value).to_be_bytes().to_vec(), f32::from(value).to_le_bytes().to_vec()),
        };
        bytes.extend(if big_endian { both.0 } else { both.1 });
    };
    [0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0].into_iter().for_each(|x| put("float", x));
    let (count, item) = list.split_once(' ').unwrap();
    if strip {
        header = header.replace("element face 2", "element tristrips 1");
        put(count, 8);
        [0, 1, 2, -1, 2, 1, 3, -1].into_iter().for_each(|index| put(item, index));
    } else {
        for face in [[0, 1, 2], [1, 3, 2]] {
            put(count, 3);
            face.into_iter().for_each(|index| put(item, index));
        }
    }
    [header.replace('\n', line_end).as_bytes(), &bytes].concat()
}

#[test]
fn ply_files_that_are_read_whole() {
    let same = ("ply", "ply");
    let as_is = ("3 0 1 2", "3 0 1 2");
    for (what, text) in [
        ("carriage returns", ply_text(same, as_is).replace('\n', "\r")),
        ("both line ends", ply_text(same, as_is).replace('\n', "\r\n")),
        ("a mark", ply_text(("ply", "\u{feff}ply"), as_is)),
        ("upper case", ply_text(same, as_is).to_uppercase()),
        ("blanks in the header", ply_text(("format ascii 1.0", "\nformat  ascii\t1.0  \n"), as_is)),
        ("blank lines", ply_text(same, ("3 0 1 2", "\n \n3 0 1 2\n"))),
        ("blank lines at the end", ply_text(same, ("3 1 3 2\n", "3 1 3 2\n\n\u{1a}"))),
        ("an element on two lines", ply_text(same, ("3 0 1 2", "3 0\n1 2"))),
        ("other versions", ply_text(("ascii 1.0", "ascii 1.1"), as_is)),
        ("whole numbers with fractions", ply_text(same, ("3 0 1 2", "3.0 0.0 1.0 2.0"))),
        ("indices of float", ply_text(("uchar int", "uchar float"), as_is)),
        (
            "normals of no numbers",
            ply_text(("element face", "property float nx\nelement face"), as_is)
                .replace("0 0 0\n1 0 0\n0 1 0\n1 1 0\n", "0 0 0 -nan(ind)\n1 0 0 1.#QNAN\n0 1 0 -\n1 1 0 inf\n"),
        ),
        ("comments without text", ply_text(("element face", "comment\nobj_info\nelement face"), as_is)),
        ("a camera", ply_text(("element face", "element camera 0\nproperty float fov\nelement face"), as_is)),
        (
            "a property twice",
            ply_text(("property list", "property uchar flags\nproperty uchar flags\nproperty list"), as_is)
                .replace("3 0 1 2", "7 7 3 0 1 2")
                .replace("3 1 3 2", "7 7 3 1 3 2"),
        ),
        (
            "a list before the indices",
            ply_text(("property list", "property list uchar float texcoord\nproperty list"), as_is)
                .replace("3 0 1 2", "2 0.5 0.5 3 0 1 2")
                .replace("3 1 3 2", "0 3 1 3 2"),
        ),
        ("strips", ply_text(("element face 2", "element tristrips 1"), ("3 0 1 2\n3 1 3 2", "8 0 1 2 -1 2 1 3 -1"))),
    ] {
        assert_whole("a.ply", what, text);
    }
    let latin_1 = [b"ply\nobj_info gr\xfc\xdfe\n", &ply_text(same, as_is).into_bytes()[4..]].concat();
    assert_whole("a.ply", "Latin-1", latin_1);
    for big_endian in [false, true] {
        for line_end in ["\n", "\r\n", "\r"] {
            for list in ["uchar int", "uint8 int16", "int uint", "ushort uint64", "char float", "uint64 uchar"] {
                assert_whole("a.ply", list, ply_bytes(big_endian, list, line_end, false));
            }
            assert_whole("a.ply", "binary strips", ply_bytes(big_endian, "int int", line_end, true));
        }
    }
}

#[test]
fn what_a_ply_reader_leaves_out_is_said() {
    let (same, as_is) = (("ply", "ply"), ("3 0 1 2", "3 0 1 2"));
    let edge =
        ply_text(("end_header", "element edge 2\nproperty int a\nproperty int b\nend_header"), as_is) + "0 1\n1 2\n";
    for (text, note) in [
        (edge, "element \"edge\" is not read (2 times, first at line 9)"),
        (ply_text(same, ("1 0 0", "1 0 0 7")), "numbers after those of an element are left out (line 11)"),
        (ply_text(same, as_is) + "\n3 0 1 2\n", "a line after the last element is left out (line 17)"),
        (
            ply_text(("element face", "author me\nelement face"), as_is),
            "\"author\" of the header is not known (line 7)",
        ),
        (
            ply_text(("vertex_indices", "corners"), as_is),
            "the list \"corners\" is taken for the vertex indices (line 7)",
        ),
        (
            ply_text(("element face 2", "element face 3"), ("3 0 1 2", "2 0 1\n3 0 1 2")),
            "a face of fewer than three corners is left out (line 14)",
        ),
    ] {
        assert_noted("a.ply", text, note);
    }
    let more = [ply_bytes(true, "uchar int", "\n", false), vec![10; 3]].concat();
    assert_noted("a.ply", more, "a byte after the last element is left out (3 times)");
}

#[test]
fn ply_files_that_no_guess_would_put_right() {
    let as_is = ("3 0 1 2", "3 0 1 2");
    for (text, parts) in [
        // Faces side by side: all but the first of a line would be lost.
        (ply_text(("ply", "ply"), ("3 0 1 2\n", "3 0 1 2 ")), ["truncated", "1 of 2 face elements"]),
        (ply_text(("list uchar", "list float"), as_is), ["line 8", "list float"]),
        (ply_text(("property float x", "property half x"), as_is), ["line 4", "property half x"]),
        (ply_text(("ascii", "utf-8"), as_is), ["line 2", "format utf-8"]),
        (
            ply_text(("element vertex", "property float w\nelement vertex"), as_is),
            ["line 3", "before the first element"],
        ),
    ] {
        assert_refused("a.ply", text, &parts);
    }
    for big_endian in [false, true] {
        assert_refused("a.ply", utf16(PLY_HEADER, big_endian), &["UTF-16"]);
    }
}

fn square() -> Vec<Triangle> {
    let [a, b, c, d] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
    vec![triangle(a, b, c), triangle(b, d, c)]
}

#[test]
fn stl_files_that_are_read_whole() {
    let text = stl_text(&square());
    for (what, text) in [
        ("carriage returns", text.replace('\n', "\r")),
        ("both line ends", text.replace('\n', "\r\n")),
        ("a mark", format!("\u{feff}{text}")),
        ("blank lines before", format!("\n  {text}")),
        ("upper case", text.to_uppercase()),
        ("first letters in upper case", text.replace("facet", "Facet").replace("vertex", "Vertex")),
        ("a name", text.replacen("solid\n", "solid facet normal of facets\n", 1)),
        ("solids one after another", text.replacen("endfacet\n", "endfacet\nendsolid a\nsolid b\n", 1)),
        ("an empty solid", format!("solid nothing\nendsolid nothing\n{text}")),
        (
            "ends in two words",
            text.replace("endsolid", "end solid").replace("endfacet", "end facet").replace("endloop", "end loop"),
        ),
        ("normals of no numbers", text.replace("normal 0 0 0", "normal nan -nan(ind) -1.#IND")),
        ("no normals", text.replace(" normal 0 0 0", "")),
        (
            "a facet on one line",
            text.replace('\n', " ").replacen("solid ", "solid\n", 1).replace("endsolid", "\nendsolid"),
        ),
        ("an end of DOS", format!("{text}\u{1a}")),
        ("zero bytes at the end", format!("{text}\0\0\0")),
        ("no first line", text.replacen("solid\n", "", 1)),
    ] {
        assert_whole("a.stl", what, text);
    }
    let latin_1 = [b"solid gr\xfc\xdfe\n", &text.as_bytes()[6..]].concat();
    assert_whole("a.stl", "Latin-1", latin_1);
    for header in [&b"solid"[..], b"SOLID made", b"\xff\xfe", b"COLOR=\x01\x02\x03\xff", b"ply\n", b"solid facet\n"] {
        assert_whole("a.stl", "binary", stl_binary(header, &square()));
    }
}

#[test]
fn what_an_stl_reader_leaves_out_is_said() {
    let text = stl_text(&square());
    for (bytes, note) in [
        (text.replace("endsolid\n", ""), "the file ends without \"endsolid\": it may be truncated (line 15)"),
        (text.replacen("facet", "color 1 0 0\nfacet", 1), "statement \"color\" is not known (line 2)"),
        (
            text.replacen("facet", "facet\nouter loop\nvertex 0 0 0\nvertex 1 1 1\nendloop\nendfacet\nfacet", 1),
            "a face of fewer than three corners is left out (line 6)",
        ),
        (
            text.replacen("facet", "facet\nendfacet\nfacet", 1),
            "a face of fewer than three corners is left out (line 3)",
        ),
    ] {
        assert_noted("a.stl", bytes, note);
    }
    for header in [&b"solid"[..], b"any", b""] {
        let more = [stl_binary(header, &square()), vec![0; 7]].concat();
        assert_noted(
            "a.stl",
            more,
            "a byte after the last facet of a binary file is left out (7 times, first at facet 2)",
        );
    }
}

#[test]
fn an_stl_loop_of_four_corners_is_a_polygon() {
    let text = "solid\nfacet\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n";
    assert_whole("a.stl", "four corners", text);
}

#[test]
fn stl_files_that_are_neither_binary_nor_text() {
    for big_endian in [false, true] {
        assert_refused("a.stl", utf16(&stl_text(&square()), big_endian), &["UTF-16"]);
    }
    assert_refused("a.stl", &stl_binary(b"solid", &square())[..183], &["facet 1", "binary", "2 facets", "1 are there"]);
}

#[test]
fn kinds_of_notes_are_limited() {
    let noise: String = (0..1000).map(|k| format!("word{k} 1\n")).collect();
    let scene = load_bytes("a.obj", obj("", ("f 1", "f 1"), &noise)).unwrap();
    assert_eq!(scene.notes.len(), 41);
    assert_eq!(scene.notes.iter().map(|note| note.count).sum::<u64>(), 1000);
    assert_eq!(said(&scene)[40], "other things that are not known (960 times, first at line 47)");
    let refused = load_with(&file("a.obj", obj("", ("f 1", "f 1"), &noise)).path, &STRICT).unwrap_err().to_string();
    assert!(refused.ends_with("; 37 more") && refused.len() < 400, "{refused}");
}

#[cfg(feature = "serde")]
#[test]
fn notes_are_in_a_report() {
    let scene = load_bytes("a.obj", obj("", ("f 1", "f 1"), "l 1 2\n")).unwrap();
    let json = serde_json::to_value(&scene.notes).unwrap();
    let want = serde_json::json!([{ "what": "statement \"l\" (lines) is not read", "first": "line 7", "count": 1 }]);
    assert_eq!(json, want);
}

#[test]
fn obj_statements_that_are_easily_lost_are_not() {
    assert_whole("a.obj", "fo in both cases", obj("", ("f 2 4 3", "Fo 2 4 3"), ""));
    assert_whole("a.obj", "a comment that touches a face", obj("", ("f 1 2 3", "f 1 2 3#x"), ""));
    for word in ["1.#QNAN", "-1.#IND00", "1.#INF"] {
        for axis in ["v 0 0 ", "v 0 ", "v "] {
            assert_refused("a.obj", obj("", ("v 0 0 0", &format!("{axis}{word} 0 0")), ""), &["line 1", word]);
        }
    }
    for statement in ["vn 0 0 1", "vt 0 0", "s 1", "lod 1", "l 1 2", "what 1"] {
        let text = obj("", ("f 2 4 3", &format!("{statement} \\\nf 2 4 3")), "");
        assert_refused("a.obj", text, &["line 6", "backslash", "\"f\""]);
    }
    assert_refused("a.obj", obj("", ("v 1 1 0", "v 1 1 0 \\\nv 5 5 5"), ""), &["line 4", "\"v\""]);
}

#[test]
fn ends_of_texts_and_of_strips() {
    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
    let [a, b, c, d] = corners;
    let stl = stl_text(&[triangle(a, b, c), triangle(b, d, c)]);
    for end in ["\0\u{1a}", "\u{1a}\0", "\u{1a}"] {
        assert_whole("a.stl", "marks at the end", stl.clone() + end);
    }
    let header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 0\nproperty uchar red\nelement tristrips 1\nproperty list int uint vertex_indices\nend_header\n";
    assert_whole("a.ply", "strips", format!("{header}0 0 0\n1 0 0\n0 1 0\n1 1 0\n7 0 1 2 4294967295 1 3 2\n"));
}
