//! Trees of other libraries, in and out; `docs/interop.md` says what each of them can hold.
//!
//! | library | module | feature |
//! |---|---|---|
//! | obvhs 0.4 | `interop::obvhs` | `obvhs` |
//! | `bvh` 0.13 | `interop::bvh` | `bvh` |
//! | tinybvh 1.6: `BVH`, `BVH_GPU` | [`tinybvh`] | |
//! | tinybvh 1.6: `BVH8_CWBVH` | [`tinybvh_wide`] | |
//! | Embree 4: nodes of `BVH4`, callbacks of `rtcBuildBVH` | [`embree`] | |
//! | any with siblings side by side | [`FlatTree`](crate::bvh::FlatTree) | |
//! | any with nodes behind pointers | [`build`] | |
//!
//! What comes in is checked as far as it says where to go on ([`Bvh::from_parts`](crate::bvh::Bvh::from_parts)).

mod assemble;
#[cfg(feature = "bvh")]
pub mod bvh;
pub mod embree;
#[cfg(feature = "obvhs")]
pub mod obvhs;
pub mod tinybvh;
pub mod tinybvh_wide;

pub use assemble::build;
