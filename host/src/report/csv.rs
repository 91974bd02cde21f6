//! `iterations.csv`.

use crate::optimize::IterationRow;
use std::io::{self, Write};

/// Writes a header and a row per iteration. Floats have as many digits as it takes to read the same bits back.
pub(super) fn write(rows: &[IterationRow], out: &mut dyn Write) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(out);
    for row in rows {
        csv.serialize(row)?;
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
        let header =
            "iteration,mu,time_s,device_s,cost,predicted_decrease,relative_error,found,owned,applied,most_steps";
        assert_eq!(text.lines().next(), Some(header));
        assert_eq!(text.lines().count(), 1 + 8);
        assert_eq!(parsed(&text), rows);
    }

    proptest! {
        #[test]
        fn no_bit_is_lost(iteration: u32, found: u32, cost in proptest::num::f64::NORMAL, time_s in 0.0..1e9f64) {
            let rows = [IterationRow { iteration, found, cost, time_s, ..IterationRow::default() }];
            prop_assert_eq!(parsed(&written(&rows)), rows);
        }
    }
}
