//! Faults planted in a module, each of which is named.

use super::super::testing::{committed, edit};
use super::*;
use rspirv::dr::Module;

/// A kernel with atomics, floats, read-only buffers and written ones, and of a workgroup.
const KERNEL: Kernel = Kernel::Cost;

fn with_fault(plant: impl FnOnce(&mut Module)) -> Vec<String> {
    let info = KERNEL.info();
    compare(&edit(&committed(info.name), plant), info).unwrap()
}

fn annotation(module: &mut Module, has: Operand) -> &mut Instruction {
    module.annotations.iter_mut().find(|inst| inst.operands.contains(&has)).unwrap()
}

fn decoration(name: Decoration) -> Operand {
    Operand::Decoration(name)
}

#[test]
fn committed_modules_have_no_faults() {
    let names = Kernel::ALL.iter().map(|kernel| kernel.info().name);
    let modules: Modules = names.map(|name| (name.to_owned(), committed(name))).collect();
    assert_eq!(faults(&modules), [""; 0]);
}

#[test]
fn a_missing_and_an_unknown_module_are_named() {
    let names = Kernel::ALL.iter().skip(1).map(|kernel| kernel.info().name);
    let mut modules: Modules = names.map(|name| (name.to_owned(), committed(name))).collect();
    modules.insert("of_old".to_owned(), Vec::new());
    let first = Kernel::ALL[0].info().name;
    assert_eq!(
        faults(&modules),
        [format!("{first}: there is no module"), "of_old: there is no such kernel".to_owned()]
    );
}

#[test]
fn a_wrong_workgroup_size() {
    let faults = with_fault(|module| module.execution_modes[0].operands[2] = Operand::LiteralBit32(32));
    assert_eq!(faults.len(), 1, "{faults:?}");
    assert!(faults[0].starts_with("execution modes are not LocalSize 64 1 1, but "), "{faults:?}");
}

#[test]
fn a_wrong_name_and_a_wrong_kind_of_entry() {
    let name = Operand::LiteralString("entries::cost_sums".to_owned());
    let model = Operand::ExecutionModel(ExecutionModel::Fragment);
    for faults in [
        with_fault(|module| module.entry_points[0].operands[2] = name),
        with_fault(|module| module.entry_points[0].operands[0] = model),
    ] {
        assert_eq!(faults.len(), 1, "{faults:?}");
        assert!(faults[0].starts_with("entry points are not one compute entry cost_sums, but "), "{faults:?}");
    }
}

#[test]
fn a_missing_binding_and_one_too_many() {
    let faults = with_fault(|module| {
        let binding = module.annotations.iter_mut().map(|inst| &mut inst.operands);
        let last = [decoration(Decoration::Binding), Operand::LiteralBit32(3)];
        let binding = binding.into_iter().find(|operands| operands.ends_with(&last)).unwrap();
        binding[2] = Operand::LiteralBit32(4);
    });
    assert_eq!(
        faults,
        [
            "binding 3 (report) is missing",
            "a buffer at (set, binding) (Some(0), Some(4)) that the kernel does not have"
        ]
    );
}

#[test]
fn another_descriptor_set() {
    let faults = with_fault(|module| {
        annotation(module, decoration(Decoration::DescriptorSet)).operands[2] = Operand::LiteralBit32(1);
    });
    assert_eq!(faults.len(), 2, "{faults:?}");
    assert!(faults[0].ends_with(" is missing"), "{faults:?}");
}

#[test]
fn a_wrong_stride() {
    let faults = with_fault(|module| {
        let stride = [decoration(Decoration::ArrayStride), Operand::LiteralBit32(32)];
        let mut annotations = module.annotations.iter_mut();
        let inst = annotations.find(|inst| inst.operands.ends_with(&stride)).unwrap();
        inst.operands[2] = Operand::LiteralBit32(48);
    });
    assert_eq!(faults, ["binding 0 (nodes) has elements of 32 bytes, but the module has a stride of 48"]);
}

#[test]
fn wrong_access() {
    let faults = with_fault(|module| {
        let inst = annotation(module, decoration(Decoration::NonWritable));
        inst.operands[1] = decoration(Decoration::Coherent);
    });
    assert_eq!(faults.len(), 1, "{faults:?}");
    assert!(faults[0].ends_with(" is only read, but lacks NonWritable"), "{faults:?}");
    let faults = with_fault(|module| {
        let mut annotations = module.annotations.iter().map(|inst| inst.operands.clone());
        let last = [decoration(Decoration::Binding), Operand::LiteralBit32(3)];
        let buffer = annotations.find(|operands| operands.ends_with(&last)).unwrap()[0].clone();
        let inst = annotation(module, decoration(Decoration::NonWritable)).clone();
        let operands = vec![buffer, decoration(Decoration::NonWritable)];
        module.annotations.push(Instruction { operands, ..inst });
    });
    assert_eq!(faults, ["binding 3 (report) is written, but is NonWritable"]);
}

#[test]
fn arithmetic_that_may_be_contracted() {
    let faults = with_fault(|module| {
        let is_it = |inst: &Instruction| inst.operands.contains(&decoration(Decoration::NoContraction));
        let at = module.annotations.iter().position(is_it).unwrap();
        module.annotations.remove(at);
    });
    assert_eq!(faults, ["1 float operations without NoContraction"]);
}

#[test]
fn capabilities_beyond_the_list_or_the_need() {
    for (capability, fault) in [
        (Capability::Float64, "capability Float64 is not allowed"),
        (Capability::Int64Atomics, "capability Int64Atomics is not needed"),
    ] {
        let faults = with_fault(|module| {
            let operands = vec![Operand::Capability(capability)];
            module.capabilities.push(Instruction::new(Op::Capability, None, None, operands));
        });
        assert_eq!(faults, [fault]);
    }
}

#[test]
fn a_second_array_of_the_workgroup_and_wrong_push_constants() {
    let faults = with_fault(|module| {
        let values = &mut module.types_global_values;
        let push = Operand::StorageClass(StorageClass::PushConstant);
        let variable = values.iter_mut().find(|inst| inst.class.opcode == Op::Variable && inst.operands[0] == push);
        variable.unwrap().operands[0] = Operand::StorageClass(StorageClass::Workgroup);
    });
    let bytes = KERNEL.info().push_bytes;
    let none = format!("push constants are not one block of {bytes} bytes, but []");
    let shared = KERNEL.info().shared_bytes;
    let two = format!("shared memory is not one array of {shared} bytes, but ");
    assert_eq!(faults.len(), 2, "{faults:?}");
    assert!(faults[0] == none && faults[1].starts_with(&two), "{faults:?}");
}

#[test]
fn shared_memory_of_another_size() {
    let words = (KERNEL.info().shared_bytes / 4) as u32;
    let faults = with_fault(|module| {
        let length = Operand::LiteralBit32(words);
        let values = &mut module.types_global_values;
        let constant = values.iter_mut().find(|inst| inst.class.opcode == Op::Constant && inst.operands[0] == length);
        constant.unwrap().operands[0] = Operand::LiteralBit32(words + 1);
    });
    let (bytes, more) = (4 * words, 4 * words + 4);
    assert_eq!(faults, [format!("shared memory is not one array of {bytes} bytes, but [{more}]")]);
}

#[test]
fn a_workgroup_that_the_table_does_not_know() {
    let info = KernelInfo { shared_bytes: 0, ..*KERNEL.info() };
    let faults = compare(&committed(info.name), &info).unwrap();
    for start in ["input Some([BuiltIn(WorkgroupId)])", "shared memory is not one array of 0 bytes", "3 barriers"] {
        assert!(faults.iter().any(|fault| fault.starts_with(start)), "{start}: {faults:?}");
    }
    let map = Kernel::SetupBoxes.info();
    let faults = compare(&committed(map.name), &KernelInfo { shared_bytes: 64, ..*map }).unwrap();
    for start in ["input Some([BuiltIn(GlobalInvocationId)])", "shared memory is not one array of 64", "0 barriers"] {
        assert!(faults.iter().any(|fault| fault.starts_with(start)), "{start}: {faults:?}");
    }
}

fn barriers_with(change: impl Fn(&mut Instruction)) -> Vec<String> {
    with_fault(|module| {
        let blocks = module.functions.iter_mut().flat_map(|function| &mut function.blocks);
        blocks.flat_map(|block| &mut block.instructions).for_each(|inst| {
            if inst.class.opcode == Op::ControlBarrier {
                change(inst);
            }
        });
    })
}

#[test]
fn barriers_that_are_none() {
    let faults = barriers_with(|inst| *inst = Instruction::new(Op::Nop, None, None, Vec::new()));
    assert_eq!(faults, [format!("0 barriers with {} bytes of shared memory", KERNEL.info().shared_bytes)]);
    let faults = barriers_with(|inst| inst.operands[2] = inst.operands[0].clone());
    assert_eq!(faults.len(), 3, "{faults:?}");
    let scopes = "a barrier has scopes and semantics [Some(2), Some(2), Some(2)]";
    assert!(faults.iter().all(|fault| fault.starts_with(scopes)), "{faults:?}");
}

#[test]
fn another_memory_model() {
    let glsl = Operand::MemoryModel(MemoryModel::GLSL450);
    let faults = with_fault(|module| module.memory_model.as_mut().unwrap().operands[1] = glsl);
    assert_eq!(faults.len(), 1, "{faults:?}");
    assert!(faults[0].starts_with("memory model is not Logical Vulkan, but "), "{faults:?}");
}
