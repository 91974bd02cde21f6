//! A ray against boxes whose faces are whole numbers of steps from a corner.
//!
//! Source: Ylitie, Karras & Laine 2017, §4: step and corner are brought to the parameter of the ray once for all boxes of a node, and a face costs a product and a sum.
//!
//! # Why no box is missed
//! These are other roundings than those of [`Prepared::in_box`], so that its order does not hold by itself between the two. Say `u = 2^-24`, `F` is the largest coordinate (at
//! least 2^31, and that of faces is below `2 F`), and distances are times the inverse component of the direction:
//!
//! | what | off, at most |
//! |---|---|
//! | step times inverse: a product with a power of two | 0 |
//! | product with the number of steps | `4 u F` |
//! | corner less origin, and its product | `4 u F` |
//! | their sum | `4 u F` |
//! | a face of a box inside, as [`Prepared::in_box`] has it | `4 u F` |
//! | the origins moved apart | `4 u F` |
//!
//! Together `20 u F`. So origins are moved apart by another [`Prepared::PAD`], `32 u F`: the interval here has that of every box inside in it.

use super::{Interval, Prepared, WIDER};
use crate::math::{max, min};

/// Boxes of a node, for one ray.
#[derive(Clone, Copy, Debug)]
pub struct Steps {
    /// A step in parameters.
    pub(super) step: [f32; 3],
    /// Where 0 steps are, for lower faces and for upper ones.
    pub(super) lower: [f32; 3],
    pub(super) upper: [f32; 3],
}

impl Prepared {
    /// The boxes around `corner` whose faces lie `step`s apart, powers of two.
    #[inline(always)]
    #[must_use]
    pub fn steps(&self, corner: [f32; 3], step: [f32; 3]) -> Steps {
        let (inverse, pad) = (self.inverse, self.pad);
        let lower = |k: usize| (corner[k] - (self.lower_origin[k] + pad)) * inverse[k];
        let upper = |k: usize| (corner[k] - (self.upper_origin[k] - pad)) * inverse[k];
        Steps {
            step: [step[0] * inverse[0], step[1] * inverse[1], step[2] * inverse[2]],
            lower: [lower(0), lower(1), lower(2)],
            upper: [upper(0), upper(1), upper(2)],
        }
    }

    /// [`Prepared::enters`] of the box with faces at so many steps.
    #[inline(always)]
    #[must_use]
    pub fn enters_steps(&self, steps: &Steps, least: [f32; 3], most: [f32; 3], t_max: f32) -> f32 {
        let slab = |k: usize| {
            let lower = least[k] * steps.step[k] + steps.lower[k];
            let upper = most[k] * steps.step[k] + steps.upper[k];
            (min(lower, upper), max(lower, upper))
        };
        let (x, y, z) = (slab(0), slab(1), slab(2));
        let far = min(min(x.1, y.1), z.1) * WIDER;
        self.enters_at(Interval { near: max(max(x.0, y.0), z.0), far }, t_max)
    }
}
