//! What the whole stability table says.

use super::document::Block;
use super::{device, part, stability_rows};
use prbvh_lab::stability::{AXES_BOUND, CATALOGUE, F32_COST_BOUND, Library, Row, methods};

/// Largest errors and counts of the table on the CPU; other devices have the same trees.
///
/// # Panics
/// If a row is red.
#[must_use]
pub fn block() -> Block {
    let rows = stability_rows(CATALOGUE, &methods(), device(), &Library);
    let red: Vec<&Row> = rows.iter().filter(|row| !row.is_green()).collect();
    assert!(red.is_empty(), "red rows: {red:?}");
    let largest = |of: fn(&Row) -> Option<f64>| {
        let with = rows.iter().filter_map(|row| Some((of(row)?, &row.case, &row.method)));
        let (value, case, method) = with.max_by(|a, b| a.0.total_cmp(&b.0)).expect("the table has such rows");
        format!("{} (`{case}`, {method})", part(value))
    };
    let moves: u64 = rows.iter().filter_map(|row| row.moves).map(u64::from).sum();
    let scaled: Vec<String> = rows
        .iter()
        .find(|row| row.case == "scale-1")
        .map(|row| row.scaled_by.iter().map(|k| format!("2^{k}")).collect())
        .unwrap_or_default();
    Block::new(
        "catalogue",
        format!(
            "- {} rows ({} cases, {} methods), none red\n\
             - largest error of the f32 cost: {}; the bound is {}\n\
             - moves that searches offer: {moves}, each of which lowers the cost in f64\n\
             - largest change of the optimised cost when the axes change places: {}; the bound is {}\n\
             - `scale-1` is multiplied by {}\n",
            rows.len(),
            CATALOGUE.len(),
            methods().len(),
            largest(|row| row.f32_error),
            part(F32_COST_BOUND),
            largest(|row| row.axes_change),
            part(AXES_BOUND),
            scaled.join(" and by ")
        ),
    )
}
