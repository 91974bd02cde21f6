//! Makes float arithmetic exact and modules small, before and after spirv-opt.
//!
//! Without `NoContraction` spirv-opt turns `a*b + c` into a fused operation and refactors sums, and so may a driver: bits
//! would depend on them.

use super::ir::{self, Index};
use anyhow::{Result, bail, ensure};
use rspirv::binary::Assemble;
use rspirv::dr::{Instruction, Module, Operand};
use rspirv::grammar;
use rspirv::spirv::{Decoration, Op, Word};
use std::collections::HashSet;

/// Instructions of GLSL.std.450 whose results Vulkan defines to the bit.
const EXACT_GLSL: [&str; 28] = [
    "Round",
    "RoundEven",
    "Trunc",
    "FAbs",
    "SAbs",
    "FSign",
    "SSign",
    "Floor",
    "Ceil",
    "FMin",
    "UMin",
    "SMin",
    "FMax",
    "UMax",
    "SMax",
    "FClamp",
    "UClamp",
    "SClamp",
    "FindILsb",
    "FindSMsb",
    "FindUMsb",
    "NMin",
    "NMax",
    "NClamp",
    "Ldexp",
    "Frexp",
    "FrexpStruct",
    "Modf",
];

/// Renames the entry point, decorates float arithmetic and leaves out debug information.
///
/// # Errors
/// If the entry point is not there, or names an instruction whose result depends on the driver.
pub(super) fn decorate(bytes: &[u8], entry: &str, name: &str) -> Result<Vec<u8>> {
    let mut module = ir::load(bytes)?;
    rename(&mut module, entry, name)?;
    strip(&mut module);
    let inexact = inexact(&module);
    ensure!(inexact.is_empty(), "the result depends on the driver: {}", inexact.join(", "));
    let bare = bare_arithmetic(&module);
    module.annotations.extend(bare.into_iter().map(|id| {
        let operands = vec![Operand::IdRef(id), Operand::Decoration(Decoration::NoContraction)];
        Instruction::new(Op::Decorate, None, None, operands)
    }));
    Ok(assemble(&module))
}

/// Drops the capabilities that were declared for all kernels and that this one does not need.
///
/// # Errors
/// If the bytes are no SPIR-V.
pub(super) fn trim(bytes: &[u8]) -> Result<Vec<u8>> {
    let mut module = ir::load(bytes)?;
    let index = Index::new(&module);
    let needed: Vec<bool> = ir::capabilities(&module).into_iter().map(|capability| index.needs(capability)).collect();
    let mut needed = needed.into_iter();
    module.capabilities.retain(|_| needed.next().unwrap_or(true));
    Ok(assemble(&module))
}

/// Results of float arithmetic without `NoContraction`.
pub(super) fn bare_arithmetic(module: &Module) -> Vec<Word> {
    let decorated: HashSet<Word> = module
        .annotations
        .iter()
        .filter_map(|inst| match (inst.class.opcode, inst.operands.as_slice()) {
            (Op::Decorate, [Operand::IdRef(id), Operand::Decoration(Decoration::NoContraction)]) => Some(*id),
            _ => None,
        })
        .collect();
    let arithmetic = module.all_inst_iter().filter(|inst| is_float_arithmetic(inst.class.opcode));
    arithmetic.filter_map(|inst| inst.result_id).filter(|id| !decorated.contains(id)).collect()
}

/// Names of the extended instructions whose results Vulkan leaves to the driver.
pub(super) fn inexact(module: &Module) -> Vec<String> {
    let set = |id: Word| {
        let import = module.ext_inst_imports.iter().find(|inst| inst.result_id == Some(id))?;
        if let Operand::LiteralString(name) = import.operands.first()? { Some(name.as_str()) } else { None }
    };
    let name = |inst: &Instruction| match inst.operands.as_slice() {
        [Operand::IdRef(id), Operand::LiteralExtInstInteger(number), ..] => {
            let set = set(*id).unwrap_or("?");
            let known = grammar::ext_inst_table(set).and_then(|table| table.lookup_opcode(*number));
            let name = known.map_or_else(|| number.to_string(), |inst| inst.opname.to_owned());
            let exact = set == "GLSL.std.450" && EXACT_GLSL.contains(&name.as_str());
            (!exact).then(|| format!("{set} {name}"))
        }
        _ => Some("an extended instruction without a name".to_owned()),
    };
    let mut names: Vec<String> =
        module.all_inst_iter().filter(|inst| inst.class.opcode == Op::ExtInst).filter_map(name).collect();
    names.sort();
    names.dedup();
    names
}

fn is_float_arithmetic(opcode: Op) -> bool {
    use Op::{
        Dot, FAdd, FDiv, FMod, FMul, FNegate, FRem, FSub, MatrixTimesMatrix, MatrixTimesScalar, MatrixTimesVector,
        OuterProduct, VectorTimesMatrix, VectorTimesScalar,
    };
    matches!(opcode, FAdd | FSub | FMul | FDiv | FRem | FMod | FNegate | Dot | OuterProduct)
        || matches!(opcode, VectorTimesScalar | MatrixTimesScalar)
        || matches!(opcode, VectorTimesMatrix | MatrixTimesVector | MatrixTimesMatrix)
}

fn rename(module: &mut Module, from: &str, to: &str) -> Result<()> {
    let names = module.entry_points.iter_mut().filter_map(|inst| inst.operands.get_mut(2));
    let mut found = 0;
    for name in names.filter(|name| **name == Operand::LiteralString(from.to_owned())) {
        *name = Operand::LiteralString(to.to_owned());
        found += 1;
    }
    if found != 1 {
        bail!("{found} entry points are called {from}");
    }
    Ok(())
}

fn strip(module: &mut Module) {
    module.debug_string_source.clear();
    module.debug_names.clear();
    module.debug_module_processed.clear();
    let keep = |inst: &Instruction| !matches!(inst.class.opcode, Op::Line | Op::NoLine);
    module.types_global_values.retain(keep);
    for block in module.functions.iter_mut().flat_map(|function| &mut function.blocks) {
        block.instructions.retain(keep);
    }
}

fn assemble(module: &Module) -> Vec<u8> {
    module.assemble().into_iter().flat_map(u32::to_le_bytes).collect()
}

#[cfg(test)]
mod tests {
    use super::super::testing::{committed, edit};
    use super::*;

    fn count(module: &Module, opcode: Op) -> usize {
        module.all_inst_iter().filter(|inst| inst.class.opcode == opcode).count()
    }

    #[test]
    fn every_arithmetic_instruction_is_decorated_and_no_other() {
        let bare = edit(&committed("prbvh_search"), |module| {
            module.annotations.retain(|inst| !inst.operands.contains(&Operand::Decoration(Decoration::NoContraction)));
        });
        let before = ir::load(&bare).unwrap();
        let arithmetic: usize =
            [Op::FAdd, Op::FSub, Op::FMul, Op::FNegate].map(|opcode| count(&before, opcode)).iter().sum();
        assert!(arithmetic > 20, "{arithmetic} instructions");
        assert_eq!(bare_arithmetic(&before).len(), arithmetic);
        let after = ir::load(&decorate(&bare, "prbvh_search", "search").unwrap()).unwrap();
        assert_eq!(after.annotations.len(), before.annotations.len() + arithmetic);
        assert!(bare_arithmetic(&after).is_empty());
        assert_eq!(after.entry_points[0].operands[2], Operand::LiteralString("search".to_owned()));
    }

    #[test]
    fn an_unknown_entry_point_is_refused() {
        let error = decorate(&committed("cost_sums"), "entries::cost_sums", "cost_sums").unwrap_err();
        assert_eq!(error.to_string(), "0 entry points are called entries::cost_sums");
    }

    #[test]
    fn instructions_that_depend_on_the_driver_are_refused_by_name() {
        let fused = edit(&committed("prbvh_search"), |module| {
            let mut names = module.ext_inst_imports.iter_mut().map(|inst| &mut inst.operands[0]);
            assert!(names.all(|name| *name == Operand::LiteralString("GLSL.std.450".to_owned())));
            let import = module.ext_inst_imports.first().and_then(|inst| inst.result_id).unwrap_or_else(|| {
                let header = module.header.as_mut().unwrap();
                let id = header.bound;
                header.bound += 1;
                let operands = vec![Operand::LiteralString("GLSL.std.450".to_owned())];
                module.ext_inst_imports.push(Instruction::new(Op::ExtInstImport, None, Some(id), operands));
                id
            });
            let mut instructions = module.functions.iter_mut().flat_map(|function| function.all_inst_iter_mut());
            let sum = instructions.find(|inst| inst.class.opcode == Op::FAdd).unwrap();
            sum.class = Instruction::new(Op::ExtInst, None, None, Vec::new()).class;
            let fma = rspirv::spirv::GlslStd450Op::Fma as u32;
            sum.operands.splice(..0, [Operand::IdRef(import), Operand::LiteralExtInstInteger(fma)]);
            let third = sum.operands[2].clone();
            sum.operands.push(third);
        });
        let error = decorate(&fused, "prbvh_search", "prbvh_search").unwrap_err();
        assert_eq!(error.to_string(), "the result depends on the driver: GLSL.std.450 Fma");
    }

    #[test]
    fn debug_information_is_left_out() {
        let wordy = edit(&committed("cost_sums"), |module| {
            let path = Operand::LiteralString("kernel/src/somebody.rs".to_owned());
            module.debug_module_processed.push(Instruction::new(Op::ModuleProcessed, None, None, vec![path]));
        });
        assert!(String::from_utf8_lossy(&wordy).contains("somebody"));
        let quiet = decorate(&wordy, "cost_sums", "cost_sums").unwrap();
        assert!(!String::from_utf8_lossy(&quiet).contains("somebody"));
    }

    #[test]
    fn a_module_declares_64_bit_integers_only_if_it_has_them() {
        for (name, has_atomics) in [("prbvh_lock", true), ("setup_boxes", false)] {
            let all = edit(&committed(name), |module| {
                module.capabilities.retain(|inst| !inst.operands.iter().any(is_64));
                for capability in SIXTY_FOUR {
                    let operands = vec![Operand::Capability(capability)];
                    module.capabilities.push(Instruction::new(Op::Capability, None, None, operands));
                }
            });
            let left = ir::capabilities(&ir::load(&trim(&all).unwrap()).unwrap());
            let expected = if has_atomics { SIXTY_FOUR.to_vec() } else { Vec::new() };
            let left: Vec<_> = left.into_iter().filter(|name| SIXTY_FOUR.contains(name)).collect();
            assert_eq!(left, expected, "{name}");
        }
    }

    use rspirv::spirv::Capability;

    const SIXTY_FOUR: [Capability; 2] = [Capability::Int64, Capability::Int64Atomics];

    fn is_64(operand: &Operand) -> bool {
        SIXTY_FOUR.map(Operand::Capability).contains(operand)
    }
}
