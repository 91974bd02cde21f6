//! Questions about a SPIR-V module.

use anyhow::{Result, anyhow};
use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Capability, Decoration, Op, StorageClass, Word};
use std::collections::HashMap;

/// # Errors
/// If the bytes are no SPIR-V.
pub(super) fn load(bytes: &[u8]) -> Result<Module> {
    rspirv::dr::load_bytes(bytes).map_err(|error| anyhow!("not SPIR-V: {error}"))
}

/// A module with an index of its definitions.
pub(super) struct Index<'a> {
    pub(super) module: &'a Module,
    definitions: HashMap<Word, &'a Instruction>,
}

impl<'a> Index<'a> {
    pub(super) fn new(module: &'a Module) -> Self {
        let definitions = module.all_inst_iter().filter_map(|inst| Some((inst.result_id?, inst))).collect();
        Self { module, definitions }
    }

    /// The instruction that defines `id`.
    pub(super) fn definition(&self, id: Word) -> Option<&'a Instruction> {
        self.definitions.get(&id).copied()
    }

    /// The type of the value `id`.
    pub(super) fn type_of(&self, id: Word) -> Option<&'a Instruction> {
        self.definition(self.definition(id)?.result_type?)
    }

    /// What the pointer type `pointer` points to.
    pub(super) fn pointee(&self, pointer: &Instruction) -> Option<&'a Instruction> {
        match (pointer.class.opcode, pointer.operands.get(1)) {
            (Op::TypePointer, Some(Operand::IdRef(id))) => self.definition(*id),
            _ => None,
        }
    }

    /// Global variables: id, storage class, type of the memory.
    pub(super) fn variables(&self) -> impl Iterator<Item = (Word, StorageClass, &'a Instruction)> {
        let globals = self.module.types_global_values.iter().filter(|inst| inst.class.opcode == Op::Variable);
        globals.filter_map(|inst| {
            let id = inst.result_id?;
            let &Operand::StorageClass(class) = inst.operands.first()? else { return None };
            Some((id, class, self.pointee(self.type_of(id)?)?))
        })
    }

    /// Operands of a decoration of `id`.
    pub(super) fn decoration(&self, id: Word, decoration: Decoration) -> Option<&'a [Operand]> {
        self.decoration_at(Op::Decorate, &[Operand::IdRef(id), Operand::Decoration(decoration)])
    }

    /// Operands of a decoration of member `k` of the structure type `id`.
    pub(super) fn member_decoration(&self, id: Word, k: u32, decoration: Decoration) -> Option<&'a [Operand]> {
        let start = [Operand::IdRef(id), Operand::LiteralBit32(k), Operand::Decoration(decoration)];
        self.decoration_at(Op::MemberDecorate, &start)
    }

    fn decoration_at(&self, opcode: Op, start: &[Operand]) -> Option<&'a [Operand]> {
        let mut annotations = self.module.annotations.iter();
        annotations.find_map(|inst| inst.operands.strip_prefix(start).filter(|_| inst.class.opcode == opcode))
    }

    /// Bytes of a value of type `id` in a buffer. `None` for types that have no size there.
    pub(super) fn size(&self, id: Word) -> Option<u32> {
        let inst = self.definition(id)?;
        match (inst.class.opcode, inst.operands.as_slice()) {
            (Op::TypeInt | Op::TypeFloat, [Operand::LiteralBit32(bits), ..]) => Some(bits / 8),
            (Op::TypeVector, [Operand::IdRef(element), Operand::LiteralBit32(length)]) => {
                Some(self.size(*element)? * length)
            }
            (Op::TypeArray, [_, Operand::IdRef(length)]) => {
                let &Operand::LiteralBit32(length) = self.definition(*length)?.operands.first()? else { return None };
                Some(literal(self.decoration(id, Decoration::ArrayStride)?)? * length)
            }
            (Op::TypeStruct, members) => {
                let ends = (0..).zip(members).map(|(k, member)| match member {
                    Operand::IdRef(member) => {
                        Some(literal(self.member_decoration(id, k, Decoration::Offset)?)? + self.size(*member)?)
                    }
                    _ => None,
                });
                ends.collect::<Option<Vec<_>>>()?.into_iter().max()
            }
            _ => None,
        }
    }

    /// Bytes of an array of scalars in the memory of a workgroup, where types have no decorations.
    pub(super) fn shared_bytes(&self, array: &Instruction) -> Option<u32> {
        match (array.class.opcode, array.operands.as_slice()) {
            (Op::TypeArray, [Operand::IdRef(element), Operand::IdRef(length)]) => {
                let &Operand::LiteralBit32(length) = self.definition(*length)?.operands.first()? else { return None };
                Some(self.size(*element)? * length)
            }
            _ => None,
        }
    }

    /// Which of the capabilities for 64-bit integers the module needs.
    pub(super) fn needs(&self, capability: Capability) -> bool {
        let is_64 = |inst: &Instruction| {
            inst.class.opcode == Op::TypeInt && inst.operands.first() == Some(&Operand::LiteralBit32(64))
        };
        match capability {
            Capability::Int64 => self.module.types_global_values.iter().any(is_64),
            Capability::Int64Atomics => self.module.all_inst_iter().any(|inst| {
                let pointer = inst.operands.first().filter(|_| inst.class.opname.starts_with("Atomic"));
                let Some(Operand::IdRef(pointer)) = pointer else { return false };
                self.type_of(*pointer).and_then(|inst| self.pointee(inst)).is_some_and(is_64)
            }),
            _ => true,
        }
    }
}

/// The single literal operand of a decoration.
pub(super) fn literal(operands: &[Operand]) -> Option<u32> {
    match operands {
        [Operand::LiteralBit32(value)] => Some(*value),
        _ => None,
    }
}

/// The capabilities a module declares.
pub(super) fn capabilities(module: &Module) -> Vec<Capability> {
    let operands = module.capabilities.iter().filter_map(|inst| inst.operands.first());
    operands.filter_map(|operand| if let Operand::Capability(name) = operand { Some(*name) } else { None }).collect()
}
