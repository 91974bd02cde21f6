//! Methods that run on the host alone.

use super::MethodError;
use prbvh::build::{self, MortonBits};
use prbvh::device::DeviceError;
use prbvh::device::cpu::CpuDevice;
use prbvh::optimize::{self, IterationRow, RbvhSettings, StopReason};
use prbvh::pipeline::{Initial, PipelineError, build_on_host};
use prbvh::stop::Stop;
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;
use std::ops::ControlFlow;
use std::time::Instant;

/// Builds on the host. What takes long looks whether it is to end.
pub(super) type HostBuilder = fn(&[Triangle], &Stop) -> Result<HostBuilt, MethodError>;

/// What a builder on the host made.
#[derive(Clone, Debug)]
pub(super) struct HostBuilt {
    /// The tree, one triangle per leaf.
    pub(super) nodes: Vec<Node>,
    /// An optimiser's iterations and the wall time of the tree that it started from; none for a builder.
    pub(super) optimizer: Option<(f64, Vec<IterationRow>)>,
}

pub(super) fn builder(nodes: Vec<Node>) -> Result<HostBuilt, MethodError> {
    Ok(HostBuilt { nodes, optimizer: None })
}

pub(super) fn named(name: &str, triangles: &[Triangle], stop: &Stop) -> Result<HostBuilt, MethodError> {
    let initial = Initial::of_name(name).expect("a name of a row").expect("parameters of a row");
    let nodes = build_on_host(&initial, triangles, Some(stop)).map_err(PipelineError::from)?;
    builder(nodes.ok_or(DeviceError::Stopped)?)
}

pub(super) fn rbvh_as_published(triangles: &[Triangle], stop: &Stop) -> Result<HostBuilt, MethodError> {
    run_rbvh(triangles, RbvhSettings::default().with(|s| s.undo = false), stop)
}

pub(super) fn rbvh_with_undo(triangles: &[Triangle], stop: &Stop) -> Result<HostBuilt, MethodError> {
    run_rbvh(triangles, RbvhSettings::default(), stop)
}

/// RBVH from LBVH, all on one thread.
fn run_rbvh(triangles: &[Triangle], mut settings: RbvhSettings, stop: &Stop) -> Result<HostBuilt, MethodError> {
    settings.limits.stop = Some(stop.clone());
    let start = Instant::now();
    let mut device = CpuDevice::new(1)?;
    let (tree, _) = build::lbvh(&mut device, triangles, MortonBits::default())?;
    let mut nodes = tree.download(&mut device)?;
    let build_s = start.elapsed().as_secs_f64();
    let outcome = optimize::rbvh(&mut nodes, &settings, &mut |_, _| ControlFlow::Continue(()))?;
    if outcome.stop == StopReason::Cancelled {
        return Err(DeviceError::Stopped.into());
    }
    Ok(HostBuilt { nodes, optimizer: Some((build_s, outcome.rows)) })
}
