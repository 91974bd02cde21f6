//! Buffers and the memory behind them.

use super::error::Call;
use super::heap::Part;
use super::logical::LogicalDevice;
use super::objects;
use crate::device::DeviceError;
use ash::vk;
use std::mem::ManuallyDrop;
use std::ptr::NonNull;
use std::sync::Arc;

/// Whether the host may reach into storage buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Access {
    /// Where both sides read and write the memory at full speed: lavapipe, most integrated GPUs.
    WherePossible,
    /// Never: all bytes go through the staging buffer.
    #[cfg_attr(not(test), expect(dead_code, reason = "tests take this way on devices that do not need it"))]
    Never,
}

/// What a buffer is for.
#[derive(Clone, Copy, Debug)]
pub(super) enum Purpose {
    /// Kernels read and write it.
    Storage(Access),
    /// The host reads and writes it, the device copies from and to it.
    Staging,
}

const HOST: vk::MemoryPropertyFlags = vk::MemoryPropertyFlags::from_raw(
    vk::MemoryPropertyFlags::HOST_VISIBLE.as_raw() | vk::MemoryPropertyFlags::HOST_COHERENT.as_raw(),
);
const HOST_CACHED: vk::MemoryPropertyFlags =
    vk::MemoryPropertyFlags::from_raw(HOST.as_raw() | vk::MemoryPropertyFlags::HOST_CACHED.as_raw());
const DEVICE: vk::MemoryPropertyFlags = vk::MemoryPropertyFlags::DEVICE_LOCAL;
/// The GPU's own memory behind a bus may be host-visible too, but is then not cached: reading it would be slow.
const UNIFIED: vk::MemoryPropertyFlags = vk::MemoryPropertyFlags::from_raw(HOST_CACHED.as_raw() | DEVICE.as_raw());

const ANY: vk::MemoryPropertyFlags = vk::MemoryPropertyFlags::empty();

impl Purpose {
    /// Properties of the memory, best first.
    fn wishes(self) -> &'static [vk::MemoryPropertyFlags] {
        match self {
            Self::Storage(Access::WherePossible) => &[UNIFIED, DEVICE, ANY],
            Self::Storage(Access::Never) => &[DEVICE, ANY],
            Self::Staging => &[HOST_CACHED, HOST],
        }
    }

    fn usage(self) -> vk::BufferUsageFlags {
        let transfer = vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST;
        match self {
            Self::Storage(_) => transfer | vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::INDIRECT_BUFFER,
            Self::Staging => transfer,
        }
    }

    fn is_mapped(self, properties: vk::MemoryPropertyFlags) -> bool {
        match self {
            Self::Storage(access) => access == Access::WherePossible && properties.contains(UNIFIED),
            Self::Staging => true,
        }
    }
}

/// A buffer and its memory. No work under way may use it while the host touches either: so it is between submissions, and of a [ring](super::ring) while a slot has landed.
pub(super) struct Allocation {
    // Declared before the memory, because a buffer ends before its memory.
    buffer: Handle,
    // Points into the memory.
    mapping: Option<NonNull<u8>>,
    _memory: Option<Memory>,
    bytes: u64,
}

/// A part of the device's memory that goes back to it.
struct Memory {
    /// There until it is dropped.
    part: ManuallyDrop<Part>,
    device: Arc<LogicalDevice>,
}

impl Memory {
    fn new(device: &Arc<LogicalDevice>, what: &str, requirements: vk::MemoryRequirements) -> Option<Self> {
        let part = ManuallyDrop::new(device.heap().allocate(what, requirements)?);
        Some(Self { part, device: Arc::clone(device) })
    }

    fn part(&self) -> &Part {
        &self.part
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        // SAFETY: taken once, here.
        let part = unsafe { ManuallyDrop::take(&mut self.part) };
        self.device.release(|_| self.device.heap().free(part));
    }
}

/// Whose buffer it is.
enum Handle {
    Own(objects::Buffer),
    /// From a byte on.
    Callers(vk::Buffer, u64),
}

/// A part of a buffer as commands take it.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Range {
    pub(super) buffer: vk::Buffer,
    pub(super) offset: u64,
    /// Bytes that were asked for.
    pub(super) bytes: u64,
}

impl Range {
    /// Bytes that the device fills: whole words, and never none.
    pub(super) fn padded(self) -> u64 {
        padded(self.bytes)
    }
}

/// Vulkan has no empty buffers and clears whole words.
fn padded(bytes: u64) -> u64 {
    bytes.max(1).next_multiple_of(4)
}

// SAFETY: the mapping belongs to this value alone, and neither it nor Vulkan cares which thread uses it.
unsafe impl Send for Allocation {}

impl Allocation {
    /// A buffer of `bytes` bytes with undefined content; `what` names it in errors.
    pub(super) fn new(
        device: &Arc<LogicalDevice>,
        what: &str,
        bytes: u64,
        purpose: Purpose,
    ) -> Result<Self, DeviceError> {
        let out_of_memory = |error| if is_out_of_memory(&error) { no_memory(device, what, bytes) } else { error };
        let info = vk::BufferCreateInfo::default()
            .size(padded(bytes))
            .usage(purpose.usage())
            .sharing_mode(vk::SharingMode::EXCLUSIVE);
        // SAFETY: a size above 0 and a usage of core Vulkan.
        let buffer = unsafe { objects::Buffer::new(device, &info) }.map_err(out_of_memory)?;
        device.set_name(buffer.raw(), what)?;
        // SAFETY: the buffer is of this device.
        let requirements = unsafe { device.raw().get_buffer_memory_requirements(buffer.raw()) };

        let types = device.physical().memory.memory_types_as_slice();
        let (index, properties) = choose_type(types, requirements.memory_type_bits, purpose.wishes())
            .ok_or_else(|| no_memory(device, what, bytes))?;
        let requirements = vk::MemoryRequirements { memory_type_bits: 1 << index, ..requirements };
        let memory = Memory::new(device, what, requirements).ok_or_else(|| no_memory(device, what, bytes))?;
        let (place, offset) = memory.part().place();
        // SAFETY: both are new, and so much of the memory belongs to the buffer as it demands.
        unsafe { device.raw().bind_buffer_memory(buffer.raw(), place, offset) }
            .call("vkBindBufferMemory")
            .map_err(out_of_memory)?;
        let mapping = if purpose.is_mapped(properties) { memory.part().mapping() } else { None };
        Ok(Self { buffer: Handle::Own(buffer), mapping, _memory: Some(memory), bytes })
    }

    /// A buffer of zeros through which bytes pass.
    pub(super) fn window(device: &Arc<LogicalDevice>, what: &str, bytes: u64) -> Result<Self, DeviceError> {
        let mut window = Self::new(device, what, bytes, Purpose::Staging)?;
        window.zero();
        Ok(window)
    }

    /// A part of a buffer of the caller's, which lives as long.
    pub(super) fn of_caller(buffer: vk::Buffer, offset: u64, bytes: u64) -> Self {
        Self { buffer: Handle::Callers(buffer, offset), mapping: None, _memory: None, bytes }
    }

    /// Whether the memory is our own.
    pub(super) fn is_own(&self) -> bool {
        matches!(self.buffer, Handle::Own(_))
    }

    /// The part of a buffer that it is, valid as long as `self` lives.
    pub(super) fn range(&self) -> Range {
        let (buffer, offset) = match &self.buffer {
            Handle::Own(buffer) => (buffer.raw(), 0),
            Handle::Callers(buffer, offset) => (*buffer, *offset),
        };
        Range { buffer, offset, bytes: self.bytes }
    }

    /// The buffer of a staging window, valid as long as `self` lives.
    pub(super) fn buffer(&self) -> vk::Buffer {
        self.range().buffer
    }

    /// The bytes that were asked for.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Whether the host can reach the content.
    pub(super) fn is_mapped(&self) -> bool {
        self.mapping.is_some()
    }

    /// The content, where the host can reach it. The device must have written it before, if only zeros.
    pub(super) fn mapped(&mut self) -> Option<&mut [u8]> {
        let length = usize::try_from(self.bytes).ok()?;
        // SAFETY: the mapping covers the buffer, its bytes were written before, and no work under way uses it for as long as
        // `self` is borrowed.
        self.mapping.map(|start| unsafe { std::slice::from_raw_parts_mut(start.as_ptr(), length) })
    }

    /// Writes zeros, where the host can reach the content; says whether it could.
    pub(super) fn zero(&mut self) -> bool {
        let (Some(start), Ok(length)) = (self.mapping, usize::try_from(self.bytes)) else { return false };
        // SAFETY: the mapping covers the buffer, and the device is at rest.
        unsafe { std::ptr::write_bytes(start.as_ptr(), 0, length) };
        true
    }
}

/// First memory type that grants the first wish that any grants.
fn choose_type(
    types: &[vk::MemoryType],
    allowed: u32,
    wishes: &[vk::MemoryPropertyFlags],
) -> Option<(u32, vk::MemoryPropertyFlags)> {
    wishes.iter().find_map(|&wish| {
        (0u32..)
            .zip(types)
            .find(|(index, kind)| allowed & (1 << index) != 0 && kind.property_flags.contains(wish))
            .map(|(index, kind)| (index, kind.property_flags))
    })
}

fn is_out_of_memory(error: &DeviceError) -> bool {
    use vk::Result as R;
    let &DeviceError::Vulkan { code, .. } = error else { return false };
    matches!(
        R::from_raw(code),
        R::ERROR_OUT_OF_DEVICE_MEMORY | R::ERROR_OUT_OF_HOST_MEMORY | R::ERROR_MEMORY_MAP_FAILED
    )
}

fn no_memory(device: &LogicalDevice, what: &str, bytes: u64) -> DeviceError {
    DeviceError::OutOfMemory { what: what.to_owned(), bytes, device: device.physical().summary.name.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn types(flags: &[vk::MemoryPropertyFlags]) -> Vec<vk::MemoryType> {
        flags.iter().map(|&property_flags| vk::MemoryType { property_flags, heap_index: 0 }).collect()
    }

    #[test]
    fn memory_behind_a_bus_is_staged() {
        let discrete = types(&[ANY, DEVICE, HOST, HOST_CACHED, DEVICE | HOST]);
        let storage = Purpose::Storage(Access::WherePossible);
        assert_eq!(choose_type(&discrete, !0, storage.wishes()), Some((1, DEVICE)));
        assert!(!storage.is_mapped(DEVICE | HOST));
        assert_eq!(choose_type(&discrete, !0, Purpose::Staging.wishes()), Some((3, HOST_CACHED)));
        assert_eq!(choose_type(&discrete, 0b10100, Purpose::Staging.wishes()), Some((2, HOST)));
        assert_eq!(choose_type(&discrete, 0b10, Purpose::Staging.wishes()), None);
    }

    #[test]
    fn memory_of_both_sides_is_mapped() {
        let unified = types(&[DEVICE, UNIFIED]);
        let storage = Purpose::Storage(Access::WherePossible);
        assert_eq!(choose_type(&unified, !0, storage.wishes()), Some((1, UNIFIED)));
        assert!(storage.is_mapped(UNIFIED));
        assert!(!Purpose::Storage(Access::Never).is_mapped(UNIFIED));
    }
}
