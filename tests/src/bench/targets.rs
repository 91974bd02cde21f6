//! What is judged of an anytime comparison, and how it came out.

use super::stats::{geometric_mean, worst};
use serde::Serialize;

/// Scenes of fewer triangles are shown, but not judged.
pub const FEWEST_TRIANGLES: usize = 60_000;

/// A tree of a peer, and when we had one as good.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PeerPoint {
    /// The peer's setting.
    pub setting: String,
    /// Its wall time, seconds.
    pub time_s: f64,
    /// Its cost.
    pub cost: f64,
    /// Our time until that cost or less, seconds; none if we never had it.
    pub our_time_s: Option<f64>,
    /// Our configuration that was first; empty if none was.
    pub by: String,
}

impl PeerPoint {
    /// Our time ÷ theirs; none if we never had that cost.
    #[must_use]
    pub fn ratio(&self) -> Option<f64> {
        // Nothing is quicker than a tree that is there from the start.
        self.our_time_s.map(|ours| if ours == 0.0 { 0.0 } else { ours / self.time_s })
    }
}

/// An experiment on one scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneResult {
    /// Scene.
    pub scene: String,
    /// Its triangles.
    pub triangles: usize,
    /// Every setting of the peer.
    pub points: Vec<PeerPoint>,
    /// The peer's lowest cost.
    pub peer_best: f64,
    /// Our lowest cost by PRBVH, the worst nodes first.
    pub worst_first: f64,
    /// Our lowest cost by anything.
    pub lowest: f64,
    /// Cost of RBVH as published; none if it did not run to its end.
    pub rbvh: Option<f64>,
    /// The same with undo.
    pub rbvh_undo: Option<f64>,
    /// Worst first beside the published order; none if one of them never had the cost at which that ends.
    pub published: Option<AgainstPublished>,
    /// Our time ÷ RBVH's, to the cost on RBVH's curves where it is the largest; infinite if we never had one of these costs.
    pub sequential: Option<f64>,
}

/// What worst first takes to the end of the published order.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AgainstPublished {
    /// The lowest cost of the published order.
    pub cost: f64,
    /// Our time ÷ its time.
    pub time: f64,
    /// Nodes that our searches visit ÷ those that its searches visit.
    pub visits: f64,
}

/// A target, and what came out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// What is judged and the bound on it.
    pub target: String,
    /// What was measured.
    pub measured: String,
    /// Whether it was met; none where there is nothing to judge.
    pub is_met: Option<bool>,
    /// By how much it was missed or outdone.
    pub by: String,
}

impl Verdict {
    /// A value that must not exceed a bound.
    #[must_use]
    pub fn at_most(target: String, value: f64, bound: f64, digits: usize) -> Self {
        let is_met = (!value.is_nan()).then_some(value <= bound);
        let (measured, by) = match is_met {
            None => ("nothing to judge".to_owned(), String::new()),
            Some(_) => (format!("{value:.digits$}"), format!("{:+.1} %", (value / bound - 1.0) * 100.0)),
        };
        Self { target, measured, is_met, by }
    }

    /// A value that must not be below a bound.
    #[must_use]
    pub fn at_least(target: String, value: f64, bound: f64, digits: usize) -> Self {
        Self { is_met: (!value.is_nan()).then_some(value >= bound), ..Self::at_most(target, value, bound, digits) }
    }

    /// `met`, `missed` or `—`.
    #[must_use]
    pub fn word(&self) -> &'static str {
        self.is_met.map_or("—", |is_met| if is_met { "met" } else { "missed" })
    }
}

/// The targets of an experiment over all scenes that are judged.
#[must_use]
pub fn verdicts(experiment: &str, results: &[SceneResult]) -> Vec<Verdict> {
    let judged: Vec<&SceneResult> = results.iter().filter(|scene| scene.triangles >= FEWEST_TRIANGLES).collect();
    let of = |cost: fn(&SceneResult) -> Option<f64>| -> Vec<f64> {
        judged.iter().filter_map(|scene| cost(scene)).collect::<Vec<_>>()
    };
    let cost = of(|scene| Some(scene.worst_first / scene.peer_best));
    let rbvh = of(|scene| Some(scene.worst_first / scene.rbvh?));
    let undo = of(|scene| Some(scene.worst_first / scene.rbvh_undo?));
    let time = of(|scene| Some(scene.published?.time));
    let visits = of(|scene| Some(scene.published?.visits));
    let sequential = of(|scene| scene.sequential);
    let points: Vec<f64> = judged
        .iter()
        .flat_map(|scene| &scene.points)
        .filter_map(PeerPoint::ratio)
        .filter(|ratio| *ratio > 0.0)
        .collect();
    let most = |what: &str, value: f64, bound: f64, digits| {
        Verdict::at_most(
            format!("{experiment}: {what}, ≤ {}", format!("{bound:.3}").trim_end_matches('0').trim_end_matches('.')),
            value,
            bound,
            digits,
        )
    };
    let ended = |ratios: &[f64]| format!("worst of the {} of {} scenes where it ended", ratios.len(), judged.len());
    vec![
        curve(experiment, &judged),
        most("our time ÷ t, geometric mean of all points", geometric_mean(&points), 0.08, 3),
        most("final cost ÷ their best, geometric mean", geometric_mean(&cost), 0.98, 4),
        most("final cost ÷ their best, worst", worst(&cost), 0.99, 4),
        most(&format!("final cost ÷ RBVH as published, {}", ended(&rbvh)), worst(&rbvh), 1.0, 4),
        most(&format!("final cost ÷ RBVH with undo, {}", ended(&undo)), worst(&undo), 1.0, 4),
        most("visits to the end of the published order ÷ its visits, worst", worst(&visits), 0.1, 4),
        most("the same, geometric mean", geometric_mean(&visits), 0.04, 4),
        most("time to the end of the published order ÷ its time, worst", worst(&time), 0.125, 4),
        most("the same, geometric mean", geometric_mean(&time), 1.0 / 15.0, 4),
        most("our time ÷ RBVH's to every cost on its curves, worst", worst(&sequential), 0.5, 3),
    ]
}

/// Every point of the peer, in half the time.
fn curve(experiment: &str, judged: &[&SceneResult]) -> Verdict {
    let target = format!("{experiment}: every point (t, c) of theirs reached by 0.5 t");
    let points: Vec<&PeerPoint> = judged.iter().flat_map(|scene| &scene.points).collect();
    if points.is_empty() {
        return Verdict { target, measured: "nothing to judge".to_owned(), is_met: None, by: String::new() };
    }
    let ratios: Vec<Option<f64>> = points.iter().map(|point| point.ratio()).collect();
    let reached: Vec<f64> = ratios.iter().copied().flatten().collect();
    let in_time = reached.iter().filter(|ratio| **ratio <= 0.5).count();
    let never = points.len() - reached.len();
    let sooner = reached.iter().filter(|ratio| **ratio <= 1.0).count();
    let measured = format!(
        "{in_time} of {} points ({:.0} %); {sooner} by t; {never} never",
        points.len(),
        100.0 * in_time as f64 / points.len() as f64
    );
    let by = match (never, reached.is_empty()) {
        (0, _) => format!("worst {:.2} t", worst(&reached)),
        (_, true) => "never".to_owned(),
        (_, false) => format!("worst of those reached {:.2} t", worst(&reached)),
    };
    Verdict { target, measured, is_met: Some(in_time == points.len()), by }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(time_s: f64, our_time_s: Option<f64>) -> PeerPoint {
        PeerPoint { setting: String::new(), time_s, cost: 1.0, our_time_s, by: String::new() }
    }

    /// Meets every target.
    fn good() -> SceneResult {
        SceneResult {
            scene: "good".to_owned(),
            triangles: FEWEST_TRIANGLES,
            points: vec![point(1.0, Some(0.08)), point(2.0, Some(0.0))],
            peer_best: 100.0,
            worst_first: 97.0,
            lowest: 96.0,
            rbvh: Some(97.5),
            rbvh_undo: Some(97.0),
            published: Some(AgainstPublished { cost: 98.0, time: 0.06, visits: 0.03 }),
            sequential: Some(0.5),
        }
    }

    fn met(results: &[SceneResult]) -> Vec<Option<bool>> {
        verdicts("x", results).iter().map(|verdict| verdict.is_met).collect()
    }

    /// Places of the targets that a scene beside a good one misses.
    fn missed(bad: SceneResult) -> Vec<usize> {
        let verdicts = met(&[good(), bad]);
        (0..verdicts.len()).filter(|&k| verdicts[k] == Some(false)).collect()
    }

    #[test]
    fn what_is_good_is_met() {
        assert_eq!(met(&[good()]), [Some(true); 11]);
    }

    #[test]
    fn every_planted_miss_is_found() {
        let against =
            |time, visits| SceneResult { published: Some(AgainstPublished { cost: 98.0, time, visits }), ..good() };
        let alone = |worst_first| SceneResult { worst_first, rbvh: None, rbvh_undo: None, ..good() };
        assert_eq!(missed(SceneResult { points: vec![point(1.0, Some(0.501))], ..good() }), [0, 1]);
        assert_eq!(missed(SceneResult { points: vec![point(1.0, None)], ..good() }), [0]);
        assert_eq!(missed(alone(99.5)), [2, 3]);
        assert_eq!(missed(alone(99.001)), [3]);
        assert_eq!(missed(SceneResult { rbvh: Some(96.9), ..good() }), [4]);
        assert_eq!(missed(SceneResult { rbvh_undo: Some(96.9), ..good() }), [5]);
        assert_eq!(missed(against(0.06, 0.11)), [6, 7]);
        assert_eq!(missed(against(0.06, 0.09)), [7]);
        assert_eq!(missed(against(0.13, 0.03)), [8, 9]);
        assert_eq!(missed(against(0.12, 0.03)), [9]);
        assert_eq!(missed(SceneResult { sequential: Some(f64::INFINITY), ..good() }), [10]);
    }

    #[test]
    fn a_point_that_is_never_reached_is_counted_as_such() {
        let bad = SceneResult { points: vec![point(1.0, None), point(1.0, Some(0.9))], ..good() };
        let verdict = &verdicts("x", &[good(), bad])[0];
        assert_eq!(verdict.measured, "2 of 4 points (50 %); 3 by t; 1 never");
        assert_eq!((verdict.by.as_str(), verdict.word()), ("worst of those reached 0.90 t", "missed"));
    }

    #[test]
    fn nothing_to_judge_is_not_met() {
        let small = SceneResult { triangles: FEWEST_TRIANGLES - 1, ..good() };
        for results in [vec![], vec![small]] {
            assert_eq!(met(&results), [None; 11]);
            assert!(verdicts("x", &results).iter().all(|verdict| verdict.word() == "—"));
        }
        let cut = SceneResult { rbvh: None, rbvh_undo: None, ..good() };
        assert_eq!(met(&[cut])[4..6], [None; 2]);
        assert_eq!(met(&[SceneResult { worst_first: f64::NAN, ..good() }])[2..4], [None; 2]);
    }

    #[test]
    fn bounds_are_met_exactly() {
        assert_eq!(Verdict::at_most(String::new(), 1.15, 1.15, 2).is_met, Some(true));
        assert_eq!(Verdict::at_least(String::new(), 1.8, 1.8, 2).is_met, Some(true));
        let verdict = Verdict::at_least(String::new(), 1.71, 1.8, 2);
        assert_eq!((verdict.word(), verdict.measured.as_str(), verdict.by.as_str()), ("missed", "1.71", "-5.0 %"));
        assert_eq!(Verdict::at_least(String::new(), f64::NAN, 1.8, 2).word(), "—");
    }
}
