//! What a caller may ask for.

use prbvh::bvh::MaxDepth;
use prbvh::device::DeviceChoice;
use prbvh::pipeline::{Initial, Optimizer, Settings};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::time::Duration;

/// The options of `optimize`, in its order.
#[derive(FromPyObject)]
pub(crate) struct Options<'py>(
    String,
    usize,
    String,
    Option<u32>,
    Option<f64>,
    Option<f64>,
    u32,
    Option<u32>,
    Option<Bound<'py, PyAny>>,
    String,
);

fn wrong(name: &str, value: impl std::fmt::Display, need: &str) -> PyErr {
    PyValueError::new_err(format!("{name} is {value}, but must be {need}"))
}

impl<'py> Options<'py> {
    /// The device.
    pub(crate) fn device(&self) -> PyResult<DeviceChoice> {
        self.0.parse().map_err(|_| wrong("device", format_args!("{:?}", self.0), "auto, cpu, vulkan or vulkan:N"))
    }

    /// Threads of the CPU.
    pub(crate) fn threads(&self) -> usize {
        self.1
    }

    /// Who is told each iteration.
    pub(crate) fn progress(&self) -> Option<&Bound<'py, PyAny>> {
        self.8.as_ref()
    }

    /// What a run is asked for.
    pub(crate) fn settings(&self) -> PyResult<Settings> {
        let Self(_, _, initial, max_iterations, max_time, target_cost, max_leaf, max_depth, _, optimizer) = self;
        let mut settings = Settings::default();
        settings.optimizer = Optimizer::of_name(optimizer).ok_or_else(|| {
            wrong("optimizer", format_args!("{optimizer:?}"), &format!("one of {}", Optimizer::NAMES))
        })?;
        let limits = settings.limits_mut();
        if let Some(most) = max_iterations {
            limits.max_iterations = *most;
        }
        if let Some(seconds) = *max_time {
            let time = Duration::try_from_secs_f64(seconds);
            limits.max_time = Some(time.map_err(|_| wrong("max_time", seconds, "a number of seconds"))?);
        }
        if let Some(cost) = *target_cost {
            if cost.is_nan() || cost < 0.0 {
                return Err(wrong("target_cost", cost, "at least 0"));
            }
            limits.target_cost = Some(cost);
        }
        settings.initial = Initial::of_name(initial)
            .ok_or_else(|| wrong("initial", format_args!("{initial:?}"), &format!("one of {}", Initial::NAMES)))?
            .map_err(|error| PyValueError::new_err(format!("initial: {error}")))?;
        settings.max_depth = match max_depth {
            None => MaxDepth::OFF,
            Some(0) => return Err(wrong("max_depth", 0, "at least 1, or None")),
            Some(links) => MaxDepth::new(*links),
        };
        match max_leaf {
            0 => return Err(wrong("max_leaf", 0, "at least 1")),
            1 => {}
            most => {
                settings.adaptive.get_or_insert_default().max_leaf = Some(*most);
            }
        }
        Ok(settings)
    }
}
