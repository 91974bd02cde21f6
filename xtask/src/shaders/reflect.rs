//! Compares a module with what the kernel crate says of the kernel.

use super::ir::{self, Index, literal};
use super::{Modules, exact};
use anyhow::Result;
use prbvh_kernel::{Access, Kernel, KernelInfo, grid};
use rspirv::dr::{Instruction, Operand};
use rspirv::spirv::{
    AddressingModel, BuiltIn, Capability, Decoration, ExecutionMode, ExecutionModel, MemoryModel, MemorySemantics, Op,
    Scope, StorageClass, Word,
};
use std::collections::BTreeMap;

/// All that a device is asked for.
const CAPABILITIES: [Capability; 4] =
    [Capability::Shader, Capability::VulkanMemoryModel, Capability::Int64, Capability::Int64Atomics];

/// What is wrong with the modules of all kernels.
pub(super) fn faults(modules: &Modules) -> Vec<String> {
    let mut faults = Vec::new();
    for info in Kernel::ALL.iter().map(|kernel| kernel.info()) {
        match modules.get(info.name).map(|module| compare(module, info)) {
            None => faults.push(format!("{}: there is no module", info.name)),
            Some(Err(error)) => faults.push(format!("{}: {error:#}", info.name)),
            Some(Ok(found)) => faults.extend(found.into_iter().map(|fault| format!("{}: {fault}", info.name))),
        }
    }
    let listed = |name: &String| Kernel::ALL.iter().any(|kernel| kernel.info().name == name);
    faults.extend(modules.keys().filter(|&name| !listed(name)).map(|name| format!("{name}: there is no such kernel")));
    faults
}

/// What is wrong with one module.
///
/// # Errors
/// If it is no SPIR-V.
fn compare(module: &[u8], info: &KernelInfo) -> Result<Vec<String>> {
    let module = ir::load(module)?;
    let index = Index::new(&module);
    let mut faults = Vec::new();
    entry(&index, info, &mut faults);
    capabilities(&index, &mut faults);
    variables(&index, info, &mut faults);
    barriers(&index, info, &mut faults);
    let bare = exact::bare_arithmetic(&module).len();
    if bare > 0 {
        faults.push(format!("{bare} float operations without NoContraction"));
    }
    faults.extend(exact::inexact(&module).into_iter().map(|name| format!("{name}: its result depends on the driver")));
    Ok(faults)
}

fn entry(index: &Index<'_>, info: &KernelInfo, faults: &mut Vec<String>) {
    let entries: Vec<_> = index.module.entry_points.iter().map(|inst| inst.operands.as_slice()).collect();
    let name = Operand::LiteralString(info.name.to_owned());
    match entries.as_slice() {
        [[Operand::ExecutionModel(ExecutionModel::GLCompute), Operand::IdRef(_), found, ..]] if *found == name => {}
        other => faults.push(format!("entry points are not one compute entry {}, but {other:?}", info.name)),
    }
    let size = [grid::WORKGROUP_SIZE, 1, 1].map(Operand::LiteralBit32);
    let modes: Vec<_> = index.module.execution_modes.iter().map(|inst| &inst.operands[1..]).collect();
    let local_size = [&[Operand::ExecutionMode(ExecutionMode::LocalSize)], &size[..]].concat();
    if modes != [local_size.as_slice()] {
        faults.push(format!("execution modes are not LocalSize {} 1 1, but {modes:?}", grid::WORKGROUP_SIZE));
    }
}

fn capabilities(index: &Index<'_>, faults: &mut Vec<String>) {
    for capability in ir::capabilities(index.module) {
        if !CAPABILITIES.contains(&capability) {
            faults.push(format!("capability {capability:?} is not allowed"));
        } else if !index.needs(capability) {
            faults.push(format!("capability {capability:?} is not needed"));
        }
    }
    faults.extend(index.module.extensions.iter().map(|inst| format!("extension {:?} is not allowed", inst.operands)));
    let model = [Operand::AddressingModel(AddressingModel::Logical), Operand::MemoryModel(MemoryModel::Vulkan)];
    let found = index.module.memory_model.as_ref().map(|inst| inst.operands.as_slice());
    if found != Some(&model) {
        faults.push(format!("memory model is not Logical Vulkan, but {found:?}"));
    }
}

/// What a kernel may ask of its place in the dispatch: an invocation its own number, a workgroup the group's and the lane's.
const fn inputs(info: &KernelInfo) -> &'static [BuiltIn] {
    if info.shared_bytes == 0 {
        &[BuiltIn::GlobalInvocationId, BuiltIn::NumWorkgroups]
    } else {
        &[BuiltIn::WorkgroupId, BuiltIn::LocalInvocationIndex, BuiltIn::NumWorkgroups]
    }
}

/// Barriers of a workgroup belong to shared memory: without it nobody waits, and with it nothing else keeps phases apart.
fn barriers(index: &Index<'_>, info: &KernelInfo, faults: &mut Vec<String>) {
    let barriers: Vec<_> =
        index.module.all_inst_iter().filter(|inst| inst.class.opcode == Op::ControlBarrier).collect();
    if barriers.is_empty() != (info.shared_bytes == 0) {
        faults.push(format!("{} barriers with {} bytes of shared memory", barriers.len(), info.shared_bytes));
    }
    let semantics = MemorySemantics::ACQUIRE_RELEASE | MemorySemantics::WORKGROUP_MEMORY;
    // Of a wide phase.
    let wide =
        semantics | MemorySemantics::UNIFORM_MEMORY | MemorySemantics::MAKE_AVAILABLE | MemorySemantics::MAKE_VISIBLE;
    let of =
        |semantics: MemorySemantics| [Scope::Workgroup as u32, Scope::Workgroup as u32, semantics.bits()].map(Some);
    let (wanted, wanted_wide) = (of(semantics), of(wide));
    for barrier in barriers {
        let constant = |operand: &Operand| {
            let id = operand.id_ref_any()?;
            if let Operand::LiteralBit32(value) = index.definition(id)?.operands.first()? { Some(*value) } else { None }
        };
        let found: Vec<_> = barrier.operands.iter().map(constant).collect();
        if found != wanted && found != wanted_wide {
            faults.push(format!("a barrier has scopes and semantics {found:?}, not {wanted:?}"));
        }
    }
}

fn variables(index: &Index<'_>, info: &KernelInfo, faults: &mut Vec<String>) {
    let mut buffers = BTreeMap::new();
    let mut push = Vec::new();
    let mut shared = Vec::new();
    for (id, class, memory) in index.variables() {
        match class {
            StorageClass::StorageBuffer => {
                let number = |decoration| literal(index.decoration(id, decoration)?);
                let place = (number(Decoration::DescriptorSet), number(Decoration::Binding));
                if buffers.insert(place, (id, memory)).is_some() {
                    faults.push(format!("two buffers at (set, binding) {place:?}"));
                }
            }
            StorageClass::PushConstant => push.push(memory.result_id.and_then(|memory| index.size(memory))),
            StorageClass::Input => {
                let built_in = index.decoration(id, Decoration::BuiltIn);
                let known = inputs(info).iter().map(|&name| [Operand::BuiltIn(name)]).collect::<Vec<_>>();
                if !known.iter().any(|known| built_in == Some(known)) {
                    faults.push(format!("input {built_in:?} is not allowed"));
                }
            }
            StorageClass::Workgroup => shared.push(index.shared_bytes(memory)),
            StorageClass::Private => {}
            other => faults.push(format!("{other:?} memory is not allowed")),
        }
    }
    let bytes: Vec<usize> = push.iter().map(|size| size.map_or(0, |size| size as usize)).collect();
    if bytes != [info.push_bytes] {
        faults.push(format!("push constants are not one block of {} bytes, but {bytes:?}", info.push_bytes));
    }
    let bytes: Vec<usize> = shared.iter().map(|size| size.map_or(0, |size| size as usize)).collect();
    if bytes != if info.shared_bytes == 0 { vec![] } else { vec![info.shared_bytes] } {
        faults.push(format!("shared memory is not one array of {} bytes, but {bytes:?}", info.shared_bytes));
    }
    for (binding, wanted) in (0..).zip(info.bindings) {
        let what = format!("binding {binding} ({})", wanted.name);
        let Some((id, memory)) = buffers.remove(&(Some(0), Some(binding))) else {
            faults.push(format!("{what} is missing"));
            continue;
        };
        let stride = element_stride(index, memory);
        if stride.is_none_or(|stride| stride as usize != wanted.element_bytes) {
            let stride = stride.map_or_else(|| "no".to_owned(), |stride| stride.to_string());
            faults.push(format!(
                "{what} has elements of {} bytes, but the module has a stride of {stride}",
                wanted.element_bytes
            ));
        }
        match (wanted.access, is_read_only(index, id, memory)) {
            (Access::Read, false) => faults.push(format!("{what} is only read, but lacks NonWritable")),
            (Access::Write, true) => faults.push(format!("{what} is written, but is NonWritable")),
            _ => {}
        }
    }
    let more =
        buffers.keys().map(|place| format!("a buffer at (set, binding) {place:?} that the kernel does not have"));
    faults.extend(more);
}

/// Stride of a buffer that is a structure of nothing but an array without length.
fn element_stride(index: &Index<'_>, memory: &Instruction) -> Option<u32> {
    index.decoration(memory.result_id?, Decoration::Block)?;
    match (memory.class.opcode, memory.operands.as_slice()) {
        (Op::TypeStruct, [Operand::IdRef(array)]) => {
            let is_array = index.definition(*array)?.class.opcode == Op::TypeRuntimeArray;
            literal(index.decoration(*array, Decoration::ArrayStride).filter(|_| is_array)?)
        }
        _ => None,
    }
}

fn is_read_only(index: &Index<'_>, id: Word, memory: &Instruction) -> bool {
    let of_member = |memory| index.member_decoration(memory, 0, Decoration::NonWritable).is_some();
    index.decoration(id, Decoration::NonWritable).is_some() || memory.result_id.is_some_and(of_member)
}

#[cfg(test)]
#[path = "reflect_tests.rs"]
mod tests;
