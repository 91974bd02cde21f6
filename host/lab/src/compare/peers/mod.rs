//! Other libraries on the same triangles, each run in a process of its own: one that panics or hangs costs its row, not the comparison.

#[cfg(feature = "peers")]
mod bvh_crate;
mod child;
#[cfg(feature = "peers")]
mod obvhs;
#[cfg(feature = "planted-peers")]
mod planted;
mod wire;

pub use child::{PeerError, PeerHost};
pub use wire::{PeerTree, WireError};

pub(super) use child::run;

use prbvh_kernel::setup::Triangle;
use std::path::Path;

/// A library with a setting.
#[derive(Debug)]
pub(super) struct Peer {
    /// Name for `--methods`; a library with several settings has it in several rows.
    pub(super) name: &'static str,
    /// Name of the row.
    pub(super) method: &'static str,
    /// Whether it is compared where no methods are named.
    pub(super) is_default: bool,
    /// Builds a tree of one triangle per leaf with the threads of the current rayon pool, and takes its time.
    build: fn(&[Triangle]) -> PeerTree,
}

/// All that were compiled in.
pub(super) const PEERS: &[Peer] = &[
    #[cfg(feature = "peers")]
    Peer { name: "obvhs", method: obvhs::DEFAULT, is_default: true, build: obvhs::default },
    #[cfg(feature = "peers")]
    Peer { name: "obvhs", method: obvhs::BEST, is_default: true, build: obvhs::best },
    #[cfg(feature = "peers")]
    Peer { name: "bvh", method: "bvh", is_default: true, build: bvh_crate::build },
    #[cfg(feature = "planted-peers")]
    Peer { name: "planted-panic", method: "planted-panic", is_default: false, build: planted::panic },
    #[cfg(feature = "planted-peers")]
    Peer { name: "planted-hang", method: "planted-hang", is_default: false, build: planted::hang },
    #[cfg(feature = "planted-peers")]
    Peer { name: "planted-wrong", method: "planted-wrong", is_default: false, build: planted::wrong },
];

/// Why the process of a peer did not do its work.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServeError {
    /// There is no such peer.
    #[error("no peer `{0}`")]
    NoSuchPeer(String),
    /// A file could not be read or written.
    #[error(transparent)]
    Wire(#[from] WireError),
    /// The system refused threads.
    #[error(transparent)]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// The library panicked, with this message.
    #[error("{0}")]
    Panicked(String),
}

/// What the process of a peer does: reads triangles, builds with `threads` threads (0: one per core), writes the tree.
///
/// # Errors
/// If a file cannot be read or written, or the library panics.
pub fn serve(method: &str, scene: &Path, out: &Path, threads: usize) -> Result<(), ServeError> {
    let peer = PEERS.iter().find(|peer| peer.method == method);
    let peer = peer.ok_or_else(|| ServeError::NoSuchPeer(method.to_owned()))?;
    let triangles = wire::read_triangles(scene)?;
    // Libraries may ask for the pool by themselves.
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?;
    std::panic::set_hook(Box::new(|_| {}));
    let built = std::panic::catch_unwind(|| (peer.build)(&triangles));
    let tree = built.map_err(|payload| ServeError::Panicked(message(&*payload)))?;
    wire::write_tree(out, &tree)?;
    Ok(())
}

fn message(payload: &(dyn std::any::Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied().or(payload.downcast_ref::<String>().map(String::as_str));
    text.unwrap_or("a panic without a text").lines().next().unwrap_or_default().to_owned()
}
