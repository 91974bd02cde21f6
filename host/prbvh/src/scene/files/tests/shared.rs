//! The real scenes, where they are: in the folder `PRBVH_SCENES`, else beside the project in `shared/scenes`.

use super::*;

const SMALL: [(&str, usize, usize); 7] = [
    ("suzanne", 968, 0),
    ("teapot", 6_320, 0),
    ("sponza_dabrovic", 66_450, 0),
    ("bunny", 69_451, 0),
    ("sibenik", 75_284, 9),
    ("happy_buddha_100k", 100_000, 0),
    ("living_room", 143_163, 190),
];
const LARGE: [(&str, usize, usize); 4] = [
    ("sponza_crytek", 262_205, 1),
    ("conference", 331_179, 53_627),
    ("kitchen", 1_443_517, 219),
    ("hair_mohawk", 1_657_632, 0),
];
/// Scenes whose stated zero-area count is over their three-sided faces alone.
const OF_POLYGONS: [&str; 2] = ["suzanne", "sponza_dabrovic"];

fn check(scenes: &[(&str, usize, usize)]) {
    let folder = match std::env::var_os("PRBVH_SCENES") {
        Some(folder) => PathBuf::from(folder),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes"),
    };
    for (name, triangles, zero_area) in scenes {
        let path = folder.join(format!("{name}.obj.xz"));
        if !path.exists() {
            eprintln!("not run: {} is not there", path.display());
            continue;
        }
        let start = std::time::Instant::now();
        let scene = load(&path).unwrap();
        println!("{name}: {:.0?}, {:?}, {}", start.elapsed(), scene.census, scene.hash);
        assert_eq!(scene.triangles.len(), *triangles, "{name}");
        if !OF_POLYGONS.contains(name) {
            assert_eq!(scene.census.zero_area, *zero_area, "{name}");
        }
    }
}

#[test]
fn real_scenes_have_their_triangles() {
    check(&SMALL);
}

#[test]
#[ignore = "takes many seconds without optimisation"]
fn large_real_scenes_have_their_triangles() {
    check(&LARGE);
}
