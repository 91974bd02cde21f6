//! Which bits of the Morton codes tell the references apart.

use super::order::{MortonBits, morton_params};
use crate::scene::SafeRange;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::mem::Slot;
use prbvh_kernel::morton::{MortonParams, WORD_BITS, code_60};
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;
use serde::Serialize;

/// What a builder computes and sorts of the Morton codes. From [`MortonBits`] alone: all bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Codes {
    /// Length of the codes.
    pub bits: MortonBits,
    /// Bits in which upper words (the codes of 30 bits) may differ; a sort by the upper words looks at no others.
    pub high: u32,
    /// The same of the lower words.
    pub low: u32,
}

impl Codes {
    /// All bits of a word of a code.
    pub const ALL: u32 = (1 << WORD_BITS) - 1;
}

impl From<MortonBits> for Codes {
    fn from(bits: MortonBits) -> Self {
        Self { bits, high: Self::ALL, low: Self::ALL }
    }
}

/// Most references whose codes are compared. The 2^30 cells of the short codes are more than enough for a few triangles, but those of a
/// surface share some 2^21 of them: from about 2^12 triangles on two are likely to share one, and a comparison only costs time.
pub const MOST_COMPARED: usize = 1 << 16;

/// References whose codes are looked at before it is asked whether a look at more can tell anything.
const CHUNK: usize = 1 << 14;

/// What the codes of 60 bits tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct CodeCensus {
    /// Bits in which the upper words (the codes of 30 bits) differ.
    pub differing_high: u32,
    /// Bits in which the lower words differ.
    pub differing_low: u32,
    /// Whether two references have equal upper but different lower words, so that the order by 60 bits is another one than that by
    /// 30. None: not compared, since there are more than [`MOST_COMPARED`] references, and lower words do differ.
    pub low_tells_more: Option<bool>,
}

impl CodeCensus {
    /// Takes the census of finite triangles of a scene; `min` and `max` are the corners of its box.
    ///
    /// The codes are computed by the kernel itself. Only the first few thousand triangles are looked at where these differ in all bits.
    #[must_use]
    pub fn of(triangles: &[Triangle], min: [f32; 3], max: [f32; 3]) -> Self {
        let largest = min.iter().chain(&max).fold(0.0f32, |m, x| m.max(x.abs()));
        let range = SafeRange::of_largest(largest);
        let corners = range.apply(&[Triangle { a: min, b: max, c: max }]);
        let count = u32::try_from(triangles.len()).unwrap_or(u32::MAX);
        let params = morton_params(count, corners.first().map_or(Aabb::EMPTY, Triangle::aabb), 20);
        let compares = triangles.len() <= MOST_COMPARED;
        let mut all = Vec::new();
        let mut first = None;
        let mut differing = [0; 2];
        for chunk in triangles.chunks(CHUNK) {
            let codes = codes(&range.apply(chunk), &params);
            let first = *first.get_or_insert(codes[0]);
            for (k, differing) in differing.iter_mut().enumerate() {
                *differing |= codes.par_iter().map(|code| code[k] ^ first[k]).reduce(|| 0, |a, b| a | b);
            }
            if compares {
                all.extend(codes);
            } else if differing == [Codes::ALL; 2] {
                break;
            }
        }
        let low_tells_more = match differing {
            [_, 0] => Some(false),
            _ => compares.then(|| low_tells_more(all)),
        };
        Self { differing_high: differing[0], differing_low: differing[1], low_tells_more }
    }

    /// What is enough of codes of `bits` bits for the same order and the same LBVH, bit for bit.
    ///
    /// The upper word of a code of 60 bits is the code of 30 bits: the cells of the latter are 2^10 of the former's, and scaling by a power
    /// of two is exact. Where no lower word decides, both give the same order (equal codes by their index) and the same common prefixes.
    #[must_use]
    pub fn enough(&self, bits: MortonBits) -> Codes {
        let bits = if self.low_tells_more == Some(false) { MortonBits::Thirty } else { bits };
        Codes { bits, high: self.differing_high, low: self.differing_low }
    }
}

/// Upper and lower words.
fn codes(working: &[Triangle], params: &MortonParams) -> Vec<[u32; 2]> {
    let code = |triangle: &Triangle| {
        let (mut high, mut low, mut order) = ([0], [0], [0]);
        let slots = [&mut high, &mut low, &mut order].map(|word| Slot::from_mut_slice(word));
        code_60(0, params, &[triangle.aabb()], slots[0], slots[1], slots[2]);
        [high[0], low[0]]
    };
    working.par_iter().map(code).collect()
}

fn low_tells_more(mut codes: Vec<[u32; 2]>) -> bool {
    codes.par_sort_unstable();
    codes.windows(2).any(|pair| pair[0][0] == pair[1][0] && pair[0][1] != pair[1][1])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(x: f32, y: f32, z: f32) -> Triangle {
        Triangle { a: [x, y, z], b: [x, y, z], c: [x, y, z] }
    }

    fn census(triangles: &[Triangle]) -> CodeCensus {
        let boxes = triangles.iter().map(Triangle::aabb).fold(Aabb::EMPTY, Aabb::union);
        CodeCensus::of(triangles, boxes.min, boxes.max)
    }

    #[test]
    fn one_place_has_one_code() {
        for n in [1, 5, MOST_COMPARED + 1] {
            let one = census(&vec![point(1.0, 2.0, 3.0); n]);
            assert_eq!(one, CodeCensus { differing_high: 0, differing_low: 0, low_tells_more: Some(false) });
            assert_eq!(one.enough(MortonBits::Sixty), Codes { bits: MortonBits::Thirty, high: 0, low: 0 });
        }
    }

    #[test]
    fn a_line_differs_in_the_bits_of_its_axis() {
        let line: Vec<Triangle> = (0..=1024).map(|k| point(0.0, k as f32, 0.0)).collect();
        let census = census(&line);
        // 1024 is the end of the scene: it is in the last cell, like 1023 in short codes.
        assert_eq!((census.differing_high, census.differing_low), (0x1249_2492, 0x1249_2492));
        assert_eq!(census.low_tells_more, Some(true));
        assert_eq!(census.enough(MortonBits::Sixty).bits, MortonBits::Sixty);
        assert_eq!(census.enough(MortonBits::Thirty).bits, MortonBits::Thirty);
    }

    #[test]
    fn lower_words_may_differ_and_decide_nothing() {
        let census = census(&[point(0.0, 0.0, 0.0), point(0.3, 0.4, 0.7), point(1.0, 1.0, 1.0)]);
        assert_ne!(census.differing_low, 0);
        assert_eq!(census.low_tells_more, Some(false));
    }

    #[test]
    fn many_references_are_not_compared() {
        let many: Vec<Triangle> = (0..=MOST_COMPARED).map(|k| point((k as f32).sin(), (k as f32).cos(), 0.5)).collect();
        assert_eq!(census(&many).low_tells_more, None);
        assert_eq!(census(&many[1..]).low_tells_more, Some(true));
    }
}
