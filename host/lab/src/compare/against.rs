//! How much sooner PRBVH reaches a cost that RBVH reaches too (Meister & Bittner 2018, §6: "two orders of magnitude").

use super::{AgainstRbvh, OptimizerRun};

/// Compares the times to the higher of the two lowest costs, which both runs reach. Times count from the triangles: that of the initial
/// tree is in them. None if a run has no rows or its costs are no numbers.
#[must_use]
pub fn against_rbvh(prbvh: &OptimizerRun, rbvh: &OptimizerRun) -> Option<AgainstRbvh> {
    let cost = prbvh.lowest_cost()?.max(rbvh.lowest_cost()?);
    let (prbvh_s, rbvh_s) = (seconds_to(prbvh, cost)?, seconds_to(rbvh, cost)?);
    Some(AgainstRbvh { cost, rbvh_s, prbvh_s, speed_up: rbvh_s / prbvh_s })
}

fn seconds_to(run: &OptimizerRun, cost: f64) -> Option<f64> {
    run.rows.iter().find(|row| row.cost <= cost).map(|row| run.build_s + row.time_s)
}

#[cfg(test)]
mod tests {
    use super::super::Purpose;
    use super::*;
    use prbvh::optimize::IterationRow;

    fn run(build_s: f64, points: &[(f64, f64)]) -> OptimizerRun {
        let row = |&(time_s, cost): &(f64, f64)| {
            IterationRow::default().with(|row| {
                row.time_s = time_s;
                row.cost = cost;
            })
        };
        OptimizerRun {
            method: String::new(),
            purpose: Purpose::OneThread,
            initial: "lbvh".to_owned(),
            strategy: String::new(),
            mu: 0,
            device: String::new(),
            build_s,
            build_device_s: None,
            rows: points.iter().map(row).collect(),
            phases: Vec::new(),
            plan: Vec::new(),
        }
    }

    #[test]
    fn the_cost_is_the_one_that_both_reach() {
        let rbvh = run(1.0, &[(0.0, 100.0), (20.0, 70.0), (49.0, 60.0), (99.0, 60.5)]);
        let better = run(1.0, &[(0.0, 100.0), (1.0, 61.0), (1.5, 59.0), (3.0, 58.0)]);
        let expected = AgainstRbvh { cost: 60.0, rbvh_s: 50.0, prbvh_s: 2.5, speed_up: 20.0 };
        assert_eq!(against_rbvh(&better, &rbvh), Some(expected));
        let worse = run(1.0, &[(0.0, 100.0), (1.0, 71.0), (3.0, 70.0)]);
        let expected = AgainstRbvh { cost: 70.0, rbvh_s: 21.0, prbvh_s: 4.0, speed_up: 5.25 };
        assert_eq!(against_rbvh(&worse, &rbvh), Some(expected));
        let same = against_rbvh(&rbvh, &rbvh).unwrap();
        assert_eq!((same.cost, same.speed_up), (60.0, 1.0));
    }

    #[test]
    fn without_costs_there_is_no_answer() {
        let good = run(1.0, &[(0.0, 100.0)]);
        for bad in [run(1.0, &[]), run(1.0, &[(0.0, f64::NAN)])] {
            assert_eq!(against_rbvh(&bad, &good), None);
            assert_eq!(against_rbvh(&good, &bad), None);
        }
    }
}
