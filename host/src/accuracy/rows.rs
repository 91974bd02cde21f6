//! What is said of every iteration.

use super::Spread;
use serde::Serialize;

/// The numbers of a run against the referee.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AccuracyReport {
    /// [`F32_COST_BOUND`](super::F32_COST_BOUND).
    pub cost_bound: f64,
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
    /// What the search predicted as the fall of the cost, each reinsertion as if it were alone.
    pub predicted_decrease: f64,
    /// By how much `exact_cost` fell; 0 in row 0.
    pub measured_decrease: f64,
    /// Most by which roundings alone can part these two; none with the aggressive strategy, whose reinsertions may meet.
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
    /// With the conservative strategy the cost falls as predicted, up to roundings.
    Prediction,
    /// The device's search found as many moves as the same search on the host.
    Search,
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
