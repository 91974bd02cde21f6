//! Arrays of numpy as triangles and boxes. They are read where they lie, and all of them while nobody else runs Python.

use numpy::{Element, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods};
use prbvh::scene::{Aabb, Triangle};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

/// The array of an argument, if it has the type, the shape `(any, …)` and no gaps.
fn array<'py, T: Element>(
    name: &str,
    argument: &Bound<'py, PyAny>,
    (dtype, shape): (&str, &[usize]),
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    let untyped = argument.cast::<PyUntypedArray>().map_err(|_| {
        let kind = argument.get_type().qualname().map_or_else(|_| "it".to_owned(), |kind| kind.to_string());
        PyTypeError::new_err(format!("{name} must be a numpy array of {dtype}, but is of type {kind}"))
    })?;
    let typed = argument
        .cast::<PyArrayDyn<T>>()
        .map_err(|_| PyTypeError::new_err(format!("{name} must be of dtype {dtype}, but is of {}", untyped.dtype())))?;
    let have = untyped.shape();
    if have.len() != shape.len() + 1 || have[1..] != *shape {
        let need: Vec<String> = shape.iter().map(ToString::to_string).collect();
        let have: Vec<String> = have.iter().map(ToString::to_string).collect();
        let (need, have) = (need.join(", "), have.join(", "));
        return Err(PyValueError::new_err(format!("{name} must have the shape (n, {need}), but has ({have})")));
    }
    if !untyped.is_c_contiguous() {
        let advice = "numpy.ascontiguousarray makes one that is";
        return Err(PyValueError::new_err(format!("{name} must be C-contiguous: {advice}")));
    }
    Ok(typed.try_readonly()?)
}

/// The elements of an array without gaps.
fn elements<'a, T: Element>(name: &str, array: &'a PyReadonlyArrayDyn<'_, T>) -> PyResult<&'a [T]> {
    array.as_slice().map_err(|error| PyValueError::new_err(format!("{name}: {error}")))
}

/// The triangles of vertices and, if there are any, indices.
pub(crate) fn triangles_of(
    vertices: &Bound<'_, PyAny>,
    triangles: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<Triangle>> {
    let vertices = array::<f32>("vertices", vertices, ("float32", &[3]))?;
    let (vertices, _) = elements("vertices", &vertices)?.as_chunks::<3>();
    let Some(triangles) = triangles else {
        let (corners, rest) = vertices.as_chunks();
        if !rest.is_empty() {
            let text = format!("vertices must be a multiple of 3 without triangles, but are {}", vertices.len());
            return Err(PyValueError::new_err(text));
        }
        return Ok(corners.iter().map(|&corners| corners.into()).collect());
    };
    let triangles = array::<u32>("triangles", triangles, ("uint32", &[3]))?;
    let (triangles, _) = elements("triangles", &triangles)?.as_chunks::<3>();
    let triangle = |(k, corners): (usize, &[u32; 3])| {
        let corner = |index: u32| {
            vertices.get(index as usize).copied().ok_or_else(|| {
                let there = vertices.len();
                PyValueError::new_err(format!("triangles[{k}]: vertex {index} is not among the {there} vertices"))
            })
        };
        Ok(Triangle { a: corner(corners[0])?, b: corner(corners[1])?, c: corner(corners[2])? })
    };
    triangles.iter().enumerate().map(triangle).collect()
}

/// The boxes.
pub(crate) fn boxes_of(boxes: &Bound<'_, PyAny>) -> PyResult<Vec<Aabb>> {
    let boxes = array::<f32>("boxes", boxes, ("float32", &[2, 3]))?;
    let (corners, _) = elements("boxes", &boxes)?.as_chunks::<3>();
    let (boxes, _) = corners.as_chunks();
    Ok(boxes.iter().map(|&[min, max]| Aabb { min, max }).collect())
}
