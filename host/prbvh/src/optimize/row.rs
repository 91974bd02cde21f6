//! What one iteration did.

/// An iteration; the fields are the columns of `iterations.csv`. Row 0 is the initial tree. What the counts mean for RBVH:
/// [`rbvh`](super::rbvh()).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct IterationRow {
    /// Number; 0 is the initial tree.
    pub iteration: u32,
    /// Sparse search: one node in `mu` was searched.
    pub mu: u32,
    /// Wall time since the start of the optimisation, seconds.
    pub time_s: f64,
    /// Time on the device since the start of the optimisation, seconds; new tops, which a CPU makes, are in it where the device is the CPU.
    pub device_s: f64,
    /// SAH cost after the iteration, one triangle per leaf, from f32 areas; unitless.
    pub cost: f64,
    /// What the reinsertions made take off the cost by the search, each as if it were alone; unitless. With the conservative strategy the
    /// cost falls by just that, up to rounding.
    pub predicted_decrease: f64,
    /// `cost / best - 1` with the lowest cost of all rows; 0 until the run has ended.
    pub relative_error: f64,
    /// Nodes that were searched.
    pub searched: u32,
    /// Nodes whose boxes the searches looked at.
    pub visits: u32,
    /// Reinsertions that the search found.
    pub found: u32,
    /// Of these, the ones that owned all their locks.
    pub owned: u32,
    /// Of these, the ones that were made.
    pub applied: u32,
    /// Most steps of one search.
    pub most_steps: u32,
}

/// Fills [`IterationRow::relative_error`] from the costs. Rows that share the lowest cost have an error of exactly 0.
pub fn set_relative_errors(rows: &mut [IterationRow]) {
    let best = rows.iter().map(|row| row.cost).fold(f64::INFINITY, f64::min);
    for row in rows {
        // Also where both are 0.
        row.relative_error = if row.cost == best { 0.0 } else { row.cost / best - 1.0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_relative_to_the_lowest_cost() {
        let row = |cost| IterationRow { cost, ..IterationRow::default() };
        let mut rows = [row(200.0), row(100.0), row(150.0), row(100.0)];
        set_relative_errors(&mut rows);
        assert_eq!(rows.map(|row| row.relative_error), [1.0, 0.0, 0.5, 0.0]);
        let mut nothing = [row(0.0)];
        set_relative_errors(&mut nothing);
        assert_eq!(nothing[0].relative_error, 0.0);
        set_relative_errors(&mut []);
    }
}
