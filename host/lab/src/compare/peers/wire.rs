//! The files between the comparison and the process of a peer. Both are the same program on the same machine.

use bytemuck::{Pod, Zeroable};
use prbvh::bvh::{Bvh, BvhNode, Content, NO_NODE};
use prbvh::write::{WriteError, write_atomically};
use prbvh_kernel::aabb::Aabb;
use prbvh_kernel::setup::Triangle;
use std::io;
use std::path::{Path, PathBuf};

/// What a peer built.
#[derive(Clone, Debug, PartialEq)]
pub struct PeerTree {
    /// Wall time from the triangles in the form that the library takes to the tree, seconds.
    pub build_s: f64,
    /// Nodes, the root first, in any order else.
    pub nodes: Vec<Content>,
    /// Triangle ids; a leaf holds a range of them.
    pub triangle_order: Vec<u32>,
}

/// Why a file was not read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WireError {
    /// It could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// It could not be read.
    #[error("{path} could not be read")]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// It has not the length that it should.
    #[error("{path} has {have} bytes, but must have {need}")]
    Length {
        /// The file.
        path: PathBuf,
        /// Its length.
        have: usize,
        /// What its length must be.
        need: String,
    },
}

impl PeerTree {
    /// What the conversion of a library's tree gave.
    ///
    /// # Panics
    /// If it is no tree, as the process of a peer may: its message is that of the row.
    #[cfg(feature = "peers")]
    pub(super) fn of(tree: Result<Bvh, Vec<prbvh::bvh::TreeFault>>, build_s: f64) -> Self {
        let tree = tree.unwrap_or_else(|faults| panic!("{}", prbvh::bvh::summary(&faults)));
        let nodes = tree.nodes.iter().map(|node| node.content).collect();
        Self { build_s, nodes, triangle_order: tree.triangle_order }
    }

    /// The tree, without boxes and unchecked.
    #[must_use]
    pub fn into_bvh(self) -> Bvh {
        let aabb = Aabb { min: [0.0; 3], max: [0.0; 3] };
        let mut nodes: Vec<BvhNode> =
            self.nodes.iter().map(|&content| BvhNode { aabb, parent: NO_NODE, content }).collect();
        for v in 0..nodes.len() {
            if let Content::Internal { left, right } = nodes[v].content {
                for child in [left, right] {
                    if let Some(child) = nodes.get_mut(child as usize) {
                        child.parent = v as u32;
                    }
                }
            }
        }
        Bvh { nodes, triangle_order: self.triangle_order }
    }
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Header {
    build_s: f64,
    nodes: u64,
    triangles: u64,
}

/// A node; `count` is 0 for an internal one.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct WireNode {
    count: u32,
    first: u32,
    second: u32,
}

impl From<Content> for WireNode {
    fn from(content: Content) -> Self {
        match content {
            Content::Internal { left, right } => Self { count: 0, first: left, second: right },
            Content::Leaf { first, count } => Self { count, first, second: 0 },
        }
    }
}

impl From<WireNode> for Content {
    fn from(node: WireNode) -> Self {
        match node.count {
            0 => Self::Internal { left: node.first, right: node.second },
            count => Self::Leaf { first: node.first, count },
        }
    }
}

pub(super) fn write_triangles(path: &Path, triangles: &[Triangle]) -> Result<(), WireError> {
    Ok(write_atomically(path, |out| out.write_all(bytemuck::cast_slice(triangles)))?)
}

pub(super) fn read_triangles(path: &Path) -> Result<Vec<Triangle>, WireError> {
    let bytes = read(path)?;
    if !bytes.len().is_multiple_of(size_of::<Triangle>()) || bytes.is_empty() {
        let need = format!("a multiple of {}", size_of::<Triangle>());
        return Err(WireError::Length { path: path.to_owned(), have: bytes.len(), need });
    }
    Ok(bytemuck::pod_collect_to_vec(&bytes))
}

pub(super) fn write_tree(path: &Path, tree: &PeerTree) -> Result<(), WireError> {
    let PeerTree { build_s, .. } = *tree;
    let header = Header { build_s, nodes: tree.nodes.len() as u64, triangles: tree.triangle_order.len() as u64 };
    let nodes: Vec<WireNode> = tree.nodes.iter().map(|&content| content.into()).collect();
    Ok(write_atomically(path, |out| {
        out.write_all(bytemuck::bytes_of(&header))?;
        out.write_all(bytemuck::cast_slice(&nodes))?;
        out.write_all(bytemuck::cast_slice(&tree.triangle_order))
    })?)
}

pub(super) fn read_tree(path: &Path) -> Result<PeerTree, WireError> {
    let bytes = read(path)?;
    let length = |need: String| WireError::Length { path: path.to_owned(), have: bytes.len(), need };
    let (header, rest) = bytes
        .split_at_checked(size_of::<Header>())
        .ok_or_else(|| length(format!("{} at least", size_of::<Header>())))?;
    let header: Header = bytemuck::pod_read_unaligned(header);
    let node_bytes = header.nodes.saturating_mul(size_of::<WireNode>() as u64);
    let need = node_bytes.saturating_add(header.triangles.saturating_mul(4));
    if need != rest.len() as u64 {
        return Err(length(need.saturating_add(size_of::<Header>() as u64).to_string()));
    }
    let (nodes, order) = rest.split_at(node_bytes as usize);
    let nodes: Vec<WireNode> = bytemuck::pod_collect_to_vec(nodes);
    Ok(PeerTree {
        build_s: header.build_s,
        nodes: nodes.into_iter().map(Content::from).collect(),
        triangle_order: bytemuck::pod_collect_to_vec(order),
    })
}

fn read(path: &Path) -> Result<Vec<u8>, WireError> {
    std::fs::read(path).map_err(|source| WireError::Read { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;
    use prbvh::build::sah_sweep;
    use prbvh::bvh::{links_and_leaves, tree_hash};
    use prbvh::scene::{Noise, built_in};

    #[test]
    fn trees_and_triangles_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let triangles = built_in(40).triangles;
        let whole = Bvh::from_device(&sah_sweep(&triangles)).unwrap().with_boxes_of(&triangles);
        let path = folder.path().join("a");
        write_triangles(&path, &triangles).unwrap();
        let read: Vec<u32> = bytemuck::cast_slice(&read_triangles(&path).unwrap()).to_vec();
        assert_eq!(read, bytemuck::cast_slice::<_, u32>(&triangles));

        let contents = whole.nodes.iter().map(|node| node.content).collect();
        let sent = PeerTree { build_s: 0.25, nodes: contents, triangle_order: whole.triangle_order.clone() };
        write_tree(&path, &sent).unwrap();
        let came = read_tree(&path).unwrap();
        assert_eq!(came, sent);
        assert_eq!(tree_hash(&came.into_bvh().with_boxes_of(&triangles)), tree_hash(&whole));
    }

    #[test]
    fn a_file_cut_short_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let leaf = Content::Leaf { first: 0, count: 1 };
        write_tree(&path, &PeerTree { build_s: 1.0, nodes: vec![leaf], triangle_order: vec![0] }).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        for length in 0..bytes.len() {
            std::fs::write(&path, &bytes[..length]).unwrap();
            assert!(matches!(read_tree(&path), Err(WireError::Length { .. })), "{length} bytes");
        }
        std::fs::write(&path, [0; 35]).unwrap();
        assert!(matches!(read_triangles(&path), Err(WireError::Length { .. })));
        assert!(matches!(read_tree(&folder.path().join("b")), Err(WireError::Read { .. })));
    }

    #[test]
    fn links_that_lead_nowhere_are_found_afterwards() {
        let mut noise = Noise::new(1);
        let random = || noise.between(0.0, 9.0) as u32;
        let wild: Vec<u32> = std::iter::repeat_with(random).take(20).collect();
        let nodes = wild.chunks(2).map(|pair| Content::Internal { left: pair[0], right: pair[1] * 1000 }).collect();
        let tree = PeerTree { build_s: 0.0, nodes, triangle_order: vec![0, 1] }.into_bvh();
        assert!(!links_and_leaves(&tree, 2).is_empty());
    }
}
