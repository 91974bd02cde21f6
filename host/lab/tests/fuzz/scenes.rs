//! Scenes of arbitrary triangles through the methods of the registry.

use super::targets::text_of;
use prbvh::bvh::{SahModel, quality, validate_tree};
use prbvh::device::Device;
use prbvh::device::cpu::CpuDevice;
use prbvh::pipeline::optimize;
use prbvh::scene::{Scene, SceneError};
use prbvh_kernel::setup::Triangle;
use prbvh_lab::stability::{Method, methods};
use proptest::prelude::*;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Most triangles.
const MOST: usize = 200;
/// Methods that a scene goes through.
const METHODS: usize = 3;

/// Triangles, and the first of the methods that they go through.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    triangles: Vec<Triangle>,
    method: prop::sample::Index,
}

/// Coordinates of one scene: all of a kind, so that most scenes of a kind that must be finite are.
fn coordinates() -> impl Strategy<Value = BoxedStrategy<f32>> {
    let finite = any::<u32>().prop_map(f32::from_bits).prop_map(|x| if x.is_finite() { x } else { 0.0 });
    let ends = prop::sample::select(vec![0.0, -0.0, 1.0, f32::MAX, f32::MIN, f32::MIN_POSITIVE, 1e-45, -1e-45, 1e30]);
    let powers = (-149..128i32, any::<bool>()).prop_map(|(k, minus)| 2f32.powi(k) * if minus { -1.0 } else { 1.0 });
    let jitter = (-3..4i32).prop_map(|ulps| f32::from_bits(1000f32.to_bits().wrapping_add_signed(ulps)));
    prop_oneof![
        1 => Just(any::<u32>().prop_map(f32::from_bits).boxed()),
        3 => Just(finite.boxed()),
        2 => Just(ends.boxed()),
        2 => Just(powers.boxed()),
        2 => Just(jitter.boxed()),
        2 => Just((-4..5i32).prop_map(|x| x as f32).boxed()),
        2 => Just((-1f32..1.0).boxed()),
        1 => any::<f32>().prop_map(|x| Just(if x.is_finite() { x } else { 7.0 }).boxed()),
    ]
}

/// What becomes of the corners of a triangle.
#[derive(Clone, Copy, Debug)]
enum Shape {
    Whole,
    Point,
    Edge,
    /// The same as the triangle before.
    Copy,
}

/// Scenes of up to [`MOST`] triangles.
pub(crate) fn case() -> impl Strategy<Value = Case> {
    let shape =
        prop::sample::select(vec![Shape::Whole, Shape::Whole, Shape::Whole, Shape::Point, Shape::Edge, Shape::Copy]);
    let triangles = coordinates().prop_flat_map(move |x| {
        prop::collection::vec((prop::array::uniform9(x), shape.clone()), 0..=MOST).prop_map(|raw| {
            let mut triangles: Vec<Triangle> = Vec::new();
            for ([ax, ay, az, bx, by, bz, cx, cy, cz], shape) in raw {
                let (a, b, c) = ([ax, ay, az], [bx, by, bz], [cx, cy, cz]);
                triangles.push(match shape {
                    Shape::Whole => Triangle { a, b, c },
                    Shape::Point => Triangle { a, b: a, c: a },
                    Shape::Edge => Triangle { a, b, c: a },
                    Shape::Copy => triangles.last().copied().unwrap_or(Triangle { a, b, c }),
                });
            }
            triangles
        })
    });
    (triangles, any::<prop::sample::Index>()).prop_map(|(triangles, method)| Case { triangles, method })
}

/// The screening refuses what it must and nothing else, and what it lets through makes valid trees.
pub(crate) fn check(case: &Case) -> Result<(), String> {
    let is_finite = |t: &Triangle| [t.a, t.b, t.c].as_flattened().iter().all(|x| x.is_finite());
    let first = case.triangles.iter().position(|triangle| !is_finite(triangle));
    let scene = match (Scene::from_triangles("fuzz", case.triangles.clone()), first) {
        (Ok(scene), None) if !case.triangles.is_empty() => scene,
        (Err(SceneError::NoTriangles { .. }), None) if case.triangles.is_empty() => return Ok(()),
        (Err(error @ SceneError::NotFinite { .. }), Some(at)) => {
            let named = error.to_string().starts_with(&format!("fuzz, triangle {at}: "));
            if !named {
                return Err(format!("triangle {at} is not finite, but {error}"));
            }
            match Scene::from_finite("fuzz", case.triangles.clone()) {
                Ok((scene, left_out)) if left_out.len() + scene.triangles.len() == case.triangles.len() => scene,
                Err(SceneError::NoTriangles { .. }) if !case.triangles.iter().any(is_finite) => return Ok(()),
                other => return Err(format!("from_finite: {other:?}")),
            }
        }
        (other, _) => return Err(format!("screening: {other:?}")),
    };
    let methods = methods();
    let start = case.method.index(methods.len());
    for k in 0..METHODS {
        let method = &methods[(start + 5 * k) % methods.len()];
        let run = catch_unwind(AssertUnwindSafe(|| try_method(&scene, method)));
        run.unwrap_or_else(|panic| Err(format!("panic: {}", text_of(&*panic))))
            .map_err(|fault| format!("{} over {} triangles: {fault}", method.name, scene.triangles.len()))?;
    }
    Ok(())
}

fn try_method(scene: &Scene, method: &Method) -> Result<(), String> {
    let mut device = CpuDevice::new(2).map_err(|error| error.to_string())?;
    let made = optimize(scene, &mut device, &method.settings, &mut |_| ControlFlow::Continue(()))
        .map_err(|error| error.to_string())?;
    validate_tree(&made.tree, &scene.triangles).map_err(|faults| format!("{faults:?}"))?;
    // A bound on the depth may cost something.
    let (before, after) = (made.initial.sah_cost, made.optimized_cost());
    if !(before.is_finite() && after.is_finite() && after <= before) {
        return Err(format!("cost {before}, then {after}"));
    }
    let measured = quality(&made.tree, &SahModel::default());
    if made.adaptive.is_none() && measured != made.quality {
        return Err(format!("quality {:?}, but measured {measured:?}", made.quality));
    }
    match device.memory().bytes {
        0 => Ok(()),
        left => Err(format!("{left} bytes are left on the device")),
    }
}
