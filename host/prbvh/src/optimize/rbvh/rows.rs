//! Rows in the thousands, however many batches there are.

use super::super::IterationRow;

/// Rows beyond which two are made one.
const MOST_ROWS: usize = 4096;

/// Rows of a run. Row 0 is the initial tree, and the last row is always the last batch alone.
#[derive(Debug)]
pub(super) struct Rows {
    rows: Vec<IterationRow>,
    /// Batches of a row but for the last rows.
    stride: u32,
    /// Batches after the last row that are not yet so many.
    open: Option<IterationRow>,
    batches: u32,
    last: Option<IterationRow>,
}

impl Rows {
    pub(super) fn new(initial: IterationRow) -> Self {
        Self { rows: vec![initial], stride: 1, open: None, batches: 0, last: None }
    }

    pub(super) fn push(&mut self, row: IterationRow) {
        if let Some(last) = self.last.replace(row) {
            self.close(last);
        }
    }

    fn close(&mut self, row: IterationRow) {
        let merged = self.open.map_or(row, |open| merge(open, row));
        self.batches += 1;
        if self.batches < self.stride {
            self.open = Some(merged);
            return;
        }
        self.open = None;
        self.batches = 0;
        self.rows.push(merged);
        if self.rows.len() > MOST_ROWS && self.rows.len() % 2 == 1 {
            let pairs = self.rows[1..].chunks_exact(2).map(|pair| merge(pair[0], pair[1]));
            let halved: Vec<_> = std::iter::once(self.rows[0]).chain(pairs).collect();
            self.rows = halved;
            self.stride *= 2;
        }
    }

    pub(super) fn finish(mut self) -> Vec<IterationRow> {
        self.rows.extend(self.open);
        self.rows.extend(self.last);
        self.rows
    }
}

/// Two rows as one: the time and cost of the better one, and what was done in both.
fn merge(a: IterationRow, b: IterationRow) -> IterationRow {
    let better = if a.cost < b.cost { a } else { b };
    IterationRow {
        found: a.found.saturating_add(b.found),
        owned: a.owned.saturating_add(b.owned),
        applied: a.applied.saturating_add(b.applied),
        most_steps: a.most_steps.max(b.most_steps),
        ..better
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows_of(batches: u32, cost: impl Fn(u32) -> f64) -> Vec<IterationRow> {
        let row = |iteration| IterationRow {
            iteration,
            time_s: f64::from(iteration),
            cost: cost(iteration),
            found: 3,
            owned: 2,
            applied: 1,
            most_steps: iteration,
            ..IterationRow::default()
        };
        let mut rows = Rows::new(IterationRow { cost: cost(0), ..IterationRow::default() });
        (1..=batches).for_each(|iteration| rows.push(row(iteration)));
        rows.finish()
    }

    #[test]
    fn a_short_run_has_a_row_per_batch() {
        let rows = rows_of(100, |k| 100.0 - f64::from(k));
        assert!(rows.iter().map(|row| row.iteration).eq(0..=100));
        assert_eq!(rows_of(0, |_| 1.0).len(), 1);
    }

    #[test]
    fn a_long_run_has_thousands_of_rows_with_the_best_and_the_last() {
        for batches in [4095, 4096, 4097, 50_001, 99_999] {
            let rows = rows_of(batches, |k| (f64::from(k) - 33_333.0).abs());
            assert!(rows.len() <= MOST_ROWS + 3 && rows.len() >= MOST_ROWS / 2, "{}", rows.len());
            let sums = rows.iter().fold((0, 0, 0), |s, r| (s.0 + r.found, s.1 + r.owned, s.2 + r.applied));
            assert_eq!(sums, (3 * batches, 2 * batches, batches));
            assert!(rows.windows(2).all(|pair| pair[0].iteration < pair[1].iteration));
            let last = rows[rows.len() - 1];
            assert_eq!((last.iteration, last.most_steps), (batches, batches));
            let best = rows.iter().map(|row| row.cost).fold(f64::INFINITY, f64::min);
            assert_eq!(best, f64::from(33_333u32.saturating_sub(batches)));
        }
    }
}
