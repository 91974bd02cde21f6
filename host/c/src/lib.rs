//! prbvh for C: boxes or triangles in, an array of nodes out. `include/prbvh.h` is made from this crate, and its tests compile and run
//! a program in C. `docs/bindings.md` says how to link it.
//!
//! Nothing unwinds over the border: a panic is the status [`PrbvhStatus::Internal`]. Functions may be called from any thread, several at a time.
#![allow(unsafe_code, reason = "pointers of C come in; each block says which duty of the caller makes it right")]

mod input;
mod options;
mod run;
mod status;

pub use options::{PrbvhDevice, PrbvhInitial, PrbvhOptimizer, PrbvhOptions, PrbvhProgress, PrbvhProgressFn};
pub use run::{PrbvhNode, PrbvhResult, PrbvhStop};
pub use status::{PrbvhStatus, prbvh_error_text, prbvh_last_error};

use input::{Boxes, Indexed};
use std::ffi::c_char;

/// A box: smallest and largest corner.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct PrbvhBox {
    /// Smallest x, y, z.
    pub min: [f32; 3],
    /// Largest x, y, z.
    pub max: [f32; 3],
}

/// Builds a tree over triangles and optimises it.
///
/// `vertices`: x, y, z of each of `vertex_count` vertices. `indices`: three vertices of each of `triangle_count` triangles; or NULL, then
/// triangle k has vertices 3k, 3k+1 and 3k+2. `options` may be NULL: the defaults. Room for 2n-1 nodes in `nodes` and for n ids in
/// `order`, n = `triangle_count`. `result` may be NULL.
///
/// Returns PRBVH_STATUS_OK and a tree, also where a limit or the progress function ended the run early; or what went wrong, with nothing
/// written.
///
/// # Safety
/// Each pointer is NULL or leads to as much as is said above, which nobody else writes before the function returns; the arrays that are written
/// overlap no other.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn prbvh_optimize_triangles(
    vertices: *const f32,
    vertex_count: usize,
    indices: *const u32,
    triangle_count: usize,
    options: *const PrbvhOptions,
    nodes: *mut PrbvhNode,
    order: *mut u32,
    result: *mut PrbvhResult,
) -> PrbvhStatus {
    status::guard(|| {
        // SAFETY: the caller's duty.
        let triangles = unsafe { Indexed::new(vertices, vertex_count, indices, triangle_count) }?;
        // SAFETY: the caller's duty.
        let out = unsafe { run::Out::new(nodes, order, result) }?;
        // SAFETY: the caller's duty.
        let options = unsafe { options::read(options) }?;
        run::run(|| triangles.scene(), &options, out)
    })
}

/// Builds a tree over boxes and optimises it: particles, instances, objects.
///
/// `boxes`: `box_count` of them. Else as `prbvh_optimize_triangles`.
///
/// # Safety
/// As there.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn prbvh_optimize_boxes(
    boxes: *const PrbvhBox,
    box_count: usize,
    options: *const PrbvhOptions,
    nodes: *mut PrbvhNode,
    order: *mut u32,
    result: *mut PrbvhResult,
) -> PrbvhStatus {
    status::guard(|| {
        // SAFETY: the caller's duty.
        let boxes = unsafe { Boxes::new(boxes, box_count) }?;
        // SAFETY: the caller's duty.
        let out = unsafe { run::Out::new(nodes, order, result) }?;
        // SAFETY: the caller's duty.
        let options = unsafe { options::read(options) }?;
        run::run(|| boxes.scene(), &options, out)
    })
}

/// Version of the library, as in "0.1.0"; it stays.
#[unsafe(no_mangle)]
pub extern "C" fn prbvh_version() -> *const c_char {
    const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    VERSION.as_ptr().cast()
}
