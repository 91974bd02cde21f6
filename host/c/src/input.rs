//! Arrays of the caller as triangles.

use crate::PrbvhBox;
use crate::status::Failure;
use prbvh::scene::{MAX_TRIANGLES, Triangle};

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

    /// The triangles.
    pub(crate) fn triangles(&self) -> Result<Vec<Triangle>, Failure> {
        let corner = |triangle: usize, index: u32| {
            let vertex = self.vertices.get(index as usize).copied();
            vertex.ok_or_else(|| {
                let vertices = self.vertices.len();
                Failure::geometry(format!("triangle {triangle}: vertex {index} is not among the {vertices} vertices"))
            })
        };
        let triangle = |k: usize| {
            let [a, b, c] = match self.indices {
                Some(indices) => indices[k],
                // Checked: no more triangles than have 32-bit corners.
                None => [0, 1, 2].map(|corner| 3 * k as u32 + corner),
            };
            Ok(Triangle { a: corner(k, a)?, b: corner(k, b)?, c: corner(k, c)? })
        };
        (0..self.triangles).map(triangle).collect()
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

    /// Triangles that have these boxes: each with both corners among its own.
    pub(crate) fn triangles(&self) -> Result<Vec<Triangle>, Failure> {
        let triangle = |(k, PrbvhBox { min, max }): (usize, &PrbvhBox)| {
            // A NaN is found with the other coordinates.
            match (0..3).find(|&axis| min[axis] > max[axis]) {
                None => Ok(Triangle { a: *min, b: *max, c: *max }),
                Some(axis) => {
                    let (axis, min, max) = (["x", "y", "z"][axis], min[axis], max[axis]);
                    Err(Failure::geometry(format!("box {k}: the smallest {axis} is {min}, above the largest, {max}")))
                }
            }
        };
        self.0.iter().enumerate().map(triangle).collect()
    }
}
