//! No bytes make the loader panic: small files of each format, damaged.

use super::*;
use proptest::prelude::*;

#[derive(Clone, Debug)]
enum Damage {
    Cut(usize),
    Flip(usize, u8),
    Insert(usize, Vec<u8>),
    Remove(usize, usize),
    Repeat(usize, usize),
}

fn damage() -> impl Strategy<Value = Damage> {
    let piece = prop_oneof![
        prop::collection::vec(any::<u8>(), 1..9),
        prop::sample::select(vec![
            "-1",
            "0",
            "9999999999",
            "1e39",
            "nan",
            " ",
            "\n",
            "\\\n",
            "/",
            "f 1",
            "[",
            "{}",
            "18446744073709551615"
        ])
        .prop_map(|text| text.as_bytes().to_vec()),
    ];
    prop_oneof![
        any::<usize>().prop_map(Damage::Cut),
        (any::<usize>(), 1..=255_u8).prop_map(|(at, mask)| Damage::Flip(at, mask)),
        (any::<usize>(), piece).prop_map(|(at, bytes)| Damage::Insert(at, bytes)),
        (any::<usize>(), 1..9_usize).prop_map(|(at, count)| Damage::Remove(at, count)),
        (any::<usize>(), 1..40_usize).prop_map(|(at, count)| Damage::Repeat(at, count)),
    ]
}

fn apply(bytes: &mut Vec<u8>, damage: &Damage) {
    let at = |at: &usize| at % bytes.len().max(1);
    match damage {
        Damage::Cut(end) => bytes.truncate(at(end)),
        Damage::Flip(place, mask) => {
            let place = at(place);
            bytes.get_mut(place).into_iter().for_each(|byte| *byte ^= mask);
        }
        Damage::Insert(place, piece) => {
            let place = at(place);
            bytes.splice(place..place, piece.iter().copied());
        }
        Damage::Remove(place, count) => {
            let (start, end) = (at(place), (at(place) + count).min(bytes.len()));
            bytes.drain(start..end);
        }
        Damage::Repeat(place, count) => {
            let (start, end) = (at(place), (at(place) + count).min(bytes.len()));
            let piece = bytes[start..end].to_vec();
            bytes.splice(start..start, piece);
        }
    }
}

fn samples() -> Vec<(&'static str, Vec<u8>)> {
    let text = stl_text(&fan());
    let mut samples = vec![
        ("a.obj", OBJ.into()),
        ("a.ply", PLY.into()),
        ("a.ply", ply_binary(false)),
        ("a.ply", ply_binary(true)),
        ("a.stl", text.into_bytes()),
        ("a.stl", stl_binary(b"", &fan())),
        ("a.obj.gz", gzip(OBJ.as_bytes())),
        ("a.obj.xz", xz(OBJ.as_bytes())),
        ("a.obj.zst", zstd(OBJ.as_bytes())),
    ];
    samples.extend(gltf_files::samples());
    samples
}

proptest! {
    #[test]
    fn damaged_files_never_panic(pick in any::<prop::sample::Index>(), damages in prop::collection::vec(damage(), 1..5)) {
        let samples = samples();
        let (name, mut bytes) = pick.get(&samples).clone();
        for damage in &damages {
            apply(&mut bytes, damage);
        }
        match load_bytes(name, &bytes) {
            Ok(scene) => prop_assert!(!scene.triangles.is_empty() && Scene::from_triangles("again", scene.triangles).is_ok()),
            Err(fault) => prop_assert!(fault.to_string().contains(name)),
        }
    }

    #[test]
    fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 1..400)) {
        for name in ["a.obj", "a.ply", "a.stl", "a.gltf", "a.glb", "a.obj.gz", "a.obj.xz", "a.obj.zst"] {
            if let Ok(scene) = load_bytes(name, &bytes) {
                prop_assert!(!scene.triangles.is_empty());
            }
        }
    }
}

#[test]
fn undamaged_samples_load() {
    for (name, bytes) in samples() {
        let scene = load_bytes(name, bytes);
        assert!(scene.is_ok(), "{name}: {scene:?}");
    }
}
