//! Committed modules, and modules with a fault planted in them.

use super::ir;
use crate::repo;
use rspirv::binary::Assemble;
use rspirv::dr::Module;

/// A module of kernel/spv.
pub(super) fn committed(name: &str) -> Vec<u8> {
    let path = repo::root().unwrap().join(format!("kernel/spv/{name}.spv"));
    std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The module after a change, which must be one.
pub(super) fn edit(bytes: &[u8], change: impl FnOnce(&mut Module)) -> Vec<u8> {
    let mut module = ir::load(bytes).unwrap();
    change(&mut module);
    let changed: Vec<u8> = module.assemble().into_iter().flat_map(u32::to_le_bytes).collect();
    assert_ne!(changed, bytes, "the planted fault changed nothing");
    changed
}
