//! The runs that only the figures show.

use super::methods::{Builder, Job, published, starts, worst_first};
use super::{OptimizerRun, Purpose};
use prbvh::optimize::{PrbvhSettings, Strategy};
use prbvh::pipeline::Settings;

/// Influence of µ (Meister & Bittner 2018, figure 6, up to 32).
const MU: [u32; 9] = [1, 2, 4, 6, 9, 12, 16, 24, 32];

/// Strategies beside the aggressive one: whoever adds one adds a row here.
const STRATEGIES: [Strategy; 1] = [Strategy::Conservative];

/// The runs that the figures need beside those of the table.
pub(super) fn jobs(table: &[Job]) -> Vec<(Purpose, Job)> {
    let default = PrbvhSettings::default().mu;
    let mu = MU.map(|mu| (Purpose::Mu, published(Settings::default(), mu)));
    let strategies = STRATEGIES.iter().map(|&strategy| {
        let optimizer = PrbvhSettings::default().with(|s| s.strategy = strategy);
        let settings = Settings::default().with(|s| s.prbvh = optimizer);
        (Purpose::Strategy, published(settings, default))
    });
    let initial = starts().map(|initial| {
        let settings = Settings::default().with(|s| s.initial = initial);
        (Purpose::Initial, worst_first(settings))
    });
    let is_in_table =
        |job: &Job| table.iter().any(|other| settings(other).is_some() && settings(other) == settings(job));
    mu.into_iter().chain(strategies).chain(initial).filter(|(_, job)| !is_in_table(job)).collect()
}

fn settings(job: &Job) -> Option<&Settings> {
    match &job.builder {
        Builder::Pipeline(settings) => Some(settings),
        _ => None,
    }
}

/// The run for a figure.
pub(super) fn for_figure(run: OptimizerRun, purpose: Purpose) -> OptimizerRun {
    OptimizerRun { purpose, ..run }
}

#[cfg(test)]
mod tests {
    use super::super::methods::{MethodSettings, jobs as table_jobs};
    use super::*;

    #[test]
    fn what_the_table_has_is_not_run_again() {
        let table = table_jobs(&[], &MethodSettings::default()).unwrap();
        let mu: Vec<_> = jobs(&table).iter().filter(|(why, _)| *why == Purpose::Mu).map(|(_, job)| job.mu).collect();
        assert_eq!(mu, [2, 6, 12, 16, 24, 32].map(Some));
        assert!(jobs(&table).iter().any(|(why, _)| *why == Purpose::Initial));
        let all = jobs(&[]);
        assert_eq!(all.iter().filter(|(why, _)| *why == Purpose::Mu).count(), MU.len());
    }
}
