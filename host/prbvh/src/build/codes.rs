//! Which bits of the Morton codes tell the references apart.

use super::sort::passes;
use crate::scene::SafeRange;
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::mem::Slot;
use prbvh_kernel::morton::{MortonParams, WORD_BITS, code_60};
use prbvh_kernel::setup::Triangle;
use rayon::prelude::*;

/// Length of the Morton codes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum MortonBits {
    /// Ten bits per axis.
    #[cfg_attr(feature = "serde", serde(rename = "30"))]
    Thirty,
    /// Twenty bits per axis.
    #[default]
    #[cfg_attr(feature = "serde", serde(rename = "60"))]
    Sixty,
}

/// What a builder computes and sorts of the Morton codes. From [`MortonBits`] alone: all bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
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

/// Most references whose codes are compared with each other. The 2^30 cells of the short codes are more than enough for a few triangles,
/// but those of a surface share some 2^21 of them: from about 2^12 triangles on two are likely to share one. Beyond this number a
/// comparison costs what the lower words do.
pub const MOST_COMPARED: usize = 1 << 14;

/// Passes of the sorts that must be saved before codes beyond the first few are looked at: for each reference, its code takes about
/// as long as two passes.
const WORTH_A_LOOK: usize = 3;

/// References whose codes are looked at before it is asked whether a look at more can tell anything; doubles each time.
const FIRST_CHUNK: usize = 1 << 10;

/// What the codes of 60 bits tell. It takes no longer than what it can save.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct CodeCensus {
    /// Bits in which the upper words (the codes of 30 bits) differ; all if not every code was looked at.
    pub differing_high: u32,
    /// The same of the lower words.
    pub differing_low: u32,
    /// Whether two references have equal upper but different lower words, so that the order by 60 bits is another one than that by
    /// 30. None: not compared, since there are more than [`MOST_COMPARED`] references, and lower words do differ.
    pub low_tells_more: Option<bool>,
    /// References whose codes were computed before it was clear that nothing, or nothing more, can be left out.
    pub looked_at: usize,
}

impl CodeCensus {
    /// Takes the census of finite triangles of a scene; `min` and `max` are the corners of its box.
    ///
    /// The codes are computed by the kernel itself, of more and more triangles until it is clear that there is nothing to save.
    #[must_use]
    pub fn of(triangles: &[Triangle], min: [f32; 3], max: [f32; 3]) -> Self {
        let largest = min.iter().chain(&max).fold(0.0f32, |m, x| m.max(x.abs()));
        let range = SafeRange::of_largest(largest);
        let corners = range.apply(&[Triangle { a: min, b: max, c: max }]);
        let count = u32::try_from(triangles.len()).unwrap_or(u32::MAX);
        let params = morton_params(count, corners.first().map_or(Aabb::EMPTY, Triangle::aabb), 20);
        let mut cells = (triangles.len() <= MOST_COMPARED).then(|| Cells::new(triangles.len()));
        let mut low_tells_more = cells.is_some().then_some(false);
        let mut first = None;
        let mut differing = [0; 2];
        let mut looked_at = 0;
        while looked_at < triangles.len() {
            let end = triangles.len().min(looked_at + FIRST_CHUNK.max(looked_at));
            let codes = codes(&range.apply(&triangles[looked_at..end]), &params);
            looked_at = end;
            let first = *first.get_or_insert(codes[0]);
            for code in &codes {
                differing[0] |= code[0] ^ first[0];
                differing[1] |= code[1] ^ first[1];
            }
            if let Some(cells) = &mut cells
                && low_tells_more == Some(false)
            {
                low_tells_more = Some(codes.iter().any(|code| cells.tells_more(*code)));
            }
            let lower_decide = differing[1] != 0 && low_tells_more != Some(false);
            if lower_decide && passes_saved(differing) < WORTH_A_LOOK {
                break;
            }
        }
        if differing[1] == 0 && looked_at == triangles.len() {
            low_tells_more = Some(false);
        }
        if looked_at < triangles.len() {
            differing = [Codes::ALL; 2];
        }
        Self { differing_high: differing[0], differing_low: differing[1], low_tells_more, looked_at }
    }

    /// What is enough of codes of `bits` bits for the same order and the same LBVH, bit for bit. A word keeps all its bits where the
    /// sort cannot do with a pass less.
    ///
    /// The upper word of a code of 60 bits is the code of 30 bits: the cells of the latter are 2^10 of the former's, and scaling by a power
    /// of two is exact. Where no lower word decides, both give the same order (equal codes by their index) and the same common prefixes.
    #[must_use]
    pub fn enough(&self, bits: MortonBits) -> Codes {
        let bits = if self.low_tells_more == Some(false) { MortonBits::Thirty } else { bits };
        let worth = |differing| if passes(differing) < passes(Codes::ALL) { differing } else { Codes::ALL };
        Codes { bits, high: worth(self.differing_high), low: worth(self.differing_low) }
    }
}

pub(super) fn morton_params(count: u32, scene_box: Aabb, bits_per_axis: u32) -> MortonParams {
    let cells = f64::from(1u32 << bits_per_axis);
    let per_axis = |k: usize| {
        let extent = f64::from(scene_box.max[k]) - f64::from(scene_box.min[k]);
        if extent > 0.0 { (cells / extent) as f32 } else { 0.0 }
    };
    MortonParams { count, origin: scene_box.min, cells_per_unit: [per_axis(0), per_axis(1), per_axis(2)] }
}

/// Passes that a sort by both words saves if no other bits differ.
fn passes_saved(differing: [u32; 2]) -> usize {
    differing.map(|bits| passes(Codes::ALL) - passes(bits)).iter().sum()
}

/// Upper and lower words.
pub(super) fn codes(working: &[Triangle], params: &MortonParams) -> Vec<[u32; 2]> {
    let code = |triangle: &Triangle| {
        let (mut high, mut low, mut order) = ([0], [0], [0]);
        let slots = [&mut high, &mut low, &mut order].map(|word| Slot::from_mut_slice(word));
        code_60(0, params, &[triangle.aabb()], slots[0], slots[1], slots[2]);
        [high[0], low[0]]
    };
    // Pieces that are worth a thread.
    working.par_iter().with_min_len(FIRST_CHUNK).map(code).collect()
}

/// The upper words so far, each with the first lower word that came with it: a table of open addresses, half full at most.
struct Cells {
    slots: Vec<[u32; 2]>,
}

/// No upper word: these have 30 bits.
const EMPTY: u32 = u32::MAX;

impl Cells {
    fn new(codes: usize) -> Self {
        Self { slots: vec![[EMPTY, 0]; (2 * codes).next_power_of_two()] }
    }

    /// Takes a code; says whether it has the upper word of an earlier one, but another lower word.
    fn tells_more(&mut self, [high, low]: [u32; 2]) -> bool {
        let mask = self.slots.len() - 1;
        // Fibonacci hashing (Knuth, The Art of Computer Programming 3, §6.4).
        let mut place = (high.wrapping_mul(0x9e37_79b1) >> 8) as usize & mask;
        loop {
            match self.slots[place] {
                [EMPTY, _] => {
                    self.slots[place] = [high, low];
                    return false;
                }
                [taken, lower] if taken == high => return lower != low,
                _ => place = (place + 1) & mask,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point(x: f32, y: f32, z: f32) -> Triangle {
        Triangle { a: [x, y, z], b: [x, y, z], c: [x, y, z] }
    }

    fn census(triangles: &[Triangle]) -> CodeCensus {
        let boxes = triangles.iter().map(Triangle::aabb).fold(Aabb::EMPTY, Aabb::union);
        CodeCensus::of(triangles, boxes.min, boxes.max)
    }

    #[test]
    fn one_place_has_one_code() {
        for n in [1, 5, MOST_COMPARED + 1, 5 * FIRST_CHUNK] {
            let one = census(&vec![point(1.0, 2.0, 3.0); n]);
            let none = CodeCensus { differing_high: 0, differing_low: 0, low_tells_more: Some(false), looked_at: n };
            assert_eq!(one, none);
            assert_eq!(one.enough(MortonBits::Sixty), Codes { bits: MortonBits::Thirty, high: 0, low: 0 });
        }
    }

    #[test]
    fn the_last_triangle_counts() {
        for n in [2 * FIRST_CHUNK, 2 * FIRST_CHUNK + 1, MOST_COMPARED, MOST_COMPARED + 7] {
            let mut triangles = vec![point(0.0, 0.0, 0.0); n];
            triangles[n - 1] = point(1.0, 0.0, 0.0);
            triangles[0] = point(1.0, 0.0, 0.0);
            let same = census(&triangles);
            // No pass is saved, so that nobody looks on where there are many.
            let bits = if n <= MOST_COMPARED { 0x0924_9249 } else { Codes::ALL };
            assert_eq!((same.differing_high, same.differing_low), (bits, bits), "{n}");
            // Two upper words, each with one lower word.
            assert_eq!(same.low_tells_more, (n <= MOST_COMPARED).then_some(false), "{n}");
            triangles[n - 1] = point(1.0 - f32::EPSILON, 0.0, 0.0);
            assert_eq!(census(&triangles).low_tells_more, (n <= MOST_COMPARED).then_some(false), "the same cell, {n}");
            triangles[n - 1] = point(1.0 - 1.0 / 4096.0, 0.0, 0.0);
            assert_eq!(census(&triangles).low_tells_more, (n <= MOST_COMPARED).then_some(true), "{n}");
        }
    }

    #[test]
    fn a_line_needs_every_pass() {
        let line: Vec<Triangle> = (0..=1024).map(|k| point(0.0, k as f32, 0.0)).collect();
        let census = census(&line);
        // 1024 is the end of the scene: it is in the last cell, like 1023 in short codes.
        assert_eq!(census.low_tells_more, Some(true));
        assert_eq!(census.enough(MortonBits::Sixty), Codes::from(MortonBits::Sixty));
        assert_eq!(census.enough(MortonBits::Thirty), Codes::from(MortonBits::Thirty));
    }

    #[test]
    fn a_census_ends_when_nothing_is_left_to_save() {
        let flat: Vec<Triangle> = (0..100_000).map(|k| point((k as f32 * 0.37).sin(), 0.0, (k as f32).cos())).collect();
        let census = census(&flat);
        assert!(census.looked_at <= 2 * FIRST_CHUNK, "{}", census.looked_at);
        assert_eq!(census.enough(MortonBits::Sixty), Codes::from(MortonBits::Sixty));
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

    proptest! {
        /// Against a sort of all codes.
        #[test]
        fn cells_find_what_a_sort_finds(codes in proptest::collection::vec([0u32..24, 0u32..3], 1..60)) {
            let mut cells = Cells::new(codes.len());
            let found = codes.iter().any(|code| cells.tells_more(*code));
            let mut sorted = codes;
            sorted.sort_unstable();
            prop_assert_eq!(found, sorted.windows(2).any(|pair| pair[0][0] == pair[1][0] && pair[0][1] != pair[1][1]));
        }
    }
}
