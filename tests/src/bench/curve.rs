//! Anytime curves: the cost of the best tree at hand against wall time.

use serde::Serialize;

/// A tree at a time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Point {
    /// Wall time since the start, seconds.
    pub time_s: f64,
    /// SAH cost, unitless.
    pub cost: f64,
}

/// What a configuration reached and when. Times rise; the cost may rise too.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Curve {
    /// Name of the configuration.
    pub name: String,
    /// Trees that were at hand.
    pub points: Vec<Point>,
}

/// A point of a lower envelope.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvelopePoint {
    /// Whose point it is.
    pub name: String,
    /// The point.
    pub point: Point,
}

/// First time with a tree of at most this cost; none if there never is one.
#[must_use]
pub fn time_to_reach(points: &[Point], cost: f64) -> Option<f64> {
    let times = points.iter().filter(|point| point.cost <= cost).map(|point| point.time_s);
    times.filter(|time| time.is_finite()).min_by(f64::total_cmp)
}

/// The lowest cost; NaN of none.
#[must_use]
pub fn lowest(points: &[Point]) -> f64 {
    points.iter().map(|point| point.cost).filter(|cost| cost.is_finite()).min_by(f64::total_cmp).unwrap_or(f64::NAN)
}

/// The configuration that is first to have a tree of at most this cost, and when. Of equal ones the first of the list.
#[must_use]
pub fn first_to_reach(curves: &[Curve], cost: f64) -> Option<(&str, f64)> {
    let reached = curves.iter().filter_map(|curve| Some((curve.name.as_str(), time_to_reach(&curve.points, cost)?)));
    reached.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// The lower envelope: at each time the lowest cost that any curve has had, as the points where that falls. Whoever may choose the
/// configuration afterwards is on it.
#[must_use]
pub fn envelope(curves: &[Curve]) -> Vec<EnvelopePoint> {
    let mut all: Vec<EnvelopePoint> = curves
        .iter()
        .flat_map(|curve| curve.points.iter().map(|&point| EnvelopePoint { name: curve.name.clone(), point }))
        .filter(|at| at.point.time_s.is_finite() && at.point.cost.is_finite())
        .collect();
    all.sort_by(|a, b| a.point.time_s.total_cmp(&b.point.time_s).then(a.point.cost.total_cmp(&b.point.cost)));
    let mut lowest = f64::INFINITY;
    all.retain(|at| {
        let is_lower = at.point.cost < lowest;
        lowest = lowest.min(at.point.cost);
        is_lower
    });
    all
}

/// One curve from several runs of the same configuration, which pass the same trees: at each of them the median of the times. A run that
/// was cut short ends the curve.
///
/// # Panics
/// If there is no run.
#[must_use]
pub fn median_of_runs(times: &[Vec<f64>], costs: &[f64]) -> Vec<Point> {
    let shortest = times.iter().map(Vec::len).min().expect("at least one run");
    (0..shortest.min(costs.len()))
        .map(|k| {
            let at: Vec<f64> = times.iter().map(|run| run[k]).collect();
            Point { time_s: super::stats::median(&at), cost: costs[k] }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn curve(name: &str, points: &[(f64, f64)]) -> Curve {
        let points = points.iter().map(|&(time_s, cost)| Point { time_s, cost }).collect();
        Curve { name: name.to_owned(), points }
    }

    #[test]
    fn a_curve_that_never_reaches() {
        let curves = [curve("a", &[(1.0, 110.0), (2.0, 100.1)]), curve("b", &[(1.0, f64::NAN)])];
        assert_eq!(first_to_reach(&curves, 100.0), None);
        assert_eq!(first_to_reach(&curves, 100.1), Some(("a", 2.0)));
        assert_eq!(first_to_reach(&[], 100.0), None);
        assert!(lowest(&curves[1].points).is_nan());
    }

    #[test]
    fn a_cost_that_rises_again_was_reached_all_the_same() {
        let rising = curve("a", &[(1.0, 99.0), (2.0, 101.0), (3.0, 98.0)]);
        assert_eq!(time_to_reach(&rising.points, 100.0), Some(1.0));
        assert_eq!(time_to_reach(&rising.points, 98.5), Some(3.0));
    }

    #[test]
    fn the_envelope_of_two_crossing_curves() {
        let curves =
            [curve("early", &[(1.0, 90.0), (2.0, 80.0), (5.0, 79.0)]), curve("late", &[(2.0, 85.0), (4.0, 70.0)])];
        let envelope = envelope(&curves);
        let points: Vec<(&str, f64, f64)> =
            envelope.iter().map(|at| (at.name.as_str(), at.point.time_s, at.point.cost)).collect();
        assert_eq!(points, [("early", 1.0, 90.0), ("early", 2.0, 80.0), ("late", 4.0, 70.0)]);
    }

    #[test]
    fn a_run_that_was_cut_ends_the_curve() {
        let points = median_of_runs(&[vec![1.0, 2.0, 9.0], vec![3.0, 4.0], vec![2.0, 5.0, 6.0]], &[9.0, 8.0, 7.0]);
        assert_eq!(points, curve("", &[(2.0, 9.0), (4.0, 8.0)]).points);
    }

    proptest! {
        #[test]
        fn the_envelope_answers_as_the_curves_do(
            curves in proptest::collection::vec(proptest::collection::vec((0..20u32, 0..20u32), 0..12), 0..4),
            cost in 0..20u32,
        ) {
            let named = |points: &Vec<(u32, u32)>| {
                curve("c", &points.iter().map(|&(t, c)| (t.into(), c.into())).collect::<Vec<_>>())
            };
            let curves: Vec<Curve> = curves.iter().map(named).collect();
            let envelope: Vec<Point> = envelope(&curves).iter().map(|at| at.point).collect();
            let both_fall = |pair: &[Point]| pair[0].time_s < pair[1].time_s && pair[0].cost > pair[1].cost;
            prop_assert!(envelope.windows(2).all(both_fall));
            let cost = f64::from(cost);
            prop_assert_eq!(time_to_reach(&envelope, cost), first_to_reach(&curves, cost).map(|(_, time)| time));
        }
    }
}
