//! The tests of a ray against a box and a triangle, and the arithmetic below them.

use prbvh::trace::{Ray, TraceRange};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::math::{difference_of_products, product_error, reciprocal, reciprocal_sqrt};
use prbvh_kernel::ray::{Interval, Prepared};
use prbvh_kernel::setup::Triangle;
use prbvh_tests::fixtures::{Random, soup};
use prbvh_tests::rays::{STARTS, rays};

/// Möller & Trumbore 1997 in f64: parameter, and the smallest of the three barycentric coordinates.
fn reference(ray: &Ray, t: &Triangle) -> Option<(f64, f64)> {
    let minus = |a: [f32; 3], b: [f32; 3]| [0, 1, 2].map(|k| f64::from(a[k]) - f64::from(b[k]));
    let cross =
        |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3]);
    let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
    let (e1, e2) = (minus(t.b, t.a), minus(t.c, t.a));
    let d = ray.direction.map(f64::from);
    let p = cross(d, e2);
    let determinant = dot(e1, p);
    if determinant.abs() < 1e-4 * dot(e1, e1).sqrt() * dot(e2, e2).sqrt() {
        return None;
    }
    let s = minus(ray.origin, t.a);
    let u = dot(s, p) / determinant;
    let q = cross(s, e1);
    let v = dot(d, q) / determinant;
    Some((dot(e2, q) / determinant, u.min(v).min(1.0 - u - v)))
}

#[test]
fn the_triangle_test_agrees_with_f64() {
    let triangles = soup(300, 0.5, 13);
    let range = TraceRange::of(&triangles, &STARTS);
    let working = range.triangles(&triangles);
    let (mut inside, mut outside) = (0, 0);
    for (k, ray) in rays(&triangles, 2000, 14).iter().enumerate() {
        let ray = Ray { t_min: 0.0, t_max: f32::INFINITY, ..*ray };
        let ray = range.ray(k, &ray).unwrap();
        let prepared = Prepared::new(&ray);
        for t in &working {
            let Some((along, margin)) = reference(&ray, t) else { continue };
            let found = prepared.hits([t.a, t.b, t.c], ray.t_max);
            let largest = f64::from(1u32 << 30);
            if margin > 1e-3 && along > 1e-5 * largest {
                assert!((f64::from(found) - along).abs() < 1e-4 * largest, "{found} is not {along}");
                inside += 1;
            } else if margin < -1e-3 || along < -1e-5 * largest {
                assert!(found.is_infinite(), "a hit outside, margin {margin}, at {along}");
                outside += 1;
            }
        }
    }
    assert!(inside > 3_000 && outside > 100_000, "{inside} inside, {outside} outside");
}

#[test]
fn a_box_inside_another_has_the_smaller_interval() {
    let mut random = Random(15);
    for _ in 0..200_000 {
        let scale = (1u64 << (random.bits() % 32)) as f32;
        let mut coordinates = [0; 4].map(|_| random.point(2.0 * scale).map(|x| x - scale));
        for k in 0..3 {
            let mut sorted = coordinates.map(|p| p[k]);
            sorted.sort_by(f32::total_cmp);
            // Now and then a face in common, or a flat box.
            if random.bits().is_multiple_of(4) {
                sorted[1] = sorted[0];
            }
            if random.bits().is_multiple_of(4) {
                sorted[2] = sorted[1];
            }
            (0..4).for_each(|j| coordinates[j][k] = sorted[j]);
        }
        let origin = random.point(4.0 * scale).map(|x| x - 2.0 * scale);
        let mut direction = random.point(2.0).map(|x| x - 1.0);
        if random.bits().is_multiple_of(4) {
            direction[(random.bits() % 3) as usize] = 0.0;
        }
        let ray = Prepared::new(&Ray::snapped(origin, direction, f32::MAX));
        let outer: Interval = ray.in_box(&Aabb { min: coordinates[0], max: coordinates[3] });
        let inner = ray.in_box(&Aabb { min: coordinates[1], max: coordinates[2] });
        if inner.far > 0.0 {
            assert!(outer.near <= inner.near && outer.far >= inner.far, "{outer:?} {inner:?}");
        }
    }
}

#[test]
fn reciprocals_are_exact_to_the_last_places() {
    let mut random = Random(16);
    for _ in 0..300_000 {
        let x = f32::from_bits((random.bits() as u32 & 0x007f_ffff) | ((10 + random.bits() as u32 % 235) << 23));
        let error = (f64::from(reciprocal(x)) * f64::from(x) - 1.0).abs();
        assert!(error < 3.0 * 2f64.powi(-24), "1 / {x:e}: {error:e}");
        assert_eq!(reciprocal(-x), -reciprocal(x));
        if (1e-30..1e30).contains(&x) {
            let error = (f64::from(reciprocal_sqrt(x)).powi(2) * f64::from(x) - 1.0).abs();
            assert!(error < 8.0 * 2f64.powi(-24), "1 / sqrt {x:e}: {error:e}");
        }
    }
}

/// A float32 that a sheared corner may be: from 2^-49 to 2^34, of either sign.
fn sheared(random: &mut Random) -> f32 {
    let exponent = 127 - 25 + (random.bits() % 59) as u32;
    f32::from_bits((random.bits() as u32 & 0x807f_ffff) | (exponent << 23))
}

#[test]
fn products_lose_nothing() {
    let mut random = Random(17);
    for _ in 0..300_000 {
        let (a, b) = (sheared(&mut random), sheared(&mut random));
        let p = a * b;
        // Exact in float64: 48 digits.
        assert_eq!(f64::from(product_error(a, b, p)), f64::from(a) * f64::from(b) - f64::from(p), "{a:e} {b:e}");
    }
}

#[test]
fn differences_of_products_have_their_sign() {
    let mut random = Random(18);
    let (mut zeros, mut saved) = (0, 0);
    for k in 0..600_000 {
        let (a, b) = (sheared(&mut random), sheared(&mut random));
        // Near the same product: both factors off by a few units in the last place, or halves and doubles.
        let mut near = |x: f32| f32::from_bits(x.to_bits() + (random.bits() % 5) as u32 - 2);
        let [c, d] = match k % 3 {
            0 => [near(a), near(b)],
            1 => [near(b), near(a)],
            _ => [near(2.0 * a), near(0.5 * b)],
        };
        let exact = f64::from(a) * f64::from(b) - f64::from(c) * f64::from(d);
        let found = difference_of_products(a, b, c, d);
        assert_eq!(found > 0.0, exact > 0.0, "{a:e} {b:e} {c:e} {d:e}: {found:e}, not {exact:e}");
        assert_eq!(found < 0.0, exact < 0.0, "{a:e} {b:e} {c:e} {d:e}: {found:e}, not {exact:e}");
        let error = (f64::from(found) - exact).abs();
        assert!(error <= 3.0 * 2f64.powi(-24) * exact.abs(), "{found:e}, not {exact:e}");
        assert_eq!(difference_of_products(d, c, b, a), -found);
        // What the rounded products alone say is never wrong, but may be nothing.
        let rounded = a * b - c * d;
        assert!(f64::from(rounded) * exact >= 0.0);
        zeros += usize::from(exact == 0.0);
        saved += usize::from(rounded == 0.0 && exact != 0.0);
    }
    assert!(zeros > 1000 && saved > 1000, "{zeros} {saved}");
}
