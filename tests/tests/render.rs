//! Pictures: the same bits for every tree, on every device.

use prbvh::build::{MortonBits, lbvh};
use prbvh::bvh::{Bvh, ROOT};
use prbvh::device::cpu::CpuDevice;
use prbvh::pipeline::{Settings, optimize};
use prbvh::scene::{SafeRange, Scene, built_in};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;
use prbvh_kernel::trace::path::pixel;
use prbvh_lab::render::{
    Camera, RenderError, RenderSettings, Rendering, clear_view, heat_map, render, shaded, write_png,
};
use prbvh_tests::devices::with_devices;
use prbvh_tests::oracle::random_tree;
use std::collections::BTreeSet;
use std::ops::ControlFlow;

const SMALL: RenderSettings = RenderSettings { width: 37, height: 21, samples: 2, bounces: 2, light_samples: 2 };

/// LBVH, optimised with adaptive leaves, and random.
fn trees(scene: &Scene) -> [Bvh; 3] {
    let mut device = CpuDevice::new(2).unwrap();
    let working = SafeRange::of(&scene.triangles).apply(&scene.triangles);
    let (tree, _) = lbvh(&mut device, &working, MortonBits::Sixty).unwrap();
    let first = Bvh::from_device(&tree.download(&mut device).unwrap()).unwrap().with_boxes_of(&scene.triangles);
    let settings = Settings::default().with(|s| s.adaptive = Some(Default::default()));
    let best = optimize(scene, &mut device, &settings, &mut |_| ControlFlow::Continue(())).unwrap().tree;
    let boxes: Vec<Aabb> = scene.triangles.iter().map(Triangle::aabb).collect();
    [first, best, Bvh::from_device(&random_tree(&boxes, 3).encode()).unwrap()]
}

fn bits(rendering: &Rendering) -> Vec<u32> {
    rendering.radiance.iter().flatten().map(|x| x.to_bits()).collect()
}

#[test]
fn the_picture_is_that_of_the_scene() {
    let scene = built_in(2000);
    let [first, best, random] = trees(&scene);
    let bounds = first.nodes[ROOT as usize].aabb;
    for view in 0..Camera::VIEWS {
        let camera = Camera::view(view, &bounds, 1).unwrap();
        let mut expected: Option<Vec<u32>> = None;
        let mut per_ray = Vec::new();
        for tree in [&first, &best, &random] {
            let mut tests: Option<Vec<f32>> = None;
            with_devices(|devices| {
                for (name, device) in devices {
                    let before = device.memory().bytes;
                    let picture = render(&mut **device, &scene, tree, &camera, &SMALL).unwrap();
                    assert_eq!(device.memory().bytes, before);
                    assert_eq!(picture.primary.rays, 37 * 21 * 2);
                    assert_eq!(picture.secondary.rays > 0, picture.primary.hits > 0);
                    let [rays, parts] =
                        [picture.overall.rays, picture.primary.rays + picture.shadow.rays + picture.secondary.rays];
                    assert_eq!(rays, parts);
                    let new = bits(&picture);
                    assert!(*expected.get_or_insert_with(|| new.clone()) == new, "view {view}, {name}");
                    let new = picture.tests.clone();
                    assert!(*tests.get_or_insert_with(|| new.clone()) == new, "view {view}, {name}: tests");
                    if name.contains("Ascending") {
                        per_ray.push(picture.overall.box_tests_per_ray);
                        let mean = picture.tests.iter().map(|&x| f64::from(x)).sum::<f64>() / f64::from(37 * 21);
                        let both = picture.primary.box_tests_per_ray + picture.primary.triangle_tests_per_ray;
                        assert!((mean / both - 1.0).abs() < 1e-5, "{mean} tests per pixel, {both} per ray");
                    }
                }
            });
        }
        let [first, best, random] = per_ray[..] else { panic!("{per_ray:?}") };
        assert!(best < first && first < random, "view {view}: box tests per ray {per_ray:?}");
        let expected = expected.expect("there is always the CPU");
        let colours: BTreeSet<u32> = expected.iter().copied().collect();
        assert!(colours.len() > 100, "view {view}: {} values", colours.len());
        assert!(expected.iter().all(|&x| f32::from_bits(x).is_finite() && f32::from_bits(x) >= 0.0));
    }
}

#[test]
fn every_pixel_has_one_path() {
    for (width, height) in [(1u32, 1u32), (8, 8), (9, 7), (37, 21)] {
        let count = width.div_ceil(8) * height.div_ceil(8) * 64;
        let all: BTreeSet<[u32; 2]> =
            (0..count).map(|k| pixel(k, width)).filter(|&[x, y]| x < width && y < height).collect();
        assert_eq!(all.len() as u32, width * height);
    }
}

/// A square of side 2 in the plane z = 0 around the origin.
fn square() -> Scene {
    let corner = |x: f32, y: f32| [x, y, 0.0];
    let lower = Triangle { a: corner(-1.0, -1.0), b: corner(1.0, -1.0), c: corner(1.0, 1.0) };
    let upper = Triangle { a: corner(-1.0, -1.0), b: corner(1.0, 1.0), c: corner(-1.0, 1.0) };
    Scene::from_triangles("square", vec![lower, upper]).unwrap()
}

#[test]
fn a_square_covers_the_pixels_that_it_should() {
    let scene = square();
    let [tree, ..] = trees(&scene);
    let mut device = CpuDevice::new(2).unwrap();
    // Half the picture's width and half its height: the square ends between pixels.
    let camera = Camera { eye: [0.0, 0.0, 2.0], look_at: [0.0; 3], up: [0.0, 1.0, 0.0], fov_degrees: 90.0 };
    let settings = RenderSettings { width: 16, height: 16, samples: 1, bounces: 0, light_samples: 1 };
    let picture = render(&mut device, &scene, &tree, &camera, &settings).unwrap();
    assert_eq!((picture.primary.rays, picture.primary.hits, picture.secondary.rays), (256, 64, 0));
    // The eye sees the picture upright: the sky is brighter above than below, and bluish.
    let [top, bottom] = [picture.radiance[0], picture.radiance[15 * 16]];
    assert!(top[2] > top[0] && top[0] > bottom[0], "{top:?} {bottom:?}");
}

#[test]
fn nothing_in_view_and_an_eye_in_a_box_are_pictures_too() {
    let scene = square();
    let [tree, ..] = trees(&scene);
    let mut device = CpuDevice::new(2).unwrap();
    let away = Camera { eye: [0.0, 0.0, 2.0], look_at: [0.0, 0.0, 9.0], up: [0.0, 1.0, 0.0], fov_degrees: 60.0 };
    let picture = render(&mut device, &scene, &tree, &away, &SMALL).unwrap();
    assert_eq!((picture.primary.hits, picture.shadow.rays, picture.secondary.rays), (0, 0, 0));
    assert!(picture.radiance.iter().all(|c| c.iter().all(|&x| x > 0.0)), "the sky is there");

    let scene = built_in(2000);
    let [tree, ..] = trees(&scene);
    let bounds = tree.nodes[ROOT as usize].aabb;
    let middle = [0, 1, 2].map(|k| 0.5 * (bounds.min[k] + bounds.max[k]));
    let inside = Camera { eye: middle, look_at: bounds.max, up: [0.0, 1.0, 0.0], fov_degrees: 90.0 };
    let picture = render(&mut device, &scene, &tree, &inside, &SMALL).unwrap();
    assert_eq!(picture.primary.hits, picture.primary.rays, "the hall is closed");
    // From far away, and straight down along the upward axis.
    let above = Camera { eye: [middle[0], 1e6, middle[2]], look_at: middle, fov_degrees: 0.001, ..inside };
    assert!(render(&mut device, &scene, &tree, &above, &SMALL).unwrap().primary.hits > 0);
}

/// Two triangles over four corners.
fn quad(corners: [[f32; 3]; 4]) -> [Triangle; 2] {
    let [a, b, c, d] = corners;
    [Triangle { a, b, c }, Triangle { a, b: c, c: d }]
}

#[test]
fn a_view_from_inside_faces_no_wall() {
    // The sides of a room from (0,0,0) to (10,3,4), and a wall before the usual eye, which looks along x.
    let across = |x: f32| quad([[x, 0.0, 0.0], [x, 3.0, 0.0], [x, 3.0, 4.0], [x, 0.0, 4.0]]);
    let level = |y: f32| quad([[0.0, y, 0.0], [10.0, y, 0.0], [10.0, y, 4.0], [0.0, y, 4.0]]);
    let along = |z: f32| quad([[0.0, 0.0, z], [10.0, 0.0, z], [10.0, 3.0, z], [0.0, 3.0, z]]);
    let room = [across(0.0), across(10.0), level(0.0), level(3.0), along(0.0), along(4.0)].concat();
    let walled = Scene::from_triangles("walled", [&room[..], &across(2.3)].concat()).unwrap();
    let trees = trees(&walled);
    let usual = Camera::view(1, &trees[0].nodes[ROOT as usize].aabb, 1).unwrap();
    assert!(usual.eye[0] < 2.3 && usual.look_at[0] > 2.3);
    with_devices(|devices| {
        let mut first = None;
        for (name, device) in devices {
            for tree in &trees {
                let before = device.memory().bytes;
                let camera = clear_view(1, &mut **device, &walled, tree, 1).unwrap();
                assert_eq!(device.memory().bytes, before, "{name}");
                assert_eq!(*first.get_or_insert(camera), camera, "{name}");
            }
        }
        let Camera { eye, look_at, .. } = first.expect("there is always the CPU");
        assert!(eye[0] > 2.3 && (eye[0] - look_at[0]).abs() > 5.0, "{eye:?} to {look_at:?}");
    });
    // From outside there is one view.
    let mut device = CpuDevice::new(1).unwrap();
    let outside = clear_view(0, &mut device, &walled, &trees[0], 1).unwrap();
    assert_eq!(outside, Camera::view(0, &trees[0].nodes[ROOT as usize].aabb, 1).unwrap());
}

/// The faces of a box.
fn faces(low: [f32; 3], high: [f32; 3]) -> Vec<Triangle> {
    let face = |axis: usize, at: f32| {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        quad([(low[u], low[v]), (high[u], low[v]), (high[u], high[v]), (low[u], high[v])].map(|(x, y)| {
            let mut p = [at; 3];
            (p[u], p[v]) = (x, y);
            p
        }))
    };
    (0..3).flat_map(|axis| [face(axis, low[axis]), face(axis, high[axis])].concat()).collect()
}

fn lbvh_of(scene: &Scene) -> Bvh {
    let mut device = CpuDevice::new(2).unwrap();
    let working = SafeRange::of(&scene.triangles).apply(&scene.triangles);
    let (tree, _) = lbvh(&mut device, &working, MortonBits::Sixty).unwrap();
    Bvh::from_device(&tree.download(&mut device).unwrap()).unwrap().with_boxes_of(&scene.triangles)
}

#[test]
fn rays_leave_a_wall_whatever_else_is_in_the_scene() {
    let settings = RenderSettings { width: 97, height: 65, samples: 1, bounces: 3, light_samples: 1 };
    let away = |far: f32| vec![Triangle { a: [far, 0.0, 0.0], b: [1.5 * far, 0.0, 0.0], c: [far, 1.0, 0.0] }];
    // So fine that the scene cannot be moved towards the origin: coordinates in the room are multiples of 1/32.
    let fine = vec![Triangle { a: [1e-7; 3], b: [2e-7; 3], c: [1e-7, 2e-7, 0.0] }];
    let cases = [(0.0, Vec::new()), (0.0, away(1e3)), (0.0, away(1e6)), (0.0, away(1e9)), (524_288.0, fine)];
    for (offset, more) in cases {
        let moved = |p: [f32; 3]| p.map(|x| x + offset);
        let mut triangles = faces(moved([-4.0, -2.0, -4.0]), moved([4.0, 2.0, 4.0]));
        triangles.extend(&more);
        let [eye, look_at] = [moved([0.5, 0.25, 0.5]), moved([3.0, 0.25, 1.0])];
        let camera = Camera { eye, look_at, up: [0.0, 1.0, 0.0], fov_degrees: 75.0 };
        let scene = Scene::from_triangles("room", triangles).unwrap();
        let tree = lbvh_of(&scene);
        with_devices(|devices| {
            let mut first = None;
            for (name, device) in devices {
                let picture = render(&mut **device, &scene, &tree, &camera, &settings).unwrap();
                let all = 97 * 65;
                let what = format!("{more:?}, {name}");
                assert_eq!((picture.primary.hits, picture.secondary.rays), (all, 3 * all), "{what}");
                assert_eq!(picture.secondary.hits, 3 * all, "{what}");
                // Nothing stands in the light of a room alone.
                assert!(picture.shadow.rays > 0 && (!more.is_empty() || picture.shadow.hits == 0), "{what}");
                let new = bits(&picture);
                assert!(*first.get_or_insert_with(|| new.clone()) == new, "{what}");
            }
        });
    }
}

/// Numbers of rays and of those that hit.
fn numbers(picture: &Rendering) -> [[u64; 2]; 3] {
    [&picture.primary, &picture.shadow, &picture.secondary].map(|cost| [cost.rays, cost.hits])
}

#[test]
fn a_scene_that_is_moved_keeps_its_picture() {
    let ground = quad([[-100.0, 0.0, -100.0], [100.0, 0.0, -100.0], [100.0, 0.0, 100.0], [-100.0, 0.0, 100.0]]);
    let scene = [&faces([-5.0, 0.0, -5.0], [5.0, 10.0, 5.0])[..], &ground].concat();
    let eye = [20.0, 15.0, 30.0];
    let settings = RenderSettings { width: 64, height: 48, samples: 2, bounces: 2, light_samples: 2 };
    let mut device = CpuDevice::new(2).unwrap();
    let mut picture = |offset: [f32; 3]| {
        let moved = |p: [f32; 3]| [0, 1, 2].map(|k| p[k] + offset[k]);
        let triangles = scene.iter().map(|t| Triangle { a: moved(t.a), b: moved(t.b), c: moved(t.c) }).collect();
        let scene = Scene::from_triangles("cube", triangles).unwrap();
        let look_at = moved([0.0, 3.0, 0.0]);
        let camera = Camera { eye: moved(eye), look_at, up: [0.0, 1.0, 0.0], fov_degrees: 60.0 };
        render(&mut device, &scene, &lbvh_of(&scene), &camera, &settings).unwrap()
    };
    let first = picture([0.0; 3]);
    let [_, [shadows, dark], _] = numbers(&first);
    assert!(dark > 50 && dark < shadows / 2, "{dark} of {shadows} shadow rays hit something");
    for offset in
        [[65_536.0; 3], [131_072.0; 3], [524_288.0, 0.0, -524_288.0], [-524_288.0; 3], [1e3, 0.0, 1_048_576.0]]
    {
        let there = picture(offset);
        assert_eq!(numbers(&there), numbers(&first), "{offset:?}");
        assert!(bits(&there) == bits(&first), "{offset:?}");
    }
}

#[test]
fn settings_out_of_range_are_refused() {
    let scene = square();
    let [tree, ..] = trees(&scene);
    let mut device = CpuDevice::new(1).unwrap();
    let good = Camera { eye: [0.0, 0.0, 2.0], look_at: [0.0; 3], up: [0.0, 1.0, 0.0], fov_degrees: 60.0 };
    let mut refused = |camera: Camera, settings: RenderSettings| {
        let error = render(&mut device, &scene, &tree, &camera, &settings).unwrap_err();
        assert!(matches!(error, RenderError::Setting { .. }), "{error}");
    };
    refused(good, RenderSettings { width: 0, ..SMALL });
    refused(good, RenderSettings { height: 20_000, ..SMALL });
    refused(good, RenderSettings { samples: 0, ..SMALL });
    refused(good, RenderSettings { bounces: 65, ..SMALL });
    refused(good, RenderSettings { light_samples: 0, ..SMALL });
    refused(Camera { look_at: good.eye, ..good }, SMALL);
    refused(Camera { eye: [f32::NAN; 3], ..good }, SMALL);
    refused(Camera { fov_degrees: 180.0, ..good }, SMALL);
    refused(Camera { fov_degrees: f32::NAN, ..good }, SMALL);
    let bounds = tree.nodes[ROOT as usize].aabb;
    assert!(Camera::view(Camera::VIEWS, &bounds, 1).is_err() && Camera::view(0, &bounds, 3).is_err());
    assert_eq!(prbvh::device::Device::memory(&device).bytes, 0);
}

#[test]
fn pictures_are_png_files() {
    let scene = built_in(1000);
    let [tree, ..] = trees(&scene);
    let mut device = CpuDevice::new(2).unwrap();
    let camera = Camera::view(1, &tree.nodes[ROOT as usize].aabb, 1).unwrap();
    let picture = render(&mut device, &scene, &tree, &camera, &SMALL).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let (heat, scale) = heat_map(&picture);
    assert!(scale.most > 1.0);
    for (name, pixels) in [("shaded.png", shaded(&picture)), ("heat.png", heat)] {
        assert!(pixels.iter().collect::<BTreeSet<_>>().len() > 20, "{name} shows something");
        let path = folder.path().join(name);
        write_png(&path, picture.width, picture.height, &pixels).unwrap();
        let file = std::io::BufReader::new(std::fs::File::open(&path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut read = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut read).unwrap();
        assert_eq!((reader.info().width, reader.info().height), (37, 21));
        assert!(read == pixels, "{name}");
    }
}
