//! The module `prbvh._prbvh`: arrays of numpy in, arrays of numpy out. What users import is `python/prbvh`, which says what all of it means.

mod arrays;
mod options;
mod run;

use arrays::{boxes_of, triangles_of};
use numpy::PyArray1;
use options::Options;
use prbvh::scene::Scene;
use pyo3::create_exception;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

create_exception!(prbvh, PrbvhError, PyRuntimeError, "The device is not there, refused or failed.");

/// Words of the nodes, primitive ids, report.
type Made<'py> = (Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<u32>>, Bound<'py, PyDict>);

/// Optimises a tree over triangles.
#[pyfunction]
fn triangles<'py>(
    vertices: &Bound<'py, PyAny>,
    triangles: Option<&Bound<'py, PyAny>>,
    options: Options<'py>,
) -> PyResult<Made<'py>> {
    let triangles = triangles_of(vertices, triangles)?;
    run::run(vertices.py(), || Scene::from_triangles(run::NAME, triangles), &options)
}

/// Optimises a tree over boxes.
#[pyfunction]
fn boxes<'py>(boxes: &Bound<'py, PyAny>, options: Options<'py>) -> PyResult<Made<'py>> {
    let all = boxes_of(boxes)?;
    run::run(boxes.py(), || Scene::from_boxes(run::NAME, &all), &options)
}

#[pymodule]
fn _prbvh(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("PrbvhError", module.py().get_type::<PrbvhError>())?;
    module.add_function(wrap_pyfunction!(triangles, module)?)?;
    module.add_function(wrap_pyfunction!(boxes, module)?)
}
