//! What a SPIR-V module says of itself.

use prbvh_kernel::Kernel;

/// Words of a SPIR-V header.
const HEADER_WORDS: usize = 5;
const OP_CAPABILITY: u32 = 17;
const CAPABILITY_INT64: u32 = 11;
const CAPABILITY_INT64_ATOMICS: u32 = 12;

/// The module of a kernel, in words: the bytes of a file have no alignment.
pub(super) fn words(kernel: Kernel) -> Vec<u32> {
    let (words, _) = kernel.spirv().as_chunks();
    words.iter().map(|&word| u32::from_le_bytes(word)).collect()
}

/// Opcode and operands of each instruction of a module.
fn instructions(words: &[u32]) -> impl Iterator<Item = (u32, &[u32])> {
    let mut rest = words.get(HEADER_WORDS..).unwrap_or_default();
    std::iter::from_fn(move || {
        let first = *rest.first()?;
        let (instruction, after) = rest.split_at_checked((first >> 16).max(1) as usize)?;
        rest = after;
        Some((first & 0xffff, &instruction[1..]))
    })
}

/// Whether a kernel needs a device with `shaderInt64` and `shaderBufferInt64Atomics`.
#[must_use]
pub fn needs_atomics_64(kernel: Kernel) -> bool {
    is_of_wide_words(&words(kernel))
}

/// Whether a module needs 64-bit atomics.
pub(super) fn is_of_wide_words(words: &[u32]) -> bool {
    // Capabilities come first in a module.
    instructions(words)
        .take_while(|&(opcode, _)| opcode == OP_CAPABILITY)
        .any(|(_, operands)| matches!(operands, [CAPABILITY_INT64 | CAPABILITY_INT64_ATOMICS]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const OP_ENTRY_POINT: u32 = 15;
    const OP_EXECUTION_MODE: u32 = 16;
    const LOCAL_SIZE: u32 = 17;
    const GL_COMPUTE: u32 = 5;

    fn name(words: &[u32]) -> String {
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).take_while(|&byte| byte != 0).collect();
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn each_kernel_is_the_only_entry_point_of_its_module() {
        for &kernel in Kernel::ALL {
            let words = words(kernel);
            let entries: Vec<_> = instructions(&words).filter(|&(opcode, _)| opcode == OP_ENTRY_POINT).collect();
            let [(_, [GL_COMPUTE, _, entry @ ..])] = entries[..] else { panic!("{kernel:?}: {entries:?}") };
            assert_eq!(name(entry), kernel.info().name);
            let modes: Vec<_> = instructions(&words).filter(|&(opcode, _)| opcode == OP_EXECUTION_MODE).collect();
            let [(_, [_, LOCAL_SIZE, size @ ..])] = modes[..] else { panic!("{kernel:?}: {modes:?}") };
            assert_eq!(size, [prbvh_kernel::grid::WORKGROUP_SIZE, 1, 1]);
        }
    }

    #[test]
    fn only_locks_of_one_word_need_64_bits() {
        for &kernel in Kernel::ALL {
            let is_wide = matches!(kernel, Kernel::PrbvhLock | Kernel::PrbvhCheck | Kernel::WorstTail);
            assert_eq!(needs_atomics_64(kernel), is_wide, "{kernel:?}");
        }
        assert!(!is_of_wide_words(&[0x0723_0203, 0x0001_0500, 0, 1, 0, 0x0002_0011, 1]), "a module with Shader alone");
        assert!(!is_of_wide_words(&[0x0723_0203]), "a module cut short");
    }
}
