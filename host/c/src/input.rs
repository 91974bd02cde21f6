//! Arrays of the caller as scenes.

use crate::PrbvhBox;
use crate::status::Failure;
use prbvh::scene::{Aabb, MAX_TRIANGLES, Scene};
use std::borrow::Cow;
use std::ffi::{CStr, c_char};

/// What errors call a scene.
const NAME: &str = "primitives";

/// The slice behind a pointer of the caller.
///
/// # Safety
/// A pointer that is not NULL and is aligned leads to `length` elements that nobody writes for `'a`.
unsafe fn slice<'a, T>(name: &str, start: *const T, length: usize) -> Result<&'a [T], Failure> {
    check_pointer(name, start)?;
    if length.checked_mul(size_of::<T>()).is_none_or(|bytes| bytes > isize::MAX as usize) {
        return Err(Failure::argument(format!("{name}: {length} elements are more than an array can have")));
    }
    // SAFETY: not NULL, aligned, not too long; the rest is the caller's duty.
    Ok(unsafe { std::slice::from_raw_parts(start, length) })
}

/// Refuses NULL and what is not aligned.
pub(crate) fn check_pointer<T>(name: &str, pointer: *const T) -> Result<(), Failure> {
    if pointer.is_null() {
        return Err(Failure::argument(format!("{name} is NULL")));
    }
    if !pointer.is_aligned() {
        return Err(Failure::argument(format!("{name} is not aligned to {} bytes", align_of::<T>())));
    }
    Ok(())
}

/// The string behind a pointer; none behind NULL.
///
/// # Safety
/// A pointer that is not NULL leads to a string that ends with a 0 and that nobody writes for `'a`.
pub(crate) unsafe fn text<'a>(name: &str, pointer: *const c_char) -> Result<Option<&'a str>, Failure> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: not NULL; the rest is the caller's duty.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str().map(Some).map_err(|error| Failure::argument(format!("{name} is no UTF-8: {error}")))
}

fn check_count(what: &str, count: usize) -> Result<(), Failure> {
    match count {
        0 => Err(Failure::geometry(format!("there are no {what}"))),
        count if count as u64 > MAX_TRIANGLES => {
            Err(Failure::geometry(format!("{count} {what}, but {MAX_TRIANGLES} are the most")))
        }
        _ => Ok(()),
    }
}

/// Vertices and their indices.
pub(crate) struct Indexed<'a> {
    vertices: &'a [[f32; 3]],
    indices: Option<&'a [[u32; 3]]>,
    triangles: usize,
}

impl Indexed<'_> {
    /// # Safety
    /// As `prbvh_optimize_triangles` says.
    pub(crate) unsafe fn new(
        vertices: *const f32,
        vertex_count: usize,
        indices: *const u32,
        triangle_count: usize,
    ) -> Result<Self, Failure> {
        check_count("triangles", triangle_count)?;
        // SAFETY: three floats are a vertex of the same alignment; the rest is the caller's duty.
        let vertices = unsafe { slice("vertices", vertices.cast(), vertex_count) }?;
        let indices = match indices.is_null() {
            true => None,
            // SAFETY: as above.
            false => Some(unsafe { slice("indices", indices.cast(), triangle_count) }?),
        };
        Ok(Self { vertices, indices, triangles: triangle_count })
    }

    /// The scene.
    pub(crate) fn scene(&self) -> Result<Scene, Failure> {
        // Checked: no more triangles than have 32-bit corners.
        let in_turn = || (0..self.triangles as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let indices = self.indices.map_or_else(|| Cow::Owned(in_turn()), Cow::Borrowed);
        Ok(Scene::indexed(NAME, self.vertices, &indices)?)
    }
}

/// Boxes.
pub(crate) struct Boxes<'a>(&'a [PrbvhBox]);

impl Boxes<'_> {
    /// # Safety
    /// As `prbvh_optimize_boxes` says.
    pub(crate) unsafe fn new(boxes: *const PrbvhBox, count: usize) -> Result<Self, Failure> {
        check_count("boxes", count)?;
        // SAFETY: the caller's duty.
        Ok(Self(unsafe { slice("boxes", boxes, count) }?))
    }

    /// The scene.
    pub(crate) fn scene(&self) -> Result<Scene, Failure> {
        let boxes: Vec<Aabb> = self.0.iter().map(|&PrbvhBox { min, max }| Aabb { min, max }).collect();
        Ok(Scene::from_boxes(NAME, &boxes)?)
    }
}
