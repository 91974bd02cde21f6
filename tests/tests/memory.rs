//! Most memory of a whole run: scene, device, validation and the tree handed out.

use peak_alloc::PeakAlloc;
use prbvh::build::{Bins, DEFAULT_HPLOC_RADIUS, DEFAULT_PASSES, DEFAULT_RADIUS, KMeansSettings, TreeletSize};
use prbvh::collapse::CollapseSettings;
use prbvh::device::cpu::CpuDevice;
use prbvh::device::{Buffer, Device, DeviceError, Layer};
use prbvh::optimize::{CurrentTree, IterationRow, Limits, PrbvhSettings, RbvhSettings, RotationSettings, Strategy};
use prbvh::pipeline::{Initial, Optimizer, Settings, optimize_watched};
use prbvh::plan::Plan;
use prbvh::scene::built_in;
use prbvh_cpu_sim::OWN_PAGES;
use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

/// One run at a time: all of them share the count.
static RUN: Mutex<()> = Mutex::new(());

const TRIANGLES: usize = 100_000;
/// Most bytes a triangle, input included.
const MOST: usize = 250;

/// The CPU device with the memory of its large buffers counted, which the allocator does not see.
struct Counted {
    device: CpuDevice,
    large: usize,
    most: usize,
}

/// Its bytes, if the allocator does not see them.
fn large(buffer: &Buffer) -> usize {
    let bytes = buffer.length * buffer.element_bytes;
    if bytes >= OWN_PAGES { bytes } else { 0 }
}

impl Counted {
    /// What was allocated at most while the device held what it holds now.
    fn note(&mut self) {
        self.most = self.most.max(ALLOCATOR.peak_usage() + self.large);
        ALLOCATOR.reset_peak_usage();
    }
}

impl Layer for Counted {
    fn inner(&self) -> &dyn Device {
        &self.device
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        &mut self.device
    }

    fn allocate(&mut self, label: &'static str, length: usize, element_bytes: usize) -> Result<Buffer, DeviceError> {
        self.note();
        let buffer = Device::allocate(&mut self.device, label, length, element_bytes)?;
        self.large += large(&buffer);
        self.note();
        Ok(buffer)
    }

    fn free(&mut self, buffer: Buffer) {
        self.note();
        self.large -= large(&buffer);
        Device::free(&mut self.device, buffer);
    }
}

fn of_prbvh(prbvh: PrbvhSettings) -> Settings {
    Settings::default().with(|s| s.prbvh = prbvh.with(|s| s.limits = Limits::iterations(3)))
}

/// Most bytes a triangle at any time from before the scene is there until the tree is handed out.
fn peak(settings: &Settings, observe: &mut dyn FnMut(&IterationRow, CurrentTree<'_>) -> ControlFlow<()>) -> usize {
    let before = ALLOCATOR.current_usage();
    let scene = built_in(TRIANGLES);
    // What the benchmark measures, too: a run, not how its scene came about.
    ALLOCATOR.reset_peak_usage();
    let mut device = Counted { device: CpuDevice::new(2).unwrap(), large: 0, most: 0 };
    let plan = Plan::of(&scene, Layer::info(&device), settings, &[]).unwrap();
    let result = optimize_watched(plan, &scene, &mut device, settings, observe).unwrap();
    device.note();
    let peak = device.most - before;
    assert_eq!(result.tree.triangle_order.len(), TRIANGLES);
    peak / TRIANGLES
}

#[test]
fn a_whole_run_keeps_to_its_bytes() {
    let _guard = RUN.lock().unwrap_or_else(PoisonError::into_inner);
    let published = PrbvhSettings::published();
    let with = |settings: &Settings, initial| settings.clone().with(|s| s.initial = initial);
    let default = of_prbvh(PrbvhSettings::default());
    let adaptive = Some(CollapseSettings::default());
    let rbvh = RbvhSettings::default().with(|s| s.limits = Limits::iterations(1));
    let rotations = RotationSettings::default().with(|s| s.annealing_passes = 1);
    let runs = [
        ("by default", default.clone()),
        ("published", of_prbvh(published.clone())),
        ("conservative", of_prbvh(published.with(|s| s.strategy = Strategy::Conservative))),
        ("ploc", with(&default, Initial::Ploc { radius: DEFAULT_RADIUS })),
        ("atrbvh", with(&default, Initial::Atrbvh { treelet: TreeletSize::DEFAULT })),
        ("trbvh", with(&default, Initial::Trbvh { passes: DEFAULT_PASSES })),
        ("hploc", with(&default, Initial::Hploc { radius: DEFAULT_HPLOC_RADIUS })),
        ("kmeans", with(&default, Initial::KMeans { kmeans: KMeansSettings::default() })),
        ("sweep", with(&default, Initial::SahSweep)),
        ("binned", with(&default, Initial::SahBinned { bins: Bins::DEFAULT })),
        ("adaptive leaves", default.clone().with(|s| s.adaptive = adaptive)),
        ("folded", default.clone().with(|s| s.fold_duplicates = true)),
        (
            "folded, adaptive leaves",
            default.clone().with(|s| {
                s.fold_duplicates = true;
                s.adaptive = adaptive;
            }),
        ),
        ("no optimiser", default.clone().with(|s| s.optimizer = Optimizer::None)),
        ("rbvh", default.clone().with(|s| s.optimizer = Optimizer::Rbvh(rbvh))),
        ("rotations", default.clone().with(|s| s.optimizer = Optimizer::Rotations(rotations))),
    ];
    let measured = runs.map(|(name, settings)| (name, peak(&settings, &mut |_, _| ControlFlow::Continue(()))));
    eprintln!("bytes a triangle: {measured:?}");
    let over: Vec<_> = measured.iter().filter(|(_, bytes)| *bytes > MOST).collect();
    assert!(over.is_empty(), "more than {MOST} bytes a triangle: {over:?}");
}

#[test]
fn a_planted_copy_of_the_tree_is_too_much() {
    let _guard = RUN.lock().unwrap_or_else(PoisonError::into_inner);
    let mut copies = Vec::new();
    let bytes = peak(&of_prbvh(PrbvhSettings::default()), &mut |_, mut tree| {
        if copies.is_empty() {
            copies.push(tree.nodes().unwrap());
        }
        ControlFlow::Continue(())
    });
    assert_eq!(copies.len(), 1);
    assert!(bytes > MOST, "{bytes} bytes a triangle");
}
