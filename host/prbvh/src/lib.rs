//! Optimises bounding volume hierarchies (BVHs) by parallel reinsertion, on any GPU that Vulkan reaches and on any CPU, with the same result bit for bit.
//!
//! A tree that is optimised costs a ray 15 to 45 % less than an LBVH, by the surface area heuristic (SAH). For engines and renderers that build a tree once
//! and trace it often: the tree that comes out is plain data ([`Bvh`]: nodes and an order of triangles), and nothing of the library is needed to trace it.
//!
//! # Triangles in memory
//! ```
//! use prbvh::{DeviceChoice, Scene, Settings, Triangle};
//! use std::ops::ControlFlow;
//!
//! // A strip; coordinates in any unit.
//! let strip = (0..1000).map(|k| k as f32).map(|x| Triangle {
//!     a: [x, 0.0, 0.0],
//!     b: [x + 1.0, 0.0, (0.1 * x).sin()],
//!     c: [x, 1.0, 0.0],
//! });
//! let scene = Scene::from_triangles("strip", strip.collect())?;
//! // `Auto` is the best GPU, or else the CPU. 0: a thread per core; false: without Vulkan's validation.
//! let mut device = prbvh::open_device(DeviceChoice::Cpu, 0, false)?;
//! let done = prbvh::optimize(&scene, &mut *device, &Settings::default(), &mut |row| {
//!     println!("iteration {}: cost {:.2}", row.iteration, row.cost);
//!     ControlFlow::Continue(()) // or Break: then the best tree so far is handed out
//! })?;
//! assert!(done.quality.sah_cost < done.initial.sah_cost);
//! assert_eq!(done.tree.triangle_order.len(), 1000);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//! [`Settings`] choose the initial tree, the optimiser, what ends it early, leaves of several triangles and the largest depth.
//!
//! # A tree in memory
//! Any binary tree of one triangle per leaf, such as another builder's, goes to a device, is optimised there, and comes back.
//! ```
//! use prbvh::bvh::{self, BvhNode, Content, NO_NODE, SahModel};
//! use prbvh::build::DeviceTree;
//! use prbvh::device::cpu::CpuDevice;
//! use prbvh::optimize::{PrbvhSettings, prbvh};
//! use prbvh::{Bvh, Triangle};
//! use std::ops::ControlFlow;
//!
//! // 64 triangles in a row, and a tree of seven levels that has them in any order but that one.
//! let triangle = |x| Triangle { a: [x, 0.0, 0.0], b: [x + 1.0, 0.0, 0.0], c: [x, 1.0, 0.0] };
//! let triangles: Vec<Triangle> = (0..64).map(|k| triangle(k as f32)).collect();
//! let node = |v: u32| BvhNode {
//!     aabb: triangles[0].aabb(), // `with_boxes_of` makes them all
//!     parent: if v == 0 { NO_NODE } else { (v - 1) / 2 },
//!     content: match v.checked_sub(63) {
//!         None => Content::Internal { left: 2 * v + 1, right: 2 * v + 2 },
//!         Some(first) => Content::Leaf { first, count: 1 },
//!     },
//! };
//! let triangle_order = (0..64).map(|k| 37 * k % 64).collect();
//! let yours = Bvh { nodes: (0..127).map(node).collect(), triangle_order }.with_boxes_of(&triangles);
//!
//! let mut device = CpuDevice::new(0)?;
//! let tree = DeviceTree::upload(&mut device, &yours.to_device()?)?;
//! prbvh(&mut device, &tree, &PrbvhSettings::default(), &mut |_, _, _| ControlFlow::Continue(()))?;
//! let nodes = tree.download(&mut device)?;
//! tree.free(&mut device);
//! let better = Bvh::from_device(&nodes).map_err(|faults| bvh::summary(&faults))?;
//! let cost = |tree| bvh::quality(tree, &SahModel::default()).sah_cost;
//! assert!(cost(&better) < cost(&yours));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//! Coordinates that are tiny or huge are first brought into the range in which `f32` can compare areas: [`scene::SafeRange`].
//!
//! # A file
//! With the cargo feature `files`: OBJ, PLY, STL, glTF and GLB, also packed, in; `tree.bvh` out.
#![cfg_attr(feature = "files", doc = "```")]
#![cfg_attr(not(feature = "files"), doc = "```ignore")]
//! use prbvh::bvh::file;
//! use prbvh::{DeviceChoice, Settings, scene};
//! use std::ops::ControlFlow;
//!
//! # let folder = tempfile::tempdir()?;
//! # let (path, out) = (folder.path().join("scene.obj"), folder.path().join("scene.bvh"));
//! # std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")?;
//! let scene = scene::load(&path)?;
//! let mut device = prbvh::open_device(DeviceChoice::Cpu, 0, false)?;
//! let done = prbvh::optimize(&scene, &mut *device, &Settings::default(), &mut |_| ControlFlow::Continue(()))?;
//! file::write(&out, &done.tree, &scene.hash)?;
//! assert_eq!(file::read(&out)?.tree, done.tree);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//! As programs, each read in a minute:
//!
//! | example | for |
//! |---|---|
//! | [`triangles`](https://github.com/prbvh/prbvh/tree/main/host/prbvh/examples/triangles.rs) | triangles in memory |
//! | [`boxes`](https://github.com/prbvh/prbvh/tree/main/host/prbvh/examples/boxes.rs) | boxes: particles, instances, a tree over trees |
//! | [`tree`](https://github.com/prbvh/prbvh/tree/main/host/prbvh/examples/tree.rs) | a tree that you have, its leaves kept or made anew |
//! | [`dynamic`](https://github.com/prbvh/prbvh/tree/main/host/prbvh/examples/dynamic.rs) | a scene in motion: refit and a step in each frame |
//! | [`your_vulkan`](https://github.com/prbvh/prbvh/tree/main/host/prbvh/examples/your_vulkan.rs) | a Vulkan device, buffers and semaphores of your own |
//! | [`other_libraries`](https://github.com/prbvh/prbvh/tree/main/host/prbvh/examples/other_libraries.rs) | trees of other libraries, in and out |
//! | [`file`](https://github.com/prbvh/prbvh/tree/main/host/prbvh/examples/file.rs) | a scene file |
//!
//! [What an adopter needs](https://github.com/prbvh/prbvh/tree/main/docs/adopting.md), beside other libraries.
//!
//! # Where things are
//! | for | module |
//! |---|---|
//! | a whole run: scene → initial tree → optimiser → validated tree | [`pipeline`], [`settings`], [`scene`] |
//! | the optimisers alone | [`mod@optimize`] |
//! | the tree handed out: validation, cost, depth, hash, file | [`bvh`] |
//! | GPU and CPU | [`device`] |
//! | initial trees alone | [`build`] |
//! | leaves of several triangles | [`collapse`] |
//! | references that are pieces of triangles | [`presplit`], [`build::sbvh()`] |
//! | nodes of four or eight children | [`wide`] |
//! | rays, to measure a tree | [`trace`] |
//! | what a run leaves out, and why | [`plan`] |
//! | an end from another thread | [`stop`] |
//! | trees of other libraries, layouts of nodes | [`interop`] |
//!
//! # Cargo features
//! | feature | has | default |
//! |---|---|---|
//! | `vulkan` | GPUs | yes |
//! | `atrbvh` | the builders ATRBVH and TRBVH, which may be patented: see NOTICE | yes |
//! | `serde` | settings, plans and outcomes as data of [serde](https://serde.rs) | no |
//! | `obvhs`, `bvh` | trees of these crates, in and out | no |
//! | `files` | scene files, tree files, compiled pipelines of Vulkan kept from run to run | no |

pub mod build;
pub mod bvh;
mod check;
pub mod collapse;
pub mod device;
mod fold;
#[doc(hidden)]
pub mod format;
mod given;
pub mod interop;
pub mod optimize;
mod parameters;
pub mod pipeline;
pub mod plan;
pub mod presplit;
mod random;
mod references;
mod rounded;
pub mod scene;
pub mod settings;
pub mod stop;
pub mod trace;
pub mod wide;
#[cfg(feature = "files")]
#[doc(hidden)]
pub mod write;
#[cfg(feature = "serde")]
mod written;

pub use bvh::Bvh;
pub use device::{Device, DeviceChoice, DeviceError, open as open_device};
pub use pipeline::{Optimized, PipelineError, optimize};
pub use scene::{Scene, SceneError, Triangle};
pub use settings::{Initial, Optimizer, Settings};
pub use stop::Stop;

/// Compiles the example of the README, which reads a file.
#[cfg(all(doctest, feature = "files"))]
#[doc = include_str!("../../../README.md")]
pub struct Readme;
