//! The named cases.

use super::shapes;
use prbvh_kernel::setup::Triangle;

/// Triangles of a case unless it is about a number.
const USUAL: usize = 300;
/// Distance of the far room from the origin, along each axis.
const FAR: f64 = 524_288.0;

/// A scene to be stable on.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// Name, for `--cases`.
    pub name: &'static str,
    /// What can go wrong in it.
    pub purpose: &'static str,
    /// Half areas and their sums are exact in float32, so that even ties are the same when the axes change places.
    pub is_exact: bool,
    /// Rays traced through each of its trees.
    pub rays: usize,
    /// A point inside a closed surface: no ray that leaves what is seen from there gets out.
    pub inside: Option<[f32; 3]>,
    /// Triangles asked for, and with `full`.
    sizes: [usize; 2],
    parameter: f64,
    make: fn(usize, f64) -> Vec<Triangle>,
}

impl Case {
    /// Its triangles; `full` for the large size of those cases that have one. A few hold coordinates that are not finite.
    #[must_use]
    pub fn triangles(&self, full: bool) -> Vec<Triangle> {
        (self.make)(self.sizes[usize::from(full)], self.parameter)
    }
}

/// A case of the usual size.
const fn case(
    name: &'static str,
    purpose: &'static str,
    make: fn(usize, f64) -> Vec<Triangle>,
    parameter: f64,
) -> Case {
    Case { name, purpose, is_exact: false, rays: 0, inside: None, sizes: [USUAL; 2], parameter, make }
}

impl Case {
    const fn of(mut self, triangles: usize) -> Self {
        self.sizes = [triangles; 2];
        self
    }

    const fn or_full(mut self, triangles: usize) -> Self {
        self.sizes[1] = triangles;
        self
    }

    const fn exact(mut self) -> Self {
        self.is_exact = true;
        self
    }

    const fn with_rays(mut self, rays: usize) -> Self {
        self.rays = rays;
        self
    }

    const fn closed_around(mut self, inside: [f32; 3]) -> Self {
        self.inside = Some(inside);
        self
    }
}

/// All cases, in the order of the table.
pub const CATALOGUE: &[Case] = &[
    case("scale-1e-30", "areas of 1e-60 are 0 in float32", shapes::uniform, 1e-30),
    case("scale-1e-20", "areas of 1e-40 are denormal", shapes::uniform, 1e-20),
    case("scale-1e-10", "small, but harmless", shapes::uniform, 1e-10),
    case("scale-1", "the plain case", shapes::uniform, 1.0).of(1000),
    case("scale-1e10", "large, but harmless", shapes::uniform, 1e10),
    case("scale-1e20", "areas of 1e40 are infinite in float32", shapes::uniform, 1e20),
    case("scale-1e30", "areas of 1e60", shapes::uniform, 1e30),
    case("offset-1e6", "extents of 16 steps of float32: ties", shapes::offset, 1e6),
    case("offset-1e8", "the whole scene is less than a step of float32", shapes::offset, 1e8),
    case("huge-and-tiny-8", "8 decades: every tiny triangle in one Morton cell", shapes::huge_and_tiny, 1e8)
        .or_full(1_000_000),
    case("huge-and-tiny-16", "16 decades: areas 32 decades apart", shapes::huge_and_tiny, 1e16).or_full(1_000_000),
    case("chain-2^k", "every level of the tree in another binade, 2^-90 to 2^89", shapes::chain, -90.0).of(180),
    case("needles-1e8", "aspect 1e8, one short edge", shapes::needles, 1e8),
    case("slivers-1e8", "aspect 1e8, no short edge", shapes::slivers, 1e8),
    case("coplanar", "a tilted plane: boxes overlap, triangles do not", shapes::coplanar, 1000.0),
    case("collinear", "no triangle has an area, but boxes do", shapes::collinear, 1000.0),
    case("coincident", "all corners one point: the root has no area", shapes::coincident, 0.7),
    case("duplicates", "one triangle again and again: equal codes, no gain anywhere", shapes::duplicates, 1.0),
    case("ulp-jitter", "gains as small as rounding", shapes::ulp_jitter, 4.0),
    case("denormals", "coordinates that a device may flush to 0", shapes::uniform, 1e-40),
    case("denormals-beside-1", "half of the scene is below the resolution of the other", shapes::two_scales, 1e40),
    case("flat-1", "no extent along one axis", shapes::flat, 1.0),
    case("flat-2", "no extent along two axes: the root has no area", shapes::flat, 2.0),
    case("teapot-in-stadium", "all detail in one Morton cell", shapes::teapot_in_stadium, 1e4).of(1000),
    case("grid", "equal triangles on a lattice: exact ties", shapes::grid, 2.0).exact(),
    case("whole-numbers", "no half area is rounded: axes can change places bit for bit", shapes::whole, 64.0).exact(),
    case("soup", "everything overlaps", shapes::soup, 0.5).of(1000),
    case(
        "not-finite",
        "NaN and infinities among good triangles: refused, or left out and counted",
        shapes::not_finite,
        7.0,
    ),
    case("one", "a root that is a leaf", shapes::uniform, 1.0).of(1),
    case("two", "nothing can move", shapes::uniform, 1.0).of(2),
    case("three", "the parent of every input is at the root", shapes::uniform, 1.0).of(3),
    case("comb", "the best tree is a chain: deeper than stacks of 64", shapes::comb, 2.0).of(110).with_rays(64),
    case(
        "comb-morton",
        "every bit of the Morton codes is a level, then equal codes: an LBVH deeper than 64",
        shapes::morton_comb,
        63.0,
    )
    .with_rays(64),
    case("far-offset", "a room where float32 has 16 steps to a unit: new rays must not get out", shapes::room, FAR)
        .of(204)
        .exact()
        .with_rays(64)
        .closed_around([FAR as f32 + 0.5, FAR as f32 + 0.25, FAR as f32 + 0.5]),
    case("turned-45", "a hall whose walls lie along no axis: every box is mostly empty", shapes::turned_hall, 45.0)
        .of(1000)
        .with_rays(64),
    case("far-triangle", "a room and a triangle far away: no distance may follow from it", shapes::room_and_far, 1e6)
        .of(205)
        .with_rays(64)
        .closed_around([0.5, 0.25, 0.5]),
];

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn names_are_unique_and_fit_the_command_line() {
        let names: HashSet<&str> = CATALOGUE.iter().map(|case| case.name).collect();
        assert_eq!(names.len(), CATALOGUE.len());
        assert!(names.iter().all(|name| !name.contains([',', ' ']) && !name.is_empty()));
    }

    #[test]
    fn cases_have_the_size_they_say_and_are_the_same_again() {
        for case in CATALOGUE {
            let triangles = case.triangles(false);
            assert!(!triangles.is_empty() && triangles.len() <= case.sizes[0], "{}", case.name);
            assert!(triangles.len() * 10 >= case.sizes[0] * 7, "{}: {}", case.name, triangles.len());
            let bytes = |triangles: &[Triangle]| bytemuck::cast_slice::<_, u8>(triangles).to_vec();
            assert_eq!(bytes(&case.triangles(false)), bytes(&triangles), "{}", case.name);
        }
        let full = CATALOGUE.iter().find(|case| case.name == "huge-and-tiny-16").unwrap();
        assert_eq!(full.triangles(true).len(), 1_000_000);
    }
}
