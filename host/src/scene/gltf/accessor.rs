//! Reads accessors, after the checks that the gltf crate leaves out: it panics on counts of 0, on offsets that overflow, on a
//! stride smaller than the element, and on element types other than the expected.

use super::super::error::{Blame, Place, SceneError};
use gltf::Accessor;
use gltf::accessor::{DataType, Dimensions, Item, Iter};
use gltf::buffer::View;
use std::cell::Cell;

/// Most elements of accessors without data in a file, each counted as often as it is read: they take no space in the file, only in memory.
pub(super) const MOST_IMPLIED: usize = 1 << 20;

/// Reader of the accessors of one file.
pub(super) struct Accessors<'a> {
    pub(super) blame: Blame<'a>,
    pub(super) buffers: &'a [Vec<u8>],
    /// What is left of [`MOST_IMPLIED`].
    pub(super) implied: Cell<usize>,
}

impl Accessors<'_> {
    /// The elements of an accessor of three float32 each.
    pub(super) fn positions(&self, accessor: Accessor<'_>) -> Result<Vec<[f32; 3]>, SceneError> {
        if (accessor.data_type(), accessor.dimensions()) != (DataType::F32, Dimensions::Vec3) {
            return Err(self.fault(&accessor, "positions must be three float32".into()));
        }
        self.elements(accessor)
    }

    /// The elements of an accessor of one unsigned integer each.
    pub(super) fn indices(&self, accessor: Accessor<'_>) -> Result<Vec<u32>, SceneError> {
        match (accessor.data_type(), accessor.dimensions()) {
            (DataType::U8, Dimensions::Scalar) => {
                Ok(self.elements::<u8>(accessor)?.into_iter().map(u32::from).collect())
            }
            (DataType::U16, Dimensions::Scalar) => {
                Ok(self.elements::<u16>(accessor)?.into_iter().map(u32::from).collect())
            }
            (DataType::U32, Dimensions::Scalar) => self.elements(accessor),
            _ => Err(self.fault(&accessor, "indices must be one unsigned integer".into())),
        }
    }

    fn elements<T: Item>(&self, accessor: Accessor<'_>) -> Result<Vec<T>, SceneError> {
        self.check(&accessor, size_of::<T>()).map_err(|message| self.fault(&accessor, message))?;
        let fault = self.fault(&accessor, "the accessor has no data".into());
        let data = |buffer: gltf::Buffer<'_>| self.buffers.get(buffer.index()).map(Vec::as_slice);
        Ok(Iter::new(accessor, data).ok_or(fault)?.collect())
    }

    fn check(&self, accessor: &Accessor<'_>, size: usize) -> Result<(), String> {
        let count = accessor.count();
        match accessor.view() {
            Some(view) => self.check_range(&view, accessor.offset(), count, size)?,
            None => match self.implied.get().checked_sub(count) {
                Some(left) => self.implied.set(left),
                None => return Err(format!("{count} elements without data; at most {MOST_IMPLIED} in a file")),
            },
        }
        if let Some(sparse) = accessor.sparse() {
            if sparse.count() > count {
                return Err(format!("{} sparse elements of {count}", sparse.count()));
            }
            let (indices, values) = (sparse.indices(), sparse.values());
            self.check_range(&indices.view(), indices.offset(), sparse.count(), indices.index_type().size())?;
            self.check_range(&values.view(), values.offset(), sparse.count(), size)?;
        }
        Ok(())
    }

    /// Checks that `count` elements of `size` bytes from `offset` lie in the view, and the view in its buffer.
    fn check_range(&self, view: &View<'_>, offset: usize, count: usize, size: usize) -> Result<(), String> {
        let stride = view.stride().unwrap_or(size);
        if stride < size {
            return Err(format!("stride {stride} is less than the {size} bytes of an element"));
        }
        let last = count.checked_sub(1).ok_or("no elements")?;
        let end =
            last.checked_mul(stride).and_then(|end| end.checked_add(size)).and_then(|end| end.checked_add(offset));
        if end.is_none_or(|end| end > view.length()) {
            return Err(format!("{count} elements from byte {offset} pass the {} bytes of their view", view.length()));
        }
        let bytes = self.buffers.get(view.buffer().index()).map_or(0, Vec::len);
        let end = view.offset().checked_add(view.length());
        if end.is_none_or(|end| end > bytes) {
            return Err(format!(
                "view {} of {} bytes from byte {} passes the {bytes} bytes of its buffer",
                view.index(),
                view.length(),
                view.offset()
            ));
        }
        Ok(())
    }

    fn fault(&self, accessor: &Accessor<'_>, message: String) -> SceneError {
        self.blame.format(Place::Element("accessor", accessor.index() as u64), message)
    }
}
