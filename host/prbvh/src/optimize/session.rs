//! A run on a device: what both orders of search share.

use super::areas::{Measure, TreeAreas};
use super::ledger::{Ledger, Report};
use super::moves::Moves;
use super::pace::Pace;
use super::{IterationRow, Limits, StopReason, set_relative_errors};
use crate::build::{DeviceTree, Scratch};
use crate::device::{Buffer, Device, DeviceError, DeviceKind, Recording, Timing};
use prbvh_kernel::prbvh::worst::books::EPOCH;
use prbvh_kernel::status::{
    APPLIED, FAULT_BROKEN_TREE, FAULT_SEARCH_STEPS, FAULT_TREELET, FAULTS, FOUND, GOES_ON, HURRY, MOST_STEPS, MU,
    OWNED, PREDICTED, REPORT_WORDS, SEARCHED, VERDICT, VISITS,
};
use prbvh_kernel::sum;
use std::ops::ControlFlow;
use std::time::Instant;

/// What an optimiser did; the tree is the best one.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Outcome {
    /// Row 0 is the initial tree.
    pub rows: Vec<IterationRow>,
    /// Why it stopped.
    pub stop: StopReason,
    /// Time of every command.
    pub timings: Vec<Timing>,
    /// Bytes of the device's buffers while the iterations ran; of the host's, if it was the host that optimised.
    pub working_bytes: u64,
}

impl Outcome {
    /// The row of the best tree.
    #[must_use]
    pub fn best(&self) -> &IterationRow {
        let better = |a: &&IterationRow, b: &&IterationRow| a.cost.total_cmp(&b.cost);
        self.rows.iter().min_by(better).unwrap_or(&self.rows[0])
    }
}

/// Sees the tree's every row, and may break.
pub(super) type Observe<'a> = &'a mut dyn FnMut(&IterationRow, &DeviceTree, &mut dyn Device) -> ControlFlow<()>;

/// Seconds since the start of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    /// In all.
    time_s: f64,
    /// On the device.
    device_s: f64,
}

/// # Errors
/// With the faults of a report, if it has any.
pub(super) fn no_fault(device: &dyn Device, faults: u32) -> Result<(), DeviceError> {
    let meanings = [
        (FAULT_SEARCH_STEPS, "a search did not end as it must"),
        (FAULT_BROKEN_TREE, "the links are no tree"),
        (FAULT_TREELET, "the work on a treelet did not end"),
    ];
    let told: Vec<&str> = meanings.iter().filter(|(bit, _)| faults & bit != 0).map(|(_, meaning)| *meaning).collect();
    if faults == 0 {
        return Ok(());
    }
    let problem = format!("fault {faults:#x}: {}", told.join(", "));
    Err(DeviceError::Kernel { kernel: "the optimiser", problem, device: device.info().name.clone() })
}

/// What became of the rounds of a submission.
#[derive(Clone, Debug)]
pub(super) struct Made {
    /// For each that was made: whether four times as many nodes are wanted after it.
    pub(super) hurries: Vec<bool>,
    /// Of the last one.
    pub(super) verdict: u32,
    /// Whether the observer goes on.
    pub(super) flow: ControlFlow<()>,
}

/// A run on a device, whatever the order.
#[derive(Debug)]
pub(super) struct Session<'a> {
    pub(super) tree: &'a DeviceTree,
    pub(super) internal: u32,
    pub(super) node_count: u32,
    pub(super) scratch: Scratch,
    pub(super) moves: Moves,
    pub(super) measure: Measure,
    pub(super) rows: Vec<IterationRow>,
    start: Instant,
    timings: Vec<Timing>,
    device_s: f64,
    /// Number of the best tree.
    epoch: u32,
}

impl<'a> Session<'a> {
    /// Room for `found` moves at a time and `report` rows of a report.
    pub(super) fn new(
        device: &mut dyn Device,
        tree: &'a DeviceTree,
        found: u32,
        report: u32,
    ) -> Result<Self, DeviceError> {
        let mut scratch = Scratch::default();
        let moves = Moves::new(device, &mut scratch, tree, found as usize, REPORT_WORDS * report)?;
        let measure = Measure::new(device, &mut scratch, tree, &moves.report)?;
        Ok(Self {
            tree,
            internal: tree.references - 1,
            node_count: DeviceTree::node_count(tree.references),
            scratch,
            moves,
            measure,
            rows: Vec::new(),
            start: Instant::now(),
            timings: Vec::new(),
            device_s: 0.0,
            epoch: 0,
        })
    }

    /// Measures the tree and makes row 0.
    pub(super) fn begin(
        &mut self,
        device: &mut dyn Device,
        areas: Option<TreeAreas>,
        mu: u32,
    ) -> Result<TreeAreas, DeviceError> {
        match areas {
            Some(areas) => Ok(self.begin_with(areas, mu)),
            None => {
                let (areas, timings) = self.measure.refitted_areas(device)?;
                self.take_note(timings);
                self.no_fault(device)?;
                Ok(self.begin_with(areas, mu))
            }
        }
    }

    fn begin_with(&mut self, areas: TreeAreas, mu: u32) -> TreeAreas {
        self.rows.push(IterationRow {
            mu,
            time_s: self.elapsed_s(),
            device_s: self.device_s,
            cost: areas.cost(self.tree.references),
            ..IterationRow::default()
        });
        areas
    }

    pub(super) fn elapsed_s(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    pub(super) fn elapsed(&self) -> std::time::Duration {
        self.start.elapsed()
    }

    /// The last row.
    pub(super) fn row(&self) -> &IterationRow {
        &self.rows[self.rows.len() - 1]
    }

    pub(super) fn take_note(&mut self, timings: Vec<Timing>) {
        self.device_s += timings.iter().map(|timing| timing.seconds).sum::<f64>();
        self.timings.extend(timings);
    }

    /// Of work that the host did while the device waited, or on its threads if it is the CPU.
    pub(super) fn take_note_of_host(&mut self, kind: DeviceKind, timing: Timing) {
        if kind == DeviceKind::Cpu {
            self.device_s += timing.seconds;
        }
        self.timings.push(timing);
    }

    pub(super) fn submit(&mut self, device: &mut dyn Device, recording: &Recording) -> Result<(), DeviceError> {
        let timings = device.run(recording)?;
        self.take_note(timings);
        Ok(())
    }

    /// Records that the host reads the reports of so many iterations, and the number of the best tree.
    pub(super) fn record_reports(&self, recording: &mut Recording, iterations: usize) {
        recording.fetch("search", &self.moves.report, 4 * REPORT_WORDS as usize * iterations);
        recording.fetch("search", &self.moves.books, 4 * (EPOCH + 1));
    }

    /// Reads the reports of iterations that began at `start`, took `timings`, and of which each ends before one of these in `ends`; returns the row of the report
    /// of each that was made, and when it ended.
    fn read_rows(
        &mut self,
        device: &mut dyn Device,
        start: Clock,
        timings: &[Timing],
        ends: &[usize],
    ) -> Result<Vec<(Report, Clock)>, DeviceError> {
        let Clock { time_s: before, device_s: device_before } = start;
        let mut words = vec![0u32; REPORT_WORDS as usize * ends.len()];
        device.download(&self.moves.report, bytemuck::cast_slice_mut(&mut words))?;
        let mut books = [0u32; EPOCH + 1];
        device.download(&self.moves.books, bytemuck::cast_slice_mut(&mut books))?;
        self.epoch = books[EPOCH];
        // Those after the end of the rounds were not made.
        let (rows, _) = words.as_chunks();
        let made = rows.iter().position(|row: &Report| row[VERDICT] != GOES_ON).map_or(rows.len(), |last| last + 1);
        let ends = &ends[..made];
        let passed = self.elapsed_s() - before;
        let device_s = |commands: &[Timing]| commands.iter().map(|timing| timing.seconds).sum::<f64>();
        let all = device_s(timings);
        let rows = rows.iter().zip(ends).enumerate();
        let rows = rows.map(|(k, (&report, &end))| {
            let part = device_s(timings.get(..end).unwrap_or_default());
            // What the host takes is shared out among the rows like the time on the device.
            let share = if all > 0.0 { part / all } else { (k + 1) as f64 / ends.len() as f64 };
            (report, Clock { time_s: before + share * passed, device_s: device_before + part })
        });
        let rows = rows.collect();
        self.take_note(timings.to_vec());
        Ok(rows)
    }

    /// The time now.
    pub(super) fn clock(&self) -> Clock {
        Clock { time_s: self.elapsed_s(), device_s: self.device_s }
    }

    /// Sees to it that the first row of the report has no fault.
    fn no_fault(&self, device: &mut dyn Device) -> Result<(), DeviceError> {
        let mut report = Report::default();
        device.download(&self.moves.report, bytemuck::cast_slice_mut(&mut report))?;
        no_fault(device, report[FAULTS])
    }

    /// Adds the row of a round.
    fn push_round(&mut self, report: &Report, ledger: &mut Ledger, clock: Clock) {
        let predicted = sum::to_f64(report[PREDICTED], report[PREDICTED + 1], ledger.scale);
        let row = IterationRow {
            iteration: self.row().iteration + 1,
            // Worst first has none.
            mu: report[MU].max(1),
            time_s: clock.time_s,
            device_s: clock.device_s,
            cost: ledger.note(report),
            predicted_decrease: ledger.areas.cost_of(predicted),
            searched: report[SEARCHED],
            visits: report[VISITS],
            found: report[FOUND],
            owned: report[OWNED],
            applied: report[APPLIED],
            most_steps: report[MOST_STEPS],
            ..IterationRow::default()
        };
        self.rows.push(row);
    }

    /// Submits rounds, of which each ends before a command in `ends`, and takes note of those that were made.
    pub(super) fn run_rounds(
        &mut self,
        device: &mut dyn Device,
        mut recording: Recording,
        ends: &[usize],
        of: (&mut Ledger, &mut Pace),
        observe: Observe<'_>,
    ) -> Result<Made, DeviceError> {
        let start = self.clock();
        self.record_reports(&mut recording, ends.len());
        let timings = device.run(&recording)?;
        self.note_rounds(device, start, &timings, ends, of, observe)
    }

    /// Takes note of the rounds of a submission of which those were made that came before the end: they began at `start`, took `timings`, and each ends before
    /// one of these in `ends`.
    pub(super) fn note_rounds(
        &mut self,
        device: &mut dyn Device,
        start: Clock,
        timings: &[Timing],
        ends: &[usize],
        (ledger, pace): (&mut Ledger, &mut Pace),
        observe: Observe<'_>,
    ) -> Result<Made, DeviceError> {
        let first = self.rows.len();
        let reports = self.read_rows(device, start, timings, ends)?;
        pace.note(reports.len(), self.elapsed_s() - start.time_s);
        let (mut verdict, mut hurries) = (GOES_ON, Vec::new());
        for (report, clock) in reports {
            no_fault(device, report[FAULTS])?;
            hurries.push(report[HURRY] != 0);
            self.push_round(&report, ledger, clock);
            verdict = report[VERDICT];
        }
        // The tree is that of the last row.
        let flow = self.rows[first..].iter().try_for_each(|row| observe(row, self.tree, device));
        Ok(Made { hurries, verdict, flow })
    }

    /// Why there is no other iteration, if there is none.
    pub(super) fn ended(&self, limits: &Limits) -> Option<StopReason> {
        if limits.is_target(self.row().cost) {
            return Some(StopReason::Target);
        }
        limits.used_up(self.row().iteration, self.elapsed())
    }

    /// The row of an iteration that built a new top, after which the tree has this cost.
    pub(super) fn push_new_top(&mut self, cost: f64, visits: u32) {
        let clock = self.clock();
        let before = self.row();
        let row = IterationRow {
            iteration: before.iteration + 1,
            mu: 1,
            time_s: clock.time_s,
            device_s: clock.device_s,
            cost,
            predicted_decrease: before.cost - cost,
            visits,
            ..IterationRow::default()
        };
        self.rows.push(row);
    }

    /// Records that the best tree comes back, with all boxes made anew: that of the rounds of which was taken note last.
    pub(super) fn record_restore(&mut self, recording: &mut Recording) {
        self.moves.record_restore(recording, self.internal, self.epoch);
        self.measure.record_refit(recording);
        self.measure.record_no_arrivals(recording);
    }

    /// Records that nodes get other children, with all boxes made anew.
    pub(super) fn record_graft(&mut self, recording: &mut Recording, grafts: &Buffer) {
        self.moves.record_graft(recording, grafts);
        self.measure.record_refit(recording);
        self.measure.record_no_arrivals(recording);
    }

    /// Brings the best tree back, with all boxes made anew.
    pub(super) fn restore_best(&mut self, device: &mut dyn Device) -> Result<(), DeviceError> {
        let mut recording = Recording::new();
        self.record_restore(&mut recording);
        self.submit(device, &recording)
    }

    /// Makes all boxes anew, and sees to it that the tree is one.
    pub(super) fn refit_all(&mut self, device: &mut dyn Device) -> Result<(), DeviceError> {
        let mut recording = Recording::new();
        recording.clear("refit", &self.moves.report);
        self.measure.record_refit(&mut recording);
        self.measure.record_internal(&mut recording);
        recording.fetch("refit", &self.moves.report, size_of::<Report>());
        self.submit(device, &recording)?;
        self.no_fault(device)
    }

    /// Gives the memory back.
    pub(super) fn finish(mut self, device: &mut dyn Device, stop: StopReason, working_bytes: u64) -> Outcome {
        self.scratch.free(device);
        set_relative_errors(&mut self.rows);
        Outcome { rows: self.rows, stop, timings: self.timings, working_bytes }
    }
}
