//! Every GPU algorithm of prbvh, written once.
//!
//! rust-gpu compiles this crate to SPIR-V for Vulkan; the ordinary compiler builds the same functions for the CPU device
//! (`prbvh-cpu-sim`). [`entries`] is the table of kernels: one row per kernel makes its SPIR-V entry, its description
//! for the host ([`KernelInfo`]) and its native entry.
//!
//! | stage | kernels | in → out |
//! |---|---|---|
//! | [`setup`] | `setup_boxes`, `setup_bounds` | triangles → reference boxes → scene box |
//! | [`morton`] | `morton_30`, `morton_60` | boxes → Morton codes |
//! | [`sort`] | `sort_count`, `sort_rows`, `sort_scatter` or `sort_scatter_alone`, `sort_gather` | codes → order of the references |
//! | [`lbvh`] | `lbvh_leaves`, `lbvh_hierarchy` | sorted codes → links of the tree |
//! | [`ploc`] | `ploc_clusters`, `ploc_nearest`, `ploc_mark`, `ploc_merge` | order of the references → tree |
//! | [`hploc`] | `lbvh_hierarchy`, `hploc_stage` | order of the references, links of a tree → tree |
//! | [`kmeans`] | `kmeans_centres`, `kmeans_assign`, `kmeans_means`, `kmeans_tally`, `kmeans_join`, `kmeans_relabel`, `sort_*`, `kmeans_halve` | order of the references → links of the tree |
//! | `atrbvh` | `atrbvh_levels`, `sort_*`, `atrbvh_restructure` or `trbvh_restructure` | tree → tree with better treelets |
//! | [`refit`] | `refit` | leaf boxes → all boxes |
//! | [`cost`] | `cost` | boxes → partial sums of half surface areas |
//! | [`prbvh`] | `prbvh_search`, `prbvh_lock`, `prbvh_check`, `prbvh_reinsert`, `prbvh_mark`, `prbvh_refit` | tree → better tree, as published |
//! | [`prbvh::worst`] | `worst_*`, `dual_search`, `prbvh_lock`, `prbvh_check`, `prbvh_reinsert` | tree → better tree, the worst nodes first, by moves of two subtrees |
//! | [`subtrees`] | `subtrees_refit` | boxes of the references → all boxes, and better subtrees |
//! | [`rotations`] | `rotations_climb`, `cost` | tree → tree with better subtrees of three levels |
//! | [`kept`] | `kept_restore`, `kept_graft` | tree → the best tree before it, tree with another top |
//! | [`mod@collapse`] | `collapse_sizes`, `collapse_places`, `collapse_jump`, `collapse_emit` | tree → tree with adaptive leaves |
//! | [`collapse::widen`](mod@collapse::widen) | `collapse_widen` | tree → what becomes of its nodes in a wide one |
//! | [`trace`] | `trace_32`, `trace_64`, `trace_128`, `trace_deep`, `trace_count` | tree, rays → hits |
//! | [`trace::path`] | `path_camera`, `path_shade`, `path_gather`, `path_film` | hits → next rays → picture |
//!
//! # Arrays of a tree
//! A tree over `n` references has `2n-1` nodes: internal nodes `[0, n-1)` with the root at 0, leaves `[n-1, 2n-1)`.
//! See [`node`] for the 32 bytes of a node.
#![cfg_attr(target_arch = "spirv", no_std)]
#![deny(unsafe_code)]

pub mod aabb;
#[cfg(feature = "atrbvh")]
pub mod atrbvh;
pub mod climb;
pub mod collapse;
pub mod cost;
pub mod entries;
mod entry;
mod forest;
pub mod grid;
pub mod hploc;
pub mod kept;
pub mod kmeans;
pub mod lbvh;
pub mod math;
pub mod mem;
pub mod morton;
pub mod node;
pub mod ploc;
pub mod prbvh;
pub mod presplit;
pub mod ray;
pub mod refit;
pub mod rotations;
pub mod setup;
pub mod sort;
pub mod status;
pub mod subtrees;
pub mod sum;
pub mod trace;
pub mod workgroup;

#[cfg(not(target_arch = "spirv"))]
pub mod native;

#[cfg(not(target_arch = "spirv"))]
pub use entries::Kernel;
#[cfg(not(target_arch = "spirv"))]
pub use native::{Access, BindingInfo, KernelInfo};
