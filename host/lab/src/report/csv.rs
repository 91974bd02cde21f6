//! `iterations.csv` and `accuracy.csv`.

use crate::accuracy::AccuracyRow;
use prbvh::optimize::IterationRow;
use std::io::{self, Write};

/// Writes a header and a row per iteration. Floats have as many digits as it takes to read the same bits back.
pub(super) fn write(rows: &[IterationRow], out: &mut dyn Write) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(out);
    for row in rows {
        csv.serialize(row)?;
    }
    csv.flush()
}

/// Columns of `accuracy.csv`; the spreads as the bounds of half and of 99 % of the values, and the maximum.
const ACCURACY: [&str; 18] = [
    "iteration",
    "time_s",
    "exact_cost",
    "cost_error",
    "predicted_decrease",
    "measured_decrease",
    "prediction_bound",
    "searched",
    "candidates",
    "offered",
    "refused_noise",
    "raising",
    "drift_half",
    "drift_99",
    "drift_max",
    "decrease_error_half",
    "decrease_error_99",
    "decrease_error_max",
];

/// Writes a header and a row per iteration; what is not known is empty.
pub(super) fn write_accuracy(rows: &[AccuracyRow], out: &mut dyn Write) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(out);
    csv.write_record(ACCURACY)?;
    for row in rows {
        let numbers =
            [row.time_s, row.exact_cost, row.cost_error, row.predicted_decrease, row.measured_decrease].map(Some);
        csv.write_field(row.iteration.to_string())?;
        let search = row.search.as_ref();
        let counts = search.map(|s| [s.searched, s.candidates, s.offered, s.refused_noise, s.raising].map(Some));
        let spreads = search.map(|search| [&search.drift, &search.decrease_error]).map(|spreads| {
            let [drift, error] = spreads.map(|spread| [spread.bound_of(0.5), spread.bound_of(0.99), spread.max]);
            [drift[0], drift[1], drift[2], error[0], error[1], error[2]].map(Some)
        });
        let text = |number: Option<f64>| number.map_or_else(String::new, |number| number.to_string());
        let count = |count: Option<u64>| count.map_or_else(String::new, |count| count.to_string());
        csv.write_record(
            numbers
                .into_iter()
                .chain([row.prediction_bound])
                .map(text)
                .chain(counts.unwrap_or_default().map(count))
                .chain(spreads.unwrap_or_default().map(text)),
        )?;
    }
    csv.flush()
}

#[cfg(test)]
mod tests {
    use super::super::testing::report;
    use super::*;
    use proptest::prelude::*;

    fn written(rows: &[IterationRow]) -> String {
        let mut bytes = Vec::new();
        write(rows, &mut bytes).unwrap();
        String::from_utf8(bytes).unwrap()
    }

    fn parsed(text: &str) -> Vec<IterationRow> {
        csv::Reader::from_reader(text.as_bytes()).deserialize().collect::<Result<_, _>>().unwrap()
    }

    #[test]
    fn rows_come_back_under_a_header() {
        let rows = report(7).rows;
        let text = written(&rows);
        let header = "iteration,mu,time_s,device_s,cost,predicted_decrease,relative_error,searched,visits,found,owned,applied,most_steps";
        assert_eq!(text.lines().next(), Some(header));
        assert_eq!(text.lines().count(), 1 + 8);
        assert_eq!(parsed(&text), rows);
    }

    proptest! {
        #[test]
        fn no_bit_is_lost(iteration: u32, found: u32, cost in proptest::num::f64::NORMAL, time_s in 0.0..1e9f64) {
            let rows = [IterationRow::default().with(|row| { row.iteration = iteration; row.found = found; row.cost = cost; row.time_s = time_s; })];
            prop_assert_eq!(parsed(&written(&rows)), rows);
        }
    }
}
