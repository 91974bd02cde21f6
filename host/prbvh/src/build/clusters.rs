//! Agglomeration: the two clusters whose common box is smallest become one, again and again (Walter, Bala, Kulkarni & Pingali 2008, *Fast
//! Agglomerative Clustering for Rendering*, §3: the exact algorithm with the surface area as its measure).
//!
//! Each cluster knows its nearest one. A pair never comes nearer to a third cluster than the nearer of its halves was, so that only those look
//! anew whose nearest one is gone.

use prbvh_kernel::aabb::Aabb;

/// Some clusters.
#[derive(Debug, Default)]
pub(super) struct Clusters(Vec<Cluster>);

/// References that have become one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cluster {
    pub(super) aabb: Aabb,
    /// Its smallest reference.
    key: u32,
    /// What the caller calls it.
    pub(super) node: u32,
    /// Place of the nearest one.
    nearest: u32,
    /// [`rank`] of the two.
    rank: u64,
}

impl Cluster {
    /// A reference alone.
    pub(super) fn of(key: u32, aabb: Aabb) -> Self {
        Self { aabb, key, node: key, nearest: 0, rank: u64::MAX }
    }
}

/// How near two clusters are: the half area of their common box, then the bits in which their keys differ. The latter makes of equal boxes a balanced
/// tree, not a chain; and of two that are as near to a third only one comes first.
fn rank(a: &Cluster, b: &Cluster) -> u64 {
    // An extent of -0.0 may leave a sign.
    let area = a.aabb.union(b.aabb).half_area().abs();
    u64::from(area.to_bits()) << 32 | u64::from(a.key ^ b.key)
}

impl Clusters {
    pub(super) fn new(clusters: impl IntoIterator<Item = Cluster>) -> Self {
        let mut all = Self(clusters.into_iter().collect());
        let n = all.0.len();
        all.look_across(0..n, |i| i + 1..n);
        all
    }

    /// The only one that is left.
    pub(super) fn only(&self) -> Option<&Cluster> {
        if let [only] = &self.0[..] { Some(only) } else { None }
    }

    /// These and others, without a look at pairs that were known before.
    pub(super) fn join(mut self, other: Self) -> Self {
        let here = self.0.len();
        let moved = |cluster: Cluster| Cluster { nearest: cluster.nearest + here as u32, ..cluster };
        self.0.extend(other.0.into_iter().map(moved));
        let all = self.0.len();
        self.look_across(0..here, |_| here..all);
        self
    }

    /// Lets each in `places` and each of the others that belong to it know of the other.
    fn look_across(&mut self, places: std::ops::Range<usize>, others: impl Fn(usize) -> std::ops::Range<usize>) {
        for i in places {
            let mut cluster = self.0[i];
            for j in others(i) {
                let other = &mut self.0[j];
                let rank = rank(&cluster, other);
                if rank < other.rank {
                    (other.rank, other.nearest) = (rank, i as u32);
                }
                if rank < cluster.rank {
                    (cluster.rank, cluster.nearest) = (rank, j as u32);
                }
            }
            self.0[i] = cluster;
        }
    }

    /// Makes pairs until `most` clusters are left, at least one; `pair` makes one of two and names it. Ends early if it has no name.
    pub(super) fn merge_down(&mut self, most: usize, mut pair: impl FnMut(u32, u32) -> Option<u32>) -> Option<()> {
        while self.0.len() > most.max(1) {
            // Of pairs that are as near to each other the one with the smallest reference.
            let (first, a) =
                self.0.iter().copied().enumerate().min_by_key(|(_, cluster)| (cluster.rank, cluster.key))?;
            let second = a.nearest as usize;
            let b = self.0[second];
            let node = pair(a.node, b.node)?;
            let joined = Cluster { node, ..Cluster::of(a.key, a.aabb.union(b.aabb)) };
            self.replace(first.min(second), first.max(second), joined);
        }
        Some(())
    }

    /// Puts `pair` in the place of two, `first < second`.
    fn replace(&mut self, first: usize, second: usize, pair: Cluster) {
        self.0[first] = pair;
        self.0.swap_remove(second);
        let moved = self.0.len();
        for k in 0..self.0.len() {
            let nearest = self.0[k].nearest as usize;
            if k == first || nearest == first || nearest == second {
                self.look(k);
            } else if nearest == moved {
                self.0[k].nearest = second as u32;
            }
        }
    }

    /// Finds the nearest one of one.
    fn look(&mut self, k: usize) {
        let mut cluster = Cluster { rank: u64::MAX, ..self.0[k] };
        for (j, other) in self.0.iter().enumerate() {
            let rank = rank(&cluster, other);
            if rank < cluster.rank && j != k {
                (cluster.rank, cluster.nearest) = (rank, j as u32);
            }
        }
        self.0[k] = cluster;
    }
}
