//! A run that somebody asks to end: it ends soon, with the best tree so far.

use prbvh::build::{Bins, DEFAULT_HPLOC_RADIUS, DEFAULT_PASSES, DEFAULT_RADIUS, KMeansSettings, TreeletSize};
use prbvh::bvh;
use prbvh::device::cpu::CpuDevice;
use prbvh::device::{self, Command, Device, DeviceError, Recording, Timing};
use prbvh::optimize::{IterationRow, Order, PrbvhSettings, RbvhSettings, RotationSettings, StopReason};
use prbvh::pipeline::{Initial, Optimizer, PipelineError, Settings, optimize};
use prbvh::scene::built_in;
use prbvh::stop::Stop;
use std::ops::ControlFlow;
use std::time::Duration;

/// Runs after an end was asked for: the best tree is brought back and read.
const MOST_RUNS: usize = 12;

/// A device that asks for an end once it has run so many recordings with a command of a label.
struct Asks {
    device: CpuDevice,
    label: &'static str,
    left: usize,
    stop: Stop,
    runs_since: usize,
}

impl device::Layer for Asks {
    fn inner(&self) -> &dyn Device {
        &self.device
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        &mut self.device
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        self.runs_since += usize::from(self.stop.is_asked());
        let is_it =
            |(label, command): &(&str, Command)| *label == self.label && matches!(command, Command::Dispatch(_));
        if recording.commands().iter().any(is_it) {
            self.left = self.left.saturating_sub(1);
            if self.left == 0 {
                self.stop.ask();
            }
        }
        self.device.run(recording)
    }
}

fn asks(label: &'static str, left: usize) -> Asks {
    let device = CpuDevice::new(2).unwrap();
    Asks { device, label, left, stop: Stop::default(), runs_since: 0 }
}

#[test]
fn a_run_ends_soon_wherever_it_is() {
    let scene = built_in(6000);
    let published = PrbvhSettings::published();
    let worst_first = PrbvhSettings::default();
    assert_eq!(worst_first.order, Order::WorstFirst);
    let go_on = &mut |_: &IterationRow| ControlFlow::Continue(());
    // Before the contenders of a new top, too: each top is read once.
    let cases = [
        (&published, "search", 3),
        (&worst_first, "search", 3),
        (&worst_first, "read top", 1),
        (&worst_first, "read top", 2),
    ];
    for (prbvh, label, left) in cases {
        let mut settings = Settings::default().with(|s| s.prbvh = prbvh.clone());
        // Of rounds that go together the first may be the last to be asked.
        settings.prbvh.news = Duration::ZERO;
        let mut device = asks(label, left);
        assert_eq!(optimize(&scene, &mut device, &settings, go_on).unwrap().outcome.stop, StopReason::Converged);
        assert!(device.runs_since > MOST_RUNS, "{label} {left}: {} runs show nothing", device.runs_since);

        let mut device = asks(label, left);
        settings.prbvh.limits.stop = Some(device.stop.clone());
        let result = optimize(&scene, &mut device, &settings, go_on).unwrap();
        assert_eq!(result.outcome.stop, StopReason::Cancelled, "{label}");
        assert!(device.runs_since <= MOST_RUNS, "{label} {left}: {} runs", device.runs_since);
        assert!(bvh::validate(&result.tree, Some(&scene.triangles)).is_ok());
        assert!(result.quality.sah_cost < result.initial.sah_cost, "{label} {left}");
        let best = result.outcome.best().cost;
        assert!((result.quality.sah_cost / best - 1.0).abs() < 1e-4, "{label}: {best}, {}", result.quality.sah_cost);
    }
}

#[test]
fn rbvh_ends_within_a_batch() {
    let scene = built_in(6000);
    let stop = Stop::default();
    let mut rbvh = RbvhSettings::default();
    rbvh.limits.stop = Some(stop.clone());
    let settings = Settings::default().with(|s| s.optimizer = Optimizer::Rbvh(rbvh));
    let mut device = CpuDevice::new(1).unwrap();
    let ask_at_once = &mut |row: &IterationRow| {
        if row.iteration == 2 {
            stop.ask();
        }
        ControlFlow::Continue(())
    };
    let result = optimize(&scene, &mut device, &settings, ask_at_once).unwrap();
    assert_eq!(result.outcome.stop, StopReason::Cancelled);
    assert_eq!(result.outcome.rows.last().unwrap().iteration, 2);
    assert!(result.quality.sah_cost < result.initial.sah_cost);
}

#[test]
fn a_stop_that_nobody_asks_changes_nothing() {
    let scene = built_in(6000);
    let mut device = CpuDevice::new(2).unwrap();
    let mut settings = Settings::default();
    let go_on = &mut |_: &IterationRow| ControlFlow::Continue(());
    let without = optimize(&scene, &mut device, &settings, go_on).unwrap();
    settings.prbvh.limits.stop = Some(Stop::default());
    let with = optimize(&scene, &mut device, &settings, go_on).unwrap();
    assert_eq!(bvh::tree_hash(&with.tree), bvh::tree_hash(&without.tree));
    assert_eq!(with.outcome.stop, without.outcome.stop);
}

/// While a tree is built there is none: an end is an error, soon, and leaves nothing behind.
#[test]
fn an_end_while_a_tree_is_built_is_an_error_by_name() {
    let scene = built_in(6000);
    let go_on = &mut |_: &IterationRow| -> ControlFlow<()> { panic!("there is no tree") };
    for (initial, label) in [
        (Initial::Lbvh, "morton"),
        (Initial::Lbvh, "hierarchy"),
        (Initial::Ploc { radius: DEFAULT_RADIUS }, "nearest"),
        (Initial::Atrbvh { treelet: TreeletSize::default() }, "restructure"),
        (Initial::Trbvh { passes: DEFAULT_PASSES }, "restructure"),
        (Initial::Hploc { radius: DEFAULT_HPLOC_RADIUS }, "merge"),
        (Initial::KMeans { kmeans: KMeansSettings::default() }, "assign"),
        (Initial::KMeans { kmeans: KMeansSettings::default() }, "halve"),
    ] {
        let mut device = asks(label, 1);
        let mut settings = Settings::default().with(|s| s.initial = initial);
        settings.prbvh.limits.stop = Some(device.stop.clone());
        let refused = optimize(&scene, &mut device, &settings, go_on).unwrap_err();
        assert!(matches!(refused, PipelineError::Device(DeviceError::Stopped)), "{label}: {refused}");
        assert!(device.stop.is_asked() && device.runs_since == 0, "{label}: {} runs", device.runs_since);
        assert_eq!(device.memory().bytes, 0, "{label}");
    }
    for initial in [Initial::SahSweep, Initial::SahBinned { bins: Bins::DEFAULT }] {
        let mut settings = Settings::default().with(|s| s.initial = initial);
        let stop = Stop::default();
        stop.ask();
        settings.prbvh.limits.stop = Some(stop);
        let refused = optimize(&scene, &mut CpuDevice::new(1).unwrap(), &settings, go_on).unwrap_err();
        assert!(matches!(refused, PipelineError::Device(DeviceError::Stopped)), "{refused}");
    }
}

/// Time that is up before the optimiser begins leaves the initial tree.
#[test]
fn time_that_passes_while_a_tree_is_built_counts() {
    struct Slow(CpuDevice);
    impl device::Layer for Slow {
        fn inner(&self) -> &dyn Device {
            &self.0
        }

        fn inner_mut(&mut self) -> &mut dyn Device {
            &mut self.0
        }

        fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
            std::thread::sleep(Duration::from_millis(30));
            self.0.run(recording)
        }
    }
    let scene = built_in(2000);
    let go_on = &mut |_: &IterationRow| ControlFlow::Continue(());
    let rotations = Optimizer::Rotations(RotationSettings::default());
    for optimizer in [Optimizer::Prbvh, Optimizer::Rbvh(RbvhSettings::default()), rotations] {
        let mut settings = Settings::default().with(|s| s.optimizer = optimizer);
        settings.limits_mut().max_time = Some(Duration::from_millis(20));
        let result = optimize(&scene, &mut Slow(CpuDevice::new(1).unwrap()), &settings, go_on).unwrap();
        assert_eq!((result.outcome.stop, result.outcome.rows.len()), (StopReason::MaxTime, 1));
        assert_eq!(result.quality, result.initial);
        assert!(bvh::validate(&result.tree, Some(&scene.triangles)).is_ok());
    }
}
