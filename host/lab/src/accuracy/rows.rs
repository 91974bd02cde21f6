//! What is said of every iteration.

use super::{Offer, Spread};
use serde::Serialize;

/// The numbers of a run against the referee.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AccuracyReport {
    /// All searches of the run; none where no search ran on a device.
    pub search: Option<SearchAccuracy>,
    /// What must not be.
    pub breaches: Vec<Breach>,
    /// A row per iteration; iteration 0 is the initial tree.
    pub rows: Vec<AccuracyRow>,
}

/// An iteration against the referee. Costs are unitless.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AccuracyRow {
    /// Number; 0 is the initial tree.
    pub iteration: u32,
    /// Wall time since the start of the optimisation, seconds; that of the check is in it.
    pub time_s: f64,
    /// SAH cost of the downloaded tree with boxes of the original triangles, f64.
    pub exact_cost: f64,
    /// |cost / `exact_cost` - 1| with the cost that the optimiser says.
    pub cost_error: f64,
    /// Most that this can be: [`F32_COST_BOUND`](super::F32_COST_BOUND), or [`Changes::cost_bound`](super::Changes::cost_bound) after rounds
    /// that add up what changed.
    pub cost_bound: f64,
    /// What the search predicted as the fall of the cost, each reinsertion as if it were alone.
    pub predicted_decrease: f64,
    /// By how much `exact_cost` fell; 0 in row 0.
    pub measured_decrease: f64,
    /// Most by which roundings alone can part these two; none where reinsertions may meet: with
    /// the aggressive strategy, and worst first.
    pub prediction_bound: Option<f64>,
    /// The searches of the iteration; none where none ran on a device.
    pub search: Option<SearchAccuracy>,
}

/// Searches against the referee.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SearchAccuracy {
    /// Nodes searched.
    pub searched: u64,
    /// Of these, the ones whose walk ended with a candidate.
    pub candidates: u64,
    /// Of these, the ones that the search offers.
    pub offered: u64,
    /// Candidates that are not offered and lower no cost in f64: what the relative threshold is for.
    pub refused_noise: u64,
    /// Candidates that are offered and lower no cost in f64.
    pub raising: u64,
    /// |sum of the walk / direct sum - 1|, both f32, over what is offered.
    pub drift: Spread,
    /// |direct sum / sum in f64 - 1| over what is offered.
    pub decrease_error: Spread,
}

impl SearchAccuracy {
    /// Of `searched` searches, what they found.
    #[must_use]
    pub fn of(searched: u32, found: &[Offer]) -> Self {
        let mut search = Self { searched: searched.into(), ..Self::default() };
        for offer in found {
            search.candidates += 1;
            if offer.direct > 0.0 {
                search.offered += 1;
                search.raising += u64::from(offer.exact <= 0.0);
                let direct = f64::from(offer.direct);
                search.drift.add(f64::from(offer.walked) / direct - 1.0);
                search.decrease_error.add(direct / offer.exact - 1.0);
            } else {
                search.refused_noise += u64::from(offer.exact <= 0.0);
            }
        }
        search
    }

    /// Adds other searches.
    pub(super) fn merge(&mut self, other: &Self) {
        self.searched += other.searched;
        self.candidates += other.candidates;
        self.offered += other.offered;
        self.refused_noise += other.refused_noise;
        self.raising += other.raising;
        self.drift.merge(&other.drift);
        self.decrease_error.merge(&other.decrease_error);
    }
}

/// Something that must not be.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Breach {
    /// Iteration.
    pub iteration: u32,
    /// What kind of thing.
    pub kind: BreachKind,
    /// The numbers.
    pub what: String,
}

/// What must hold in every iteration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum BreachKind {
    /// The downloaded tree is none.
    Tree,
    /// The cost is within its bound of the f64 one.
    Cost,
    /// With the conservative strategy the cost falls as predicted, up to roundings. Worst first, the prediction is the sum of what the
    /// moves made promise.
    Prediction,
    /// The device's search found as many moves as the same search on the host; worst first, the same moves.
    Search,
    /// Worst first, every move on offer lowers the cost in f64, and by at most twice what is promised.
    Offer,
}

impl AccuracyReport {
    /// Whether all is as it must be.
    #[must_use]
    pub fn is_green(&self) -> bool {
        self.breaches.is_empty()
    }

    /// The row of the largest error of a cost; none without rows. What is no number is the largest.
    #[must_use]
    pub fn worst_cost(&self) -> Option<&AccuracyRow> {
        let rank = |row: &&AccuracyRow| if row.cost_error.is_nan() { f64::INFINITY } else { row.cost_error };
        self.rows.iter().reduce(|worst, row| if rank(&row) > rank(&worst) { row } else { worst })
    }

    /// Sums of the predicted and of the measured decreases of all iterations; unitless.
    #[must_use]
    pub fn decreases(&self) -> (f64, f64) {
        let sum = |of: fn(&AccuracyRow) -> f64| self.rows.iter().map(of).sum();
        (sum(|row| row.predicted_decrease), sum(|row| row.measured_decrease))
    }

    /// What is wrong in a line: the first breach and how many there are; none if nothing is.
    #[must_use]
    pub fn verdict(&self) -> Option<String> {
        let Breach { iteration, what, .. } = self.breaches.first()?;
        let others = match self.breaches.len() {
            1 => String::new(),
            many => format!(" (and {} more)", many - 1),
        };
        Some(format!("the numbers are not what they should be: iteration {iteration}: {what}{others}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(iteration: u32, cost_error: f64) -> AccuracyRow {
        AccuracyRow {
            iteration,
            time_s: 0.0,
            exact_cost: 1.0,
            cost_error,
            cost_bound: 1e-5,
            predicted_decrease: 2.0,
            measured_decrease: 1.5,
            prediction_bound: None,
            search: None,
        }
    }

    fn report(errors: &[f64]) -> AccuracyReport {
        let rows = (0..).zip(errors).map(|(k, error)| row(k, *error)).collect();
        AccuracyReport { search: None, breaches: Vec::new(), rows }
    }

    #[test]
    fn the_worst_row_is_the_largest_error_or_none_at_all() {
        let worst = |errors: &[f64]| report(errors).worst_cost().map(|row| row.iteration);
        assert_eq!((worst(&[]), worst(&[0.0, 3.0, 2.0]), worst(&[0.0, f64::NAN, 2.0])), (None, Some(1), Some(1)));
        assert_eq!(report(&[0.0, 0.0]).decreases(), (4.0, 3.0));
    }

    #[test]
    fn a_verdict_names_the_first_breach() {
        let mut report = report(&[0.0]);
        assert!(report.is_green() && report.verdict().is_none());
        let breach = |iteration| Breach { iteration, kind: BreachKind::Cost, what: "off".to_owned() };
        report.breaches.push(breach(4));
        assert!(!report.is_green() && report.verdict().is_some_and(|line| line.ends_with("iteration 4: off")));
        report.breaches.push(breach(5));
        assert!(report.verdict().is_some_and(|line| line.ends_with("iteration 4: off (and 1 more)")));
    }

    /// Every count by a move that it is for.
    #[test]
    fn moves_are_counted_by_what_they_are() {
        let offer = |walked, direct, exact| Offer { input: 1, output: 2, walked, direct, exact };
        let found = [
            offer(1.0, 1.0, 1.0),
            offer(3.0, 2.0, 2.0),
            offer(1.0, 1.0, -1.0),
            offer(1.0, 0.0, -1.0),
            offer(1.0, 0.0, 0.5),
        ];
        let search = SearchAccuracy::of(9, &found);
        assert_eq!((search.searched, search.candidates, search.offered), (9, 5, 3));
        assert_eq!((search.raising, search.refused_noise), (1, 1));
        assert_eq!((search.drift.count, search.drift.zeros, search.drift.max), (3, 2, 0.5));
        assert_eq!((search.decrease_error.zeros, search.decrease_error.max), (2, 2.0));
        let mut twice = search.clone();
        twice.merge(&search);
        assert_eq!(twice, SearchAccuracy::of(18, &[found, found].concat()));
    }
}
