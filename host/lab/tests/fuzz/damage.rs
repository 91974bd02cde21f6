//! Damaged files: small valid ones, cut, flipped, spliced, and with numbers replaced; or bytes at random.

use super::targets::Bytes;
use proptest::prelude::*;
use std::ops::Range;

/// How bytes are changed; places are taken modulo the length.
#[derive(Clone, Debug)]
pub(crate) enum Damage {
    Cut(usize),
    Flip(usize, u8),
    Insert(usize, Vec<u8>),
    Remove(usize, usize),
    Repeat(usize, usize),
    /// A piece of another file, from a place on, over or into this one.
    Splice {
        at: usize,
        from: prop::sample::Index,
        start: usize,
        count: usize,
        over: bool,
    },
    /// The number of the text that comes next.
    Number(usize, &'static str),
    /// Four bytes, of either order.
    Word(usize, u32, bool),
}

/// Which file, what is done to it, and whether the checksum of a tree is put right again.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    sample: prop::sample::Index,
    random: Option<Vec<u8>>,
    damages: Vec<Damage>,
    sealed: bool,
}

const NUMBERS: [&str; 16] = [
    "-1",
    "0",
    "1e39",
    "-1e39",
    "1e-46",
    "nan",
    "inf",
    "2147483648",
    "4294967295",
    "4294967296",
    "9999999999",
    "18446744073709551615",
    "-9223372036854775808",
    "1e999",
    "0x7",
    "16777216",
];

const PIECES: [&str; 20] = [
    " ",
    "\n",
    "\r",
    "\\\n",
    "\\\r\n",
    "#",
    "\u{feff}",
    "/",
    "f 1",
    "f -1 -1 -1\n",
    "f 1 2 3 4 3 2 1\n",
    "[",
    "{}",
    "\"",
    "\0",
    "element face 4294967295\n",
    "element tristrips 3\n",
    "property list int int vertex_indices\n",
    "solid x\n",
    "endfacet\n",
];

fn word() -> impl Strategy<Value = u32> {
    let floats = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -0.0, 1e-45].map(f32::to_bits);
    let counts = [0, 1, 2, 7, 0xff, 0xffff, 0x00ff_ffff, 0x7fff_ffff, 0x8000_0000, 0xffff_fff0, u32::MAX];
    prop_oneof![prop::sample::select([&floats[..], &counts[..]].concat()), any::<u32>(), 0..64u32]
}

fn damage() -> impl Strategy<Value = Damage> {
    let at = any::<usize>;
    let piece = prop_oneof![
        prop::collection::vec(any::<u8>(), 1..9),
        prop::sample::select(&PIECES[..]).prop_map(|text| text.as_bytes().to_vec()),
    ];
    let splice = (at(), any::<prop::sample::Index>(), at(), 1..200usize, any::<bool>());
    prop_oneof![
        1 => at().prop_map(Damage::Cut),
        3 => (at(), 1..=255u8).prop_map(|(at, mask)| Damage::Flip(at, mask)),
        2 => (at(), piece).prop_map(|(at, piece)| Damage::Insert(at, piece)),
        2 => (at(), 1..9usize).prop_map(|(at, count)| Damage::Remove(at, count)),
        1 => (at(), 1..400usize).prop_map(|(at, count)| Damage::Repeat(at, count)),
        2 => splice.prop_map(|(at, from, start, count, over)| Damage::Splice { at, from, start, count, over }),
        5 => (at(), prop::sample::select(&NUMBERS[..])).prop_map(|(at, number)| Damage::Number(at, number)),
        4 => (at(), word(), any::<bool>()).prop_map(|(at, word, big)| Damage::Word(at, word, big)),
    ]
}

/// Cases over so many samples.
pub(crate) fn case(samples: usize) -> impl Strategy<Value = Case> {
    assert!(samples > 0, "nothing to damage");
    let random = prop::option::weighted(0.1, prop::collection::vec(any::<u8>(), 0..400));
    let damages = prop::collection::vec(damage(), 1..6);
    (any::<prop::sample::Index>(), random, damages, prop::bool::weighted(0.8))
        .prop_map(|(sample, random, damages, sealed)| Case { sample, random, damages, sealed })
}

impl Case {
    /// The file that it stands for.
    pub(crate) fn bytes(&self, samples: &[Bytes]) -> Bytes {
        let (extension, mut bytes) = self.sample.get(samples).clone();
        if let Some(random) = &self.random {
            return (extension, random.clone());
        }
        for damage in &self.damages {
            damage.apply(&mut bytes, samples);
        }
        if extension == "bvh" && self.sealed {
            seal(&mut bytes);
        }
        (extension, bytes)
    }
}

/// Puts the right checksum at the end of a tree: without it nothing else would be looked at.
fn seal(bytes: &mut [u8]) {
    if let Some(at) = bytes.len().checked_sub(16) {
        let (content, checksum) = bytes.split_at_mut(at);
        checksum.copy_from_slice(&blake3::hash(content).as_bytes()[..16]);
    }
}

impl Damage {
    fn apply(&self, bytes: &mut Vec<u8>, samples: &[Bytes]) {
        let length = bytes.len();
        let place = |at: &usize| at % length.max(1);
        let range = |at: &usize, count: &usize| place(at)..(place(at) + count).min(length);
        match self {
            Self::Cut(end) => bytes.truncate(place(end)),
            Self::Flip(at, mask) => bytes.get_mut(place(at)).into_iter().for_each(|byte| *byte ^= mask),
            Self::Insert(at, piece) => drop(bytes.splice(place(at)..place(at), piece.iter().copied())),
            Self::Remove(at, count) => drop(bytes.drain(range(at, count))),
            Self::Repeat(at, count) => {
                let piece = bytes[range(at, count)].to_vec();
                drop(bytes.splice(place(at)..place(at), piece));
            }
            Self::Splice { at, from, start, count, over } => {
                let (_, other) = from.get(samples);
                let start = start % other.len().max(1);
                let piece = other[start..(start + count).min(other.len())].to_vec();
                let replaced = if *over { range(at, &piece.len()) } else { place(at)..place(at) };
                drop(bytes.splice(replaced, piece));
            }
            Self::Number(at, number) => {
                if let Some(range) = next_number(bytes, place(at)) {
                    drop(bytes.splice(range, number.bytes()));
                }
            }
            Self::Word(at, word, big) => {
                let word = if *big { word.to_be_bytes() } else { word.to_le_bytes() };
                // Half of all words lie where those of a binary file do.
                let at = if at % 2 == 0 { place(at) / 4 * 4 } else { place(at) };
                bytes.iter_mut().skip(at).zip(word).for_each(|(byte, new)| *byte = new);
            }
        }
    }
}

/// Where the digits of the first number from `at` on are.
fn next_number(bytes: &[u8], at: usize) -> Option<Range<usize>> {
    let start = at + bytes[at..].iter().position(u8::is_ascii_digit)?;
    let is_part = |byte: &u8| byte.is_ascii_digit() || matches!(byte, b'.' | b'-' | b'e');
    let count = bytes[start..].iter().take_while(|byte| is_part(byte)).count();
    Some(start..start + count)
}
