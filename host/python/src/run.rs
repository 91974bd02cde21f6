//! A run without Python's lock, and what it made.

use crate::options::Options;
use crate::{Made, PrbvhError};
use numpy::PyArray1;
use prbvh::bvh::FlatTree;
use prbvh::device::{self, DeviceChoice, DeviceError};
use prbvh::optimize::IterationRow;
use prbvh::pipeline::{self, Optimized, PipelineError, Settings};
use prbvh::scene::{Place, Scene, SceneError};
use pyo3::exceptions::{PyMemoryError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::ops::ControlFlow;

/// What errors call a scene.
pub(crate) const NAME: &str = "primitives";

/// Optimises a tree over a scene, which is made without Python's lock, too.
pub(crate) fn run<'py>(
    py: Python<'py>,
    scene: impl FnOnce() -> Result<Scene, SceneError> + Send,
    options: &Options<'py>,
) -> PyResult<Made<'py>> {
    let (choice, threads, settings) = (options.device()?, options.threads(), options.settings()?);
    let progress = options.progress().map(|progress| progress.clone().unbind());
    let ended = py.detach(|| {
        let mut raised = None;
        let mut observe = |row: &IterationRow| match told(progress.as_ref(), row) {
            Ok(flow) => flow,
            Err(error) => {
                raised = Some(error);
                ControlFlow::Break(())
            }
        };
        let ended = optimized(scene, (choice, threads), &settings, &mut observe);
        // What Python raised ended the run; its tree is nobody's.
        raised.map_or(ended.map_err(Failure::into_py), Err)
    });
    let (done, device) = ended?;
    let FlatTree { nodes, order } = FlatTree::new(&done.tree);
    // The words of the nodes where they are; the caller sees them as a structure.
    let words = bytemuck::try_cast_vec(nodes).unwrap_or_else(|(_, nodes)| bytemuck::cast_slice(&nodes).to_vec());
    Ok((PyArray1::from_vec(py, words), PyArray1::from_vec(py, order), report(py, &done, &device)?))
}

/// Tells Python of an iteration, and takes its signals: Ctrl+C is one.
fn told(progress: Option<&Py<PyAny>>, row: &IterationRow) -> PyResult<ControlFlow<()>> {
    Python::attach(|py| {
        py.check_signals()?;
        let Some(progress) = progress else { return Ok(ControlFlow::Continue(())) };
        let now = PyDict::new(py);
        now.set_item("iteration", row.iteration)?;
        now.set_item("seconds", row.time_s)?;
        now.set_item("cost", row.cost)?;
        let ends = progress.call1(py, (now,))?.is_truthy(py)?;
        Ok(if ends { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    })
}

/// Why there is no tree.
enum Failure {
    Scene(SceneError),
    Pipeline(PipelineError),
}

impl Failure {
    fn into_py(self) -> PyErr {
        let error = match self {
            Self::Scene(SceneError::Inverted { place: Place::Element(_, at), min, max, .. }) => {
                let axis = (0..3).find(|&axis| min[axis] > max[axis]).unwrap_or(0);
                let (axis, min, max) = (["x", "y", "z"][axis], min[axis], max[axis]);
                let text = format!("boxes[{at}]: the smallest {axis} is {min}, above the largest, {max}");
                return PyValueError::new_err(text);
            }
            Self::Scene(error) => return PyValueError::new_err(error.to_string()),
            Self::Pipeline(error) => error,
        };
        let text = error.to_string();
        match error {
            PipelineError::Device(DeviceError::OutOfMemory { .. }) => PyMemoryError::new_err(text),
            PipelineError::MaxDepth(_) | PipelineError::Collapse(_) => PyValueError::new_err(text),
            _ => PrbvhError::new_err(text),
        }
    }
}

/// The run; also the name of its device.
fn optimized(
    scene: impl FnOnce() -> Result<Scene, SceneError>,
    (choice, threads): (DeviceChoice, usize),
    settings: &Settings,
    observe: &mut dyn FnMut(&IterationRow) -> ControlFlow<()>,
) -> Result<(Optimized, String), Failure> {
    let scene = scene().map_err(Failure::Scene)?;
    let mut device = device::open(choice, threads, false).map_err(|error| Failure::Pipeline(error.into()))?;
    let name = device.info().name.clone();
    let done = pipeline::optimize(&scene, &mut *device, settings, observe).map_err(Failure::Pipeline)?;
    Ok((done, name))
}

fn report<'py>(py: Python<'py>, done: &Optimized, device: &str) -> PyResult<Bound<'py, PyDict>> {
    let report = PyDict::new(py);
    let quality = done.adaptive.unwrap_or(done.quality);
    report.set_item("initial_cost", done.initial.sah_cost)?;
    report.set_item("cost", quality.sah_cost)?;
    report.set_item("stop", done.outcome.stop.to_string())?;
    report.set_item("iterations", done.outcome.rows.len().saturating_sub(1))?;
    report.set_item("device", device)?;
    report.set_item("build_s", done.build_s)?;
    report.set_item("optimize_s", done.optimize_s)?;
    report.set_item("max_depth", quality.max_depth)?;
    report.set_item("leaves", quality.leaves)?;
    report.set_item("max_links", done.bound.map(|bound| bound.max_depth))?;
    report.set_item("rows", rows(py, &done.outcome.rows)?)?;
    Ok(report)
}

/// The rows as columns.
fn rows<'py>(py: Python<'py>, rows: &[IterationRow]) -> PyResult<Bound<'py, PyDict>> {
    type Whole = (&'static str, fn(&IterationRow) -> u32);
    type Real = (&'static str, fn(&IterationRow) -> f64);
    const WHOLE: [Whole; 6] = [
        ("iteration", |row| row.iteration),
        ("searched", |row| row.searched),
        ("visits", |row| row.visits),
        ("found", |row| row.found),
        ("owned", |row| row.owned),
        ("applied", |row| row.applied),
    ];
    const REAL: [Real; 4] = [
        ("time_s", |row| row.time_s),
        ("device_s", |row| row.device_s),
        ("cost", |row| row.cost),
        ("relative_error", |row| row.relative_error),
    ];
    let columns = PyDict::new(py);
    for (name, value) in WHOLE {
        columns.set_item(name, PyArray1::from_iter(py, rows.iter().map(value)))?;
    }
    for (name, value) in REAL {
        columns.set_item(name, PyArray1::from_iter(py, rows.iter().map(value)))?;
    }
    Ok(columns)
}
