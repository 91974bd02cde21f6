//! The initial trees that the host builds.

use crate::build;
use crate::check::{SettingError, must};
use crate::optimize;
use crate::settings::Initial;
use crate::stop::Stop;
use prbvh_kernel::node::Node;
use prbvh_kernel::setup::Triangle;

/// Builds a tree over finite triangles by a builder of the host, with all threads of the current rayon pool: `nodes[2n-1]` for
/// [`DeviceTree::upload`](build::DeviceTree::upload). None of no triangles, if an end was asked for, or if the tree comes from a device or is there already.
///
/// # Errors
/// If a parameter makes no sense, or there are more triangles than the builder can do.
pub fn build_on_host(
    initial: &Initial,
    triangles: &[Triangle],
    stop: Option<&Stop>,
) -> Result<Option<Vec<Node>>, SettingError> {
    initial.check_parameters()?;
    if triangles.is_empty() {
        return Ok(None);
    }
    Ok(match initial {
        Initial::SahSweep => build::sweep_until(triangles, stop),
        Initial::SahBinned { bins } => build::binned_until(triangles, *bins, stop),
        Initial::Agglomerative => {
            let size = format!("agglomerative over {} references", triangles.len());
            let is_small = triangles.len() <= build::MOST_AGGLOMERATED;
            must("initial", size, is_small, "a builder whose time does not grow with their square, as from 32,769 on")?;
            build::agglomerative_until(triangles, stop)
        }
        Initial::Aac { aac } => build::aac_until(triangles, aac, stop),
        Initial::Insertion { insertion } => optimize::insertion_until(triangles, insertion, stop),
        Initial::Online { online } => optimize::online_until(triangles, online, stop),
        Initial::Hunt { hunt } => build::hunt_until(triangles, hunt, stop),
        Initial::Phr { phr } => build::phr_until(triangles, phr, stop),
        Initial::Lbvh
        | Initial::Ploc { .. }
        | Initial::Hploc { .. }
        | Initial::KMeans { .. }
        | Initial::Atrbvh { .. }
        | Initial::Trbvh { .. }
        | Initial::Sbvh
        | Initial::Tree(_) => None,
        #[cfg(feature = "files")]
        Initial::File { .. } => None,
    })
}
