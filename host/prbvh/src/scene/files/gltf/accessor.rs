//! Reads accessors: numbers of a buffer, with some replaced.

use super::buffers::Buffers;
use super::document::{Accessor, Document, SparsePart, Whole, get};
use crate::scene::Place;
use crate::scene::error::{Blame, SceneError};
use std::cell::Cell;

/// Most elements of accessors without data in a file, each counted as often as it is read: they take no space in the file, only in memory.
pub(super) const MOST_IMPLIED: usize = 1 << 19;

/// Types of numbers, by what the format calls them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(number: Whole) -> Option<Self> {
        Some(match number.0 {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The number in `bytes`, and the one that stands for 1 where numbers are normalized.
    fn read(self, bytes: &[u8]) -> (f64, f64) {
        match (self, bytes) {
            (Self::I8, &[a]) => (i8::from_le_bytes([a]).into(), i8::MAX.into()),
            (Self::U8, &[a]) => (a.into(), u8::MAX.into()),
            (Self::I16, &[a, b]) => (i16::from_le_bytes([a, b]).into(), i16::MAX.into()),
            (Self::U16, &[a, b]) => (u16::from_le_bytes([a, b]).into(), u16::MAX.into()),
            (Self::U32, &[a, b, c, d]) => (u32::from_le_bytes([a, b, c, d]).into(), u32::MAX.into()),
            (Self::F32, &[a, b, c, d]) => (f32::from_le_bytes([a, b, c, d]).into(), 1.0),
            _ => unreachable!("a number has the bytes of its type"),
        }
    }

    /// The float32 of the number in `bytes`: as it is, or with the greatest one at 1 and none below -1.
    fn float(self, bytes: &[u8], normalized: bool) -> f32 {
        let (number, one) = self.read(bytes);
        if normalized && self != Self::F32 { (number / one).max(-1.0) as f32 } else { number as f32 }
    }
}

/// Reader of the accessors of one file.
pub(super) struct Accessors<'a> {
    pub(super) blame: Blame<'a>,
    pub(super) document: &'a Document,
    pub(super) buffers: Buffers<'a>,
    /// What is left of [`MOST_IMPLIED`].
    pub(super) implied: Cell<usize>,
}

impl Accessors<'_> {
    /// The accessor of a number.
    pub(super) fn get(&self, index: Whole) -> Result<&Accessor, SceneError> {
        get(self.blame, &self.document.accessors, index, "accessor")
    }

    /// Positions: float32, or whole numbers of 8 or 16 bits, as KHR_mesh_quantization has them.
    pub(super) fn positions(&self, index: Whole) -> Result<Vec<[f32; 3]>, SceneError> {
        self.floats(index, "VEC3", "three float32, or three whole numbers of 8 or 16 bits")
    }

    /// Elements of `N` numbers, as float32.
    pub(super) fn floats<const N: usize>(
        &self,
        index: Whole,
        shape: &str,
        wanted: &str,
    ) -> Result<Vec<[f32; N]>, SceneError> {
        let accessor = self.get(index)?;
        let component = Component::of(accessor.component_type).filter(|component| *component != Component::U32);
        let (Some(component), true) = (component, accessor.shape == shape) else {
            return Err(self.wrong(index, accessor, wanted));
        };
        let size = component.size();
        self.elements(index, accessor, N * size, [0.0; N], |bytes| {
            std::array::from_fn(|k| component.float(&bytes[k * size..][..size], accessor.normalized))
        })
    }

    /// Indices: one whole number each.
    pub(super) fn indices(&self, index: Whole) -> Result<Vec<u32>, SceneError> {
        let accessor = self.get(index)?;
        let component = unsigned(accessor.component_type);
        let (Some(component), "SCALAR") = (component, accessor.shape.as_str()) else {
            return Err(self.wrong(index, accessor, "one unsigned integer"));
        };
        self.elements(index, accessor, component.size(), 0, |bytes| component.read(bytes).0 as u32)
    }

    fn wrong(&self, index: Whole, accessor: &Accessor, wanted: &str) -> SceneError {
        let message =
            format!("its elements must be {wanted}, not {} of type {}", accessor.shape, accessor.component_type.0);
        self.fault(index, message)
    }

    /// The elements of `size` bytes each.
    fn elements<T: Clone>(
        &self,
        index: Whole,
        accessor: &Accessor,
        size: usize,
        zero: T,
        read: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, SceneError> {
        let count = accessor.count.0;
        if count == 0 {
            return Err(self.fault(index, "it has no elements".into()));
        }
        let mut elements: Vec<T> = match accessor.buffer_view {
            Some(view) => self.spread(index, view, accessor.byte_offset, count, size)?.map(&read).collect(),
            None => {
                self.imply(index, count)?;
                vec![zero; count]
            }
        };
        if let Some(sparse) = &accessor.sparse {
            let SparsePart { buffer_view, byte_offset, component_type } = sparse.indices;
            let component = unsigned(component_type)
                .ok_or_else(|| self.fault(index, format!("{} is no type of sparse indices", component_type.0)))?;
            let places = self.spread(index, buffer_view, byte_offset, sparse.count.0, component.size())?;
            let SparsePart { buffer_view, byte_offset, .. } = sparse.values;
            let values = self.spread(index, buffer_view, byte_offset, sparse.count.0, size)?;
            for (place, value) in places.zip(values) {
                let place = component.read(place).0 as usize;
                let missing = || self.fault(index, format!("sparse element {place} of {count}"));
                *elements.get_mut(place).ok_or_else(missing)? = read(value);
            }
        }
        Ok(elements)
    }

    /// Counts elements that have no data.
    pub(super) fn imply(&self, index: Whole, count: usize) -> Result<(), SceneError> {
        match self.implied.get().checked_sub(count) {
            Some(left) => self.implied.set(left),
            None => {
                let message = format!("{count} elements without data; at most {MOST_IMPLIED} in a file");
                return Err(self.fault(index, message));
            }
        }
        Ok(())
    }

    /// `count` elements of `size` bytes each, from `offset` in a view on.
    fn spread(
        &self,
        index: Whole,
        view: Whole,
        offset: Whole,
        count: usize,
        size: usize,
    ) -> Result<impl Iterator<Item = &[u8]>, SceneError> {
        let number = view.0;
        let view = get(self.blame, &self.document.buffer_views, view, "bufferView")?;
        let (start, length) = (view.byte_offset.0, view.byte_length.0);
        let stride = view.byte_stride.map_or(size, |stride| stride.0);
        if stride < size {
            return Err(self.fault(index, format!("stride {stride} is less than the {size} bytes of an element")));
        }
        let end = count.saturating_sub(1).checked_mul(stride).and_then(|end| end.checked_add(size));
        if end.and_then(|end| end.checked_add(offset.0)).is_none_or(|end| end > length) {
            let message = format!("{count} elements from byte {} pass the {length} bytes of their view", offset.0);
            return Err(self.fault(index, message));
        }
        let bytes = self.buffers.bytes(view.buffer)?;
        let view = start.checked_add(length).and_then(|end| bytes.get(start..end)).ok_or_else(|| {
            let message = format!(
                "view {number} of {length} bytes from byte {start} passes the {} bytes of its buffer",
                bytes.len()
            );
            self.fault(index, message)
        })?;
        // The last one may end before its stride does.
        Ok(view[offset.0..].chunks(stride.max(1)).take(count).map(move |chunk| &chunk[..size]))
    }

    pub(super) fn fault(&self, accessor: Whole, message: String) -> SceneError {
        self.blame.format(Place::Element("accessor", accessor.0 as u64), message)
    }
}

fn unsigned(component_type: Whole) -> Option<Component> {
    Component::of(component_type).filter(|one| matches!(one, Component::U8 | Component::U16 | Component::U32))
}
