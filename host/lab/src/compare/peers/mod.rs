//! Other libraries on the same triangles, each run in a process of its own: one that panics or hangs costs its row, not the comparison.

#[cfg(feature = "peers")]
mod bvh_crate;
mod child;
#[cfg(feature = "peers")]
mod obvhs;
mod wire;

pub use child::{PeerError, PeerHost};
pub use wire::{PeerTree, WireError};

pub(super) use child::run;

use prbvh_kernel::setup::Triangle;
use std::path::Path;
use std::sync::OnceLock;

/// A library with a setting.
#[derive(Clone, Copy, Debug)]
pub struct Peer {
    /// Name for `--methods`; a library with several settings has it in several rows.
    pub name: &'static str,
    /// Name of the row.
    pub method: &'static str,
    /// Whether it is compared where no methods are named.
    pub is_default: bool,
    /// Builds a tree of one triangle per leaf with the threads of the current rayon pool, and takes its time.
    pub build: fn(&[Triangle]) -> PeerTree,
}

/// All that were compiled in.
const PEERS: &[Peer] = &[
    #[cfg(feature = "peers")]
    Peer { name: "obvhs", method: obvhs::DEFAULT, is_default: true, build: obvhs::default },
    #[cfg(feature = "peers")]
    Peer { name: "obvhs", method: obvhs::BEST, is_default: true, build: obvhs::best },
    #[cfg(feature = "peers")]
    Peer { name: "bvh", method: "bvh", is_default: true, build: bvh_crate::build },
];

/// Those of a program that has some of its own.
static ADDED: OnceLock<&[Peer]> = OnceLock::new();

/// Compares with these, too: for a program that calls it before all else, both where it compares and where it is the process of a peer
/// ([`serve`]).
///
/// # Panics
/// If some were added before.
pub fn add(peers: &'static [Peer]) {
    assert!(ADDED.set(peers).is_ok(), "peers are added once");
}

/// All that are known.
pub(super) fn all() -> impl Iterator<Item = &'static Peer> {
    PEERS.iter().chain(ADDED.get().copied().unwrap_or_default())
}

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
    let peer = all().find(|peer| peer.method == method);
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
