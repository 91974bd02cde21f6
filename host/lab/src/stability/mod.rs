//! Is every method right on every device for scenes that break numbers? A catalogue of generated cases, the properties that each
//! must keep, and the table that says whether it did. `docs/numerics.md` says what each case is for and where the bounds come from.

mod catalogue;
mod check;
mod lane;
mod method;
mod rays;
mod ready;
mod row;
mod scaling;
mod shapes;
mod subject;
mod table;

pub use crate::accuracy::F32_COST_BOUND;
pub use catalogue::{CATALOGUE, Case};
pub use check::{AXES_BOUND, DUAL_AXES_BOUND};
pub use lane::Lane;
pub use method::{Method, methods};
pub use ready::CaseError;
pub use row::{Breach, Property, Row};
pub use subject::{Library, RunError, Subject};
pub use table::{listing, summary, table};

use ready::Ready;
use std::ops::ControlFlow;

/// Version of the rows as JSON; grows when a key changes its meaning or goes away.
pub const SCHEMA: u32 = 1;

/// Runs every method on every case on every lane; the rows in that order, lanes innermost. `observe` sees the rows of one case
/// and method at a time and may break: then those before them are returned, as these may have been cut short. `full` takes the large size of the cases that have one.
///
/// # Errors
/// If a case has no scene.
pub fn run(
    cases: &[Case],
    methods: &[Method],
    lanes: &mut [Lane],
    full: bool,
    subject: &dyn Subject,
    observe: &mut dyn FnMut(&[Row]) -> ControlFlow<()>,
) -> Result<Vec<Row>, CaseError> {
    let mut rows: Vec<Row> = Vec::new();
    for case in cases {
        let ready = Ready::new(case, full)?;
        for method in methods {
            let first = rows.len();
            for (k, lane) in lanes.iter_mut().enumerate() {
                rows.push(check::check(&ready, method, lane, k == 0, subject));
            }
            compare_devices(&mut rows[first..]);
            if observe(&rows[first..]).is_break() {
                rows.truncate(first);
                return Ok(rows);
            }
        }
    }
    Ok(rows)
}

/// Every device must have the tree of the first.
fn compare_devices(rows: &mut [Row]) {
    let Some((first, others)) = rows.split_first_mut() else { return };
    for row in others {
        let (Some(hash), Some(expected)) = (&row.tree_hash, &first.tree_hash) else { continue };
        row.same_hash = Some(hash == expected);
        if hash != expected {
            let what = format!("{hash}, but {} has {expected}", first.device);
            row.breach(Property::Device, what);
        }
    }
}
