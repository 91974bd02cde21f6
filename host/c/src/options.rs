//! What a caller may ask for.

use crate::input::{check_pointer, text};
use crate::status::Failure;
use bytemuck::Zeroable;
use prbvh::build::{Bins, DEFAULT_RADIUS};
use prbvh::bvh::MaxDepth;
use prbvh::device::{DeviceChoice, Selection};
use prbvh::pipeline::{Initial, Optimizer, Settings};
use std::ffi::{c_char, c_int, c_void};
use std::time::Duration;

/// Where it runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum PrbvhDevice {
    /// The best GPU there is, else the CPU.
    Auto = 0,
    /// The CPU.
    Cpu = 1,
    /// The best Vulkan device.
    Vulkan = 2,
    /// The Vulkan device with the number `device_index`.
    VulkanIndex = 3,
}

/// Which tree is optimised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum PrbvhInitial {
    /// LBVH: along a Morton curve.
    Lbvh = 0,
    /// PLOC: neighbours along the curve merge.
    Ploc = 1,
    /// Binned SAH, on the CPU.
    SahBinned = 2,
    /// SAH over all splits, on the CPU.
    SahSweep = 3,
}

/// What makes the tree better.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum PrbvhOptimizer {
    /// PRBVH: reinsertions, the worst nodes first.
    Prbvh = 0,
    /// RBVH: reinsertions one after another, on one thread of the CPU.
    Rbvh = 1,
    /// Rotations.
    Rotations = 2,
    /// Nothing: the initial tree comes out.
    None = 3,
}

/// How far a run is.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct PrbvhProgress {
    /// sizeof(PrbvhProgress) of the library.
    pub size: usize,
    /// Iteration; 0 is the initial tree.
    pub iteration: u32,
    /// Always 0.
    pub reserved: u32,
    /// Seconds since the optimiser started.
    pub seconds: f64,
    /// SAH cost now, one primitive per leaf.
    pub cost: f64,
}

/// Is told each iteration, on the thread that called. What it returns goes on where it is 0, and else ends the run with the best tree so far.
/// It must come back: no longjmp, no exception.
pub type PrbvhProgressFn = Option<unsafe extern "C" fn(user: *mut c_void, progress: *const PrbvhProgress) -> c_int>;

/// Options. All zeros but for the size are the defaults:
///
/// PrbvhOptions options = {0};
/// options.size = sizeof options;
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct PrbvhOptions {
    /// sizeof(PrbvhOptions): which version of it this is. What a library does not know must be 0.
    pub size: usize,
    /// A PrbvhDevice.
    pub device: u32,
    /// For PRBVH_DEVICE_VULKAN_INDEX.
    pub device_index: u32,
    /// Threads of the CPU; 0: one per core. They end with the call.
    pub threads: u32,
    /// A PrbvhInitial; not looked at where there is an `initial_name`.
    pub initial: u32,
    /// Most iterations; 0: those of the library.
    pub max_iterations: u32,
    /// Most primitives of a leaf; 0 and 1: one in each. More where that costs less.
    pub max_leaf: u32,
    /// Most links from the root to a leaf; 0: 63, UINT32_MAX: any.
    pub max_depth: u32,
    /// A PrbvhOptimizer.
    pub optimizer: u32,
    /// No iteration starts after so many seconds; 0: no limit.
    pub max_seconds: f64,
    /// No iteration starts at this cost or less; 0: no target.
    pub target_cost: f64,
    /// Is told each iteration and may end the run; or NULL.
    pub progress: PrbvhProgressFn,
    /// For `progress`.
    pub user: *mut c_void,
    /// Which tree is optimised, by its name with parameters as the command has it: "hploc", "kmeans:q3", "aac:delta=8,epsilon=0.15". NULL: `initial`.
    pub initial_name: *const c_char,
}

// SAFETY: zeros are 0, NULL and no function.
unsafe impl Zeroable for PrbvhOptions {}

/// The options behind a pointer; NULL: the defaults.
///
/// # Safety
/// It leads to as many bytes as its first word says.
pub(crate) unsafe fn read(options: *const PrbvhOptions) -> Result<PrbvhOptions, Failure> {
    if options.is_null() {
        return Ok(PrbvhOptions::zeroed());
    }
    check_pointer("options", options)?;
    // SAFETY: the size comes first.
    let size = unsafe { options.cast::<usize>().read() };
    let known = size_of::<PrbvhOptions>();
    if size < known {
        return Err(Failure::argument(format!("options.size is {size}, but sizeof(PrbvhOptions) is {known}")));
    }
    // SAFETY: it is at least as long as what is known.
    let read = unsafe { options.read() };
    // SAFETY: the caller's duty: there are `size` bytes.
    let rest = unsafe { std::slice::from_raw_parts(options.cast::<u8>().add(known), size - known) };
    if rest.iter().any(|&byte| byte != 0) {
        return Err(Failure::argument("options has fields set that this version of prbvh does not know"));
    }
    Ok(read)
}

impl PrbvhOptions {
    /// The device.
    pub(crate) fn device(&self) -> Result<DeviceChoice, Failure> {
        match self.device {
            0 => Ok(DeviceChoice::Auto),
            1 => Ok(DeviceChoice::Cpu),
            2 => Ok(DeviceChoice::Vulkan(Selection::Automatic)),
            3 => Ok(DeviceChoice::Vulkan(Selection::Index(self.device_index as usize))),
            other => Err(Failure::argument(format!("options.device is {other}, but the last PrbvhDevice is 3"))),
        }
    }

    /// What a run is asked for.
    ///
    /// # Safety
    /// `initial_name` is NULL or leads to a string that ends with a 0.
    pub(crate) unsafe fn settings(&self) -> Result<Settings, Failure> {
        let mut settings = Settings::default();
        settings.optimizer = match self.optimizer {
            0 => Optimizer::of_name("prbvh"),
            1 => Optimizer::of_name("rbvh"),
            2 => Optimizer::of_name("rotations"),
            3 => Optimizer::of_name("none"),
            _ => None,
        }
        .ok_or_else(|| {
            Failure::argument(format!("options.optimizer is {}, but the last PrbvhOptimizer is 3", self.optimizer))
        })?;
        let limits = settings.limits_mut();
        if self.max_iterations > 0 {
            limits.max_iterations = self.max_iterations;
        }
        let wrong =
            |name: &str, value: f64| Failure::argument(format!("options.{name} is {value}, but must be at least 0"));
        if self.target_cost.is_nan() || self.target_cost < 0.0 {
            return Err(wrong("target_cost", self.target_cost));
        }
        if self.target_cost > 0.0 {
            limits.target_cost = Some(self.target_cost);
        }
        if self.max_seconds != 0.0 {
            let time = Duration::try_from_secs_f64(self.max_seconds);
            limits.max_time = match time {
                Ok(time) => Some(time),
                // Longer than anybody waits.
                Err(_) if self.max_seconds > 0.0 => None,
                Err(_) => return Err(wrong("max_seconds", self.max_seconds)),
            };
        }
        // SAFETY: the caller's duty.
        let name = unsafe { text("options.initial_name", self.initial_name) }?;
        let named = |name: &str| {
            let refused = |why: &dyn std::fmt::Display| Failure::argument(format!("options.initial_name: {why}"));
            let known = Initial::of_name(name)
                .ok_or_else(|| refused(&format_args!("{name:?} is none of {}", Initial::NAMES)))?;
            known.map_err(|error| refused(&error))
        };
        settings.initial = match self.initial {
            _ if name.is_some() => named(name.unwrap_or_default())?,
            0 => Initial::Lbvh,
            1 => Initial::Ploc { radius: DEFAULT_RADIUS },
            2 => Initial::SahBinned { bins: Bins::DEFAULT },
            3 => Initial::SahSweep,
            other => {
                return Err(Failure::argument(format!("options.initial is {other}, but the last PrbvhInitial is 3")));
            }
        };
        settings.max_depth = match self.max_depth {
            0 => settings.max_depth,
            u32::MAX => MaxDepth::OFF,
            links => MaxDepth::new(links),
        };
        if self.max_leaf > 1 {
            settings.adaptive.get_or_insert_default().max_leaf = Some(self.max_leaf);
        }
        Ok(settings)
    }
}
