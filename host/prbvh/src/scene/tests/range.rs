//! The promises of the safe range.

use super::*;
use proptest::prelude::*;

/// All finite float32, each exponent as likely as another.
fn coordinate() -> impl Strategy<Value = f32> {
    any::<u32>().prop_map(f32::from_bits).prop_filter("finite", |x| x.is_finite())
}

/// Magnitudes from 2^-60 to 2^60, and 0: scaled by 2^±60 they are still normal.
fn middling() -> impl Strategy<Value = f32> {
    let normal = (any::<bool>(), 67..187_u32, 0..1_u32 << 23)
        .prop_map(|(sign, exponent, fraction)| f32::from_bits(u32::from(sign) << 31 | exponent << 23 | fraction));
    prop_oneof![9 => normal, 1 => Just(0.0)]
}

fn triangles_of<S: Strategy<Value = f32>>(coordinate: fn() -> S) -> impl Strategy<Value = Vec<Triangle>> {
    let corner = move || prop::array::uniform3(coordinate());
    prop::collection::vec((corner(), corner(), corner()).prop_map(|(a, b, c)| triangle(a, b, c)), 1..20)
}

fn coordinates(triangles: &[Triangle]) -> &[f32] {
    bytemuck::cast_slice(triangles)
}

fn bits(triangles: &[Triangle]) -> &[u32] {
    bytemuck::cast_slice(triangles)
}

fn work(triangles: &[Triangle]) -> Vec<Triangle> {
    SafeRange::of(triangles).apply(triangles)
}

fn power(exponent: i32) -> f64 {
    2_f64.powi(exponent)
}

#[test]
fn the_extremes_come_into_range() {
    for x in [f32::from_bits(1), 1e-45, 1e-38, f32::MIN_POSITIVE, 1e-30, 0.75, 1.0, 1e30, f32::MAX] {
        let worked = f64::from(work(&[triangle([x, -x, 0.0], [0.0; 3], [0.0; 3])])[0].a[0]);
        assert!((power(54)..power(55)).contains(&worked), "{x:e} became {worked:e}");
    }
}

#[test]
fn zeros_stay_and_lose_their_sign() {
    let zeros = [triangle([0.0; 3], [-0.0; 3], [0.0; 3])];
    assert_eq!(SafeRange::of(&zeros), SafeRange { exponent: 0 });
    assert_eq!(bits(&work(&zeros)), [0; 9]);
    let mixed = [triangle([1.0, -0.0, -1e-40], [0.0; 3], [0.0; 3])];
    assert_eq!(bits(&work(&mixed))[1..], [0; 8]);
}

#[test]
fn rounding_starts_where_the_documentation_says() {
    let step = 1.0 + f32::EPSILON;
    let kept = (power(-93) as f32) * step;
    let rounded = (power(-94) as f32) * step;
    let worked = work(&[triangle([1.0, kept, rounded], [0.0; 3], [0.0; 3])])[0].a.map(f64::from);
    assert_eq!(worked[1], f64::from(kept) * power(54));
    assert_eq!(worked[2], power(-40));
}

proptest! {
    #[test]
    fn scaling_by_a_power_of_two_changes_nothing(
        triangles in triangles_of(middling),
        exponent in -60..60_i32,
    ) {
        let scale = |x: f32| (f64::from(x) * power(exponent)) as f32;
        prop_assert!(coordinates(&triangles).iter().all(|x| f64::from(scale(*x)) == f64::from(*x) * power(exponent)));
        let scaled: Vec<_> = triangles.iter().map(|t| triangle(t.a.map(scale), t.b.map(scale), t.c.map(scale))).collect();
        let (worked, scaled) = (work(&triangles), work(&scaled));
        prop_assert_eq!(bits(&worked), bits(&scaled));
    }

    #[test]
    fn values_are_finite_in_order_and_on_the_grid(triangles in triangles_of(coordinate)) {
        let worked = work(&triangles);
        let pairs: Vec<(f32, f32)> = coordinates(&triangles).iter().copied().zip(coordinates(&worked).iter().copied()).collect();
        let largest = pairs.iter().fold(0.0_f32, |m, (_, w)| m.max(w.abs()));
        prop_assert!(largest == 0.0 || (power(54)..power(55)).contains(&f64::from(largest)));
        for (x, w) in &pairs {
            prop_assert!(w.is_finite() && (*w == 0.0 || w.is_normal()));
            prop_assert_eq!((f64::from(*w) * power(62)).fract(), 0.0);
            for (y, v) in &pairs {
                prop_assert!(x > y || w <= v);
            }
        }
    }

    #[test]
    fn products_of_extents_are_normal_or_zero(triangles in triangles_of(coordinate)) {
        let worked = work(&triangles);
        let extents: Vec<f32> = worked.iter().map(Triangle::aabb).flat_map(|b| [0, 1, 2].map(|k| b.max[k] - b.min[k])).collect();
        for x in &extents {
            for y in &extents {
                let product = x * y;
                prop_assert!(product == 0.0 && (*x == 0.0 || *y == 0.0) || f64::from(product) >= power(-124));
            }
        }
        for side in extents.chunks(3) {
            let half_area = side[0] * side[1] + side[1] * side[2] + side[2] * side[0];
            prop_assert!(f64::from(half_area) < power(114));
        }
    }
}
