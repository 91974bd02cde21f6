//! What is put to the test: the library, or in tests of the table itself something with a fault.

use prbvh::build::{DeviceTree, Scratch};
use prbvh::bvh::{self, Bvh, EncodeError, TreeFault};
use prbvh::device::{Device, DeviceError, Recording};
use prbvh::optimize::{OptimizeError, Order, PrbvhSettings, prbvh};
use prbvh::pipeline::{self, Optimized, PipelineError, Settings};
use prbvh::scene::{SafeRange, Scene};
use prbvh_kernel::Kernel;
use prbvh_kernel::node::Node;
use prbvh_kernel::prbvh::dual::search::{DualParams, TO_THE_ROOT};
use prbvh_kernel::prbvh::worst::books::{BOOKS_WORDS, LIST_LENGTH};
use prbvh_kernel::prbvh::{Move, PrbvhParams};
use prbvh_kernel::status::REPORT_WORDS;
use std::ops::ControlFlow;

/// Why a run gave nothing.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The pipeline refused or failed.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// The device refused or failed.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The optimiser gave nothing.
    #[error(transparent)]
    Optimize(#[from] OptimizeError),
    /// A tree to go on from has leaves of several triangles.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// What came back is no tree.
    #[error("an invalid tree: {}", bvh::summary(.0))]
    InvalidTree(Vec<TreeFault>),
}

/// What is put to the test. The methods as given are the library's own.
pub trait Subject {
    /// Builds a tree over `scene` and optimises it.
    ///
    /// # Errors
    /// If there is no tree.
    fn run(&self, scene: &Scene, settings: &Settings, device: &mut dyn Device) -> Result<Optimized, RunError> {
        Ok(pipeline::optimize(scene, device, settings, &mut |_| ControlFlow::Continue(()))?)
    }

    /// Optimises a given tree over `scene`, one triangle per leaf. The tree that comes back has the boxes of the scene.
    ///
    /// # Errors
    /// If there is no tree.
    fn improve(
        &self,
        scene: &Scene,
        tree: &Bvh,
        settings: &PrbvhSettings,
        device: &mut dyn Device,
    ) -> Result<Bvh, RunError> {
        let tree = DeviceTree::upload(device, &working_nodes(scene, tree)?)?;
        prbvh(device, &tree, settings, &mut |_, _, _| ControlFlow::Continue(()))?;
        let nodes = tree.download(device)?;
        tree.free(device);
        Ok(Bvh::from_device(&nodes).map_err(RunError::InvalidTree)?.with_boxes_of(&scene.triangles))
    }

    /// What the searches of an order find in a tree, for every node that they take. [`Move::NONE`] where nothing is found.
    ///
    /// # Errors
    /// If the device refuses or fails.
    fn search(&self, nodes: &[Node], order: Order, device: &mut dyn Device) -> Result<Vec<Move>, RunError> {
        let tree = DeviceTree::upload(device, nodes)?;
        let mut scratch = Scratch::default();
        let found = scratch.allocate(device, "found", nodes.len(), size_of::<Move>())?;
        let report = scratch.allocate(device, "report", REPORT_WORDS as usize, 4)?;
        let mut recording = Recording::new();
        match order {
            Order::Published => {
                let params = PrbvhParams::every(1, 0, nodes.len() as u32);
                let books = scratch.allocate(device, "books", BOOKS_WORDS as usize, 4)?;
                let buffers = [&tree.nodes, &found, &books, &report];
                recording.dispatch("search", Kernel::PrbvhSearch, params.count, &params, &buffers);
            }
            _ => {
                let inputs: Vec<u32> = (1..nodes.len() as u32 / 2).collect();
                // As the tail of a run searches: each child first, and to the root.
                let params = DualParams {
                    count: inputs.len() as u32,
                    nodes: nodes.len() as u32,
                    both_orders: 1,
                    climb: TO_THE_ROOT,
                    slack: 0.0,
                    row: 0,
                };
                let list = scratch.allocate(device, "list", inputs.len().max(1), 4)?;
                let keys = scratch.allocate(device, "keys", nodes.len(), 4)?;
                let books = scratch.allocate(device, "books", BOOKS_WORDS as usize, 4)?;
                if !inputs.is_empty() {
                    device.upload(&list, bytemuck::cast_slice(&inputs))?;
                }
                let mut words = [0u32; BOOKS_WORDS as usize];
                words[LIST_LENGTH] = params.count;
                device.upload(&books, bytemuck::cast_slice(&words))?;
                recording.clear("search", &keys);
                let buffers = [&tree.nodes, &list, &found, &keys, &books, &report];
                recording.dispatch("search", Kernel::DualSearch, params.count, &params, &buffers);
            }
        }
        let mut moves = vec![Move::NONE; nodes.len()];
        // What no search has written is none.
        device.upload(&found, bytemuck::cast_slice(&moves))?;
        device.run(&recording)?;
        device.download(&found, bytemuck::cast_slice_mut(&mut moves))?;
        scratch.free(device);
        tree.free(device);
        Ok(moves)
    }
}

/// The library as it is.
#[derive(Clone, Copy, Debug)]
pub struct Library;

impl Subject for Library {}

/// A tree as the devices take it, with boxes in working coordinates.
pub(super) fn working_nodes(scene: &Scene, tree: &Bvh) -> Result<Vec<Node>, EncodeError> {
    let working = SafeRange::of(&scene.triangles).apply(&scene.triangles);
    tree.clone().with_boxes_of(&working).to_device()
}
