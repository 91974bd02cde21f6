//! lavapipe ends an invocation's loops after 65,535 rounds of them all, in silence: what is not done must be a fault.

use bytemuck::Zeroable;
use prbvh_kernel::Kernel;
use prbvh_kernel::prbvh::worst::RoundParams;
use prbvh_kernel::prbvh::worst::books::{BOOKS_WORDS, CLOSE};
use prbvh_kernel::prbvh::{DUAL, Move, PrbvhParams, WON};
use prbvh_kernel::status::{FAULTS, MARKED, REPORT_WORDS};
use prbvh_tests::compare::Case;
use prbvh_tests::devices::with_devices;
use prbvh_tests::oracle::row_comb;

/// A climb from the lowest node of a comb comes to the root, or there is a fault.
fn check_climb(leaves: u32) {
    let nodes = row_comb(leaves).encode();
    let internal = nodes.len() / 2;
    let lowest = internal as u32 - 1;
    let found = [Move { area_decrease: 1.0, input: lowest | WON, output: lowest, other: lowest }];
    let params = PrbvhParams { count: 1, flags: DUAL, scale: 1.0, ..PrbvhParams::every(1, 0, nodes.len() as u32) };
    let books = vec![0; BOOKS_WORDS as usize];
    let close = RoundParams {
        count: 1,
        nodes: nodes.len() as u32,
        root_area: 1.0,
        scale: 1.0,
        page: CLOSE,
        ..Zeroable::zeroed()
    }
    .wanting(0, 1);
    with_devices(|devices| {
        for (name, device) in devices {
            let device = &mut **device;
            let mark =
                Case::new(Kernel::WorstMark, 1, &params).with(&found).with(&nodes).zeros(internal).zeros(internal);
            let mark = mark.zeros(2 * internal).with(&books).zeros(REPORT_WORDS as usize).run_on(device).unwrap();
            let refit = Case::new(Kernel::WorstRefit, 1, &params).with(&found).with(&nodes);
            let refit = refit.with(&mark.get::<u32>("ways")).with(&mark.get::<u32>("keys")).zeros(2 * internal);
            let refit = refit.with(&mark.get::<u32>("books")).with(&mark.get::<u32>("report"));
            let refit = refit.run_on(device).unwrap();
            let closed = Case::new(Kernel::WorstBooks, 1, &close).with(&refit.get::<u32>("books")).zeros(2 * internal);
            let report: Vec<u32> = closed.with(&refit.get::<u32>("report")).run_on(device).unwrap().get("report");
            let (marked, faults) = (report[MARKED] as usize, report[FAULTS]);
            assert!(marked == internal || faults != 0, "{name}: {marked} of {internal} marked, and no fault");
            assert!(leaves > 60_000 || faults == 0, "{name}: {faults}");
        }
    });
}

#[test]
fn a_climb_of_twenty_thousand_levels_comes_to_the_root() {
    check_climb(20_000);
}

#[test]
fn a_climb_beyond_the_budget_is_no_silent_one() {
    check_climb(70_000);
}
