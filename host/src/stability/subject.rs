//! What is put to the test: the library, or in tests of the table itself something with a fault.

use crate::build::DeviceTree;
use crate::bvh::{self, Bvh, EncodeError, TreeFault};
use crate::device::{Device, DeviceError, Recording};
use crate::optimize::{PrbvhSettings, prbvh};
use crate::pipeline::{self, Optimized, PipelineError, Settings};
use crate::scene::{SafeRange, Scene};
use prbvh_kernel::Kernel;
use prbvh_kernel::node::Node;
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

    /// What one search finds in a tree, for every node. [`Move::NONE`] where it finds nothing.
    ///
    /// # Errors
    /// If the device refuses or fails.
    fn search(&self, nodes: &[Node], device: &mut dyn Device) -> Result<Vec<Move>, RunError> {
        let count = nodes.len() as u32;
        let tree = DeviceTree::upload(device, nodes)?;
        let found = device.allocate("found", nodes.len(), size_of::<Move>())?;
        let report = device.allocate("report", REPORT_WORDS as usize, 4)?;
        let params = PrbvhParams::every(1, 0, count);
        let mut recording = Recording::new();
        recording.dispatch("search", Kernel::PrbvhSearch, count, &params, &[&tree.nodes, &found, &report]);
        device.run(&recording)?;
        let mut moves = vec![Move::NONE; nodes.len()];
        device.download(&found, bytemuck::cast_slice_mut(&mut moves))?;
        tree.free(device);
        device.free(found);
        device.free(report);
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
