//! The check as a table on the terminal.

use super::{AccuracyReport, AccuracyRow, SearchAccuracy, Spread};
use crate::terminal::empty;
use comfy_table::Cell;
use prbvh::format;

/// The outcome of a check, at most `width` columns wide (30 at least). Ends with a line end.
#[must_use]
pub fn table(report: &AccuracyReport, width: u16) -> String {
    let mut table = empty(width);
    let verdict = if report.is_green() { "ok".to_owned() } else { format!("{} breaches", report.breaches.len()) };
    table.set_header([Cell::new("numbers against f64"), Cell::new(verdict)]);
    let mut row = |name: &str, value: String| {
        table.add_row([name.to_owned(), value]);
    };
    if let Some(worst) = report.worst_cost() {
        let AccuracyRow { cost_error, cost_bound, iteration, .. } = worst;
        let of = report.rows.len();
        row("error of the cost", format!("{cost_error:.1e} at most (iteration {iteration} of {of} checked)"));
        row("its bound", format!("{cost_bound:.1e}"));
    }
    if let Some(search) = &report.search {
        let (predicted, measured) = report.decreases();
        row("predicted decreases", format!("{predicted:.3} in all"));
        row("the cost fell by", format!("{measured:.3}{}", share(measured, predicted)));
        let SearchAccuracy { offered, candidates, refused_noise, raising, drift, decrease_error, .. } = search;
        row("moves offered", format!("{} of {} candidates", format::count(*offered), format::count(*candidates)));
        row("refused as noise", format!("{} that lower no cost in f64", format::count(*refused_noise)));
        row("offered noise", format!("{} that lower no cost in f64", format::count(*raising)));
        row("drift of the walk", spread(drift));
        row("decrease against f64", spread(decrease_error));
    }
    format!("{}\n", table.trim_fmt())
}

fn share(measured: f64, predicted: f64) -> String {
    if predicted > 0.0 { format!(" ({:.1} % of it)", 100.0 * measured / predicted) } else { String::new() }
}

fn spread(spread: &Spread) -> String {
    if spread.count == 0 {
        return "-".to_owned();
    }
    let [half, most] = [0.5, 0.99].map(|part| spread.bound_of(part));
    format!("half ≤ {half:.1e}, 99 % ≤ {most:.1e}, all ≤ {:.1e}", spread.max)
}
