//! Rays that know no camera: from a point in the scene's box towards another, which is what the surface area heuristic assumes of rays,
//! save that they start inside.

use prbvh::trace::Ray;
use prbvh_kernel::aabb::Aabb;

/// `count` rays through `bounds`, the same ones every time.
pub(crate) fn through(bounds: &Aabb, count: usize) -> Vec<Ray> {
    let mut state = 0x9e37_79b9_7f4a_7c15u64;
    let mut unit = move || {
        // SplitMix64.
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
    };
    let mut point = || {
        let part = [unit(), unit(), unit()];
        std::array::from_fn::<f32, 3, _>(|k| bounds.min[k] + part[k] * (bounds.max[k] - bounds.min[k]))
    };
    let mut rays = Vec::with_capacity(count);
    while rays.len() < count {
        let (origin, towards) = (point(), point());
        let direction: [f32; 3] = std::array::from_fn(|k| towards[k] - origin[k]);
        if direction != [0.0; 3] {
            rays.push(Ray { origin, t_min: 0.0, direction, t_max: f32::MAX });
        }
    }
    rays
}
