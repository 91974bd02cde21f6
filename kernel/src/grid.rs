//! How invocations are numbered.

#[cfg(target_arch = "spirv")]
use spirv_std::glam::UVec3;

/// Invocations of a workgroup; every entry has this literal in `threads(..)`.
pub const WORKGROUP_SIZE: u32 = 64;

/// Workgroups along x before the grid grows along y: Vulkan promises 65,535 per axis.
pub const MAX_WORKGROUPS_X: u32 = 32_768;

/// Number of the invocation in a grid of one or two dimensions.
#[cfg(target_arch = "spirv")]
#[inline(always)]
pub fn linear_id(id: UVec3, workgroups: UVec3) -> u32 {
    id.x + id.y * (workgroups.x * WORKGROUP_SIZE)
}

/// Number of the workgroup in a grid of one or two dimensions.
#[cfg(target_arch = "spirv")]
#[inline(always)]
pub fn linear_group(id: UVec3, workgroups: UVec3) -> u32 {
    id.x + id.y * workgroups.x
}

/// Invocations of so many workgroups.
#[must_use]
pub const fn invocations(groups: u32) -> u32 {
    groups * WORKGROUP_SIZE
}

/// Workgroups `[x, y, z]` that hold at least `count` invocations.
#[must_use]
pub fn workgroups(count: u32) -> [u32; 3] {
    let groups = count.div_ceil(WORKGROUP_SIZE);
    if groups <= MAX_WORKGROUPS_X { [groups, 1, 1] } else { [MAX_WORKGROUPS_X, groups.div_ceil(MAX_WORKGROUPS_X), 1] }
}
