//! What plans leave out, measured with and without: rows, and a line per omission.

use prbvh::plan::Omission;
use std::fmt::Write;

/// One omission on one scene; of a pair the first is left out, the second kept.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Name of the scene.
    pub scene: String,
    /// Triangles.
    pub triangles: usize,
    /// What is left out.
    pub omission: Omission,
    /// Seconds, medians.
    pub seconds: [f64; 2],
    /// Bytes at the peak.
    pub bytes: [u64; 2],
    /// Hashes of the trees.
    pub hashes: [String; 2],
}

impl Measured {
    /// Whether leaving it out does not change the tree.
    #[must_use]
    pub fn is_same_tree(&self) -> bool {
        self.hashes[0] == self.hashes[1]
    }

    /// A row of a Markdown table.
    #[must_use]
    pub fn row(&self) -> String {
        let [left_out, kept] = self.seconds.map(|seconds| seconds * 1e3);
        let [few, many] = self.bytes;
        let tree = if self.is_same_tree() { "same" } else { "**differs**" };
        format!(
            "| {} | {} | {} | {left_out:.3} | {kept:.3} | {:.3} | {few} | {many} | {tree} |",
            self.scene,
            self.triangles,
            self.omission,
            kept - left_out
        )
    }
}

/// What an omission is worth over scenes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Worth {
    /// Scenes on which it was left out.
    pub scenes: usize,
    /// Geometric mean of time with it over time without.
    pub ratio: f64,
    /// Seconds saved, all scenes together.
    pub seconds: f64,
    /// Bytes saved, all scenes together.
    pub bytes: u64,
}

impl Worth {
    /// Over those of `rows` that are about `omission`; none if there are none.
    #[must_use]
    pub fn of(rows: &[Measured], omission: Omission) -> Option<Self> {
        let rows: Vec<&Measured> = rows.iter().filter(|row| row.omission == omission).collect();
        let ratio = |row: &&Measured| (row.seconds[1] / row.seconds[0]).ln();
        (!rows.is_empty()).then(|| Self {
            scenes: rows.len(),
            ratio: (rows.iter().map(ratio).sum::<f64>() / rows.len() as f64).exp(),
            seconds: rows.iter().map(|row| row.seconds[1] - row.seconds[0]).sum(),
            bytes: rows.iter().map(|row| row.bytes[1].saturating_sub(row.bytes[0])).sum(),
        })
    }

    /// Whether it pays: in time, or, where it costs none beyond noise (1 %), in bytes.
    #[must_use]
    pub fn pays(&self) -> bool {
        (self.ratio > 1.0 && self.seconds > 0.0) || (self.ratio > 0.99 && self.bytes > 0)
    }
}

/// A line per omission, and one per row whose tree is another one; false with any of these.
#[must_use]
pub fn summary(rows: &[Measured]) -> (String, bool) {
    let mut omissions: Vec<Omission> = Vec::new();
    for row in rows {
        if !omissions.contains(&row.omission) {
            omissions.push(row.omission);
        }
    }
    let mut text = String::new();
    for omission in omissions {
        let Some(worth) = Worth::of(rows, omission) else { continue };
        let Worth { scenes, ratio, seconds, bytes } = worth;
        let verdict = if worth.pays() { "pays" } else { "DOES NOT PAY" };
        let _ = writeln!(
            text,
            "{omission}: {verdict}: {scenes} scene(s), time with it / without it {ratio:.3} (geometric mean), {:.3} ms and {bytes} \
             bytes saved in all",
            seconds * 1e3
        );
    }
    let different = rows.iter().filter(|row| !row.is_same_tree());
    for row in different.clone() {
        let [left_out, kept] = &row.hashes;
        let _ = writeln!(text, "FAULT: {}: without {} the tree is {left_out}, not {kept}", row.scene, row.omission);
    }
    (text, different.count() == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(omission: Omission, seconds: [f64; 2], bytes: [u64; 2]) -> Measured {
        let hashes = ["a".to_owned(), "a".to_owned()];
        Measured { scene: "s".to_owned(), triangles: 1, omission, seconds, bytes, hashes }
    }

    #[test]
    fn a_summary_says_what_pays() {
        let rows = [
            row(Omission::Collapse, [1.0, 2.0], [5, 9]),
            row(Omission::Collapse, [1.0, 8.0], [5, 5]),
            row(Omission::EqualBits, [2.0, 1.0], [5, 5]),
            row(Omission::LowerCodes, [1.0, 0.995], [5, 6]),
        ];
        let collapse = Worth::of(&rows, Omission::Collapse).unwrap();
        assert_eq!((collapse.scenes, collapse.seconds, collapse.bytes), (2, 8.0, 4));
        assert!((collapse.ratio - 4.0).abs() < 1e-12 && collapse.pays());
        assert!(!Worth::of(&rows, Omission::EqualBits).unwrap().pays());
        assert!(Worth::of(&rows, Omission::LowerCodes).unwrap().pays(), "bytes for nothing");
        assert_eq!(Worth::of(&rows, Omission::Paths), None);
        let (text, is_same) = summary(&rows);
        assert!(is_same && text.lines().count() == 3, "{text}");
        assert!(text.contains("passes of the sort over bits that are equal: DOES NOT PAY"), "{text}");
    }

    #[test]
    fn a_planted_other_tree_is_a_fault() {
        let mut other = row(Omission::Collapse, [1.0, 2.0], [1, 2]);
        other.hashes[1] = "b".to_owned();
        let (text, is_same) = summary(&[row(Omission::Collapse, [1.0, 2.0], [1, 2]), other.clone()]);
        assert!(
            !is_same && text.contains("FAULT: s: without collapse to adaptive leaves the tree is a, not b"),
            "{text}"
        );
        assert!(other.row().contains("differs"));
    }
}
