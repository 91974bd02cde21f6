//! The buffers of a glTF file: beside it, in a data URI, or the blob of a GLB file. Only those are loaded that positions need.

use super::super::open::beside;
use super::document::{Buffer, Whole, get};
use super::extensions::packed;
use crate::scene::Place;
use crate::scene::error::{Blame, SceneError};
use data_url::DataUrl;
use percent_encoding::percent_decode_str;
use std::borrow::Cow;
use std::cell::OnceCell;
use std::path::Path;

/// The buffers of one file, loaded when they are asked for.
pub(super) struct Buffers<'a> {
    blame: Blame<'a>,
    buffers: &'a [Buffer],
    blob: Option<&'a [u8]>,
    /// Where relative paths start.
    folder: &'a Path,
    loaded: Vec<OnceCell<Cow<'a, [u8]>>>,
}

impl<'a> Buffers<'a> {
    pub(super) fn new(blame: Blame<'a>, buffers: &'a [Buffer], blob: Option<&'a [u8]>, folder: &'a Path) -> Self {
        Self { blame, buffers, blob, folder, loaded: buffers.iter().map(|_| OnceCell::new()).collect() }
    }

    /// The bytes of a buffer.
    pub(super) fn bytes(&self, index: Whole) -> Result<&[u8], SceneError> {
        let buffer = get(self.blame, self.buffers, index, "buffer")?;
        let cell = &self.loaded[index.0];
        if let Some(bytes) = cell.get() {
            return Ok(bytes);
        }
        let bytes = self.load(index.0, buffer).map_err(|message| self.fault(index, message))?;
        if bytes.len() < buffer.byte_length.0 {
            let message = format!("{} bytes of {} are there", bytes.len(), buffer.byte_length.0);
            return Err(self.fault(index, message));
        }
        Ok(cell.get_or_init(|| bytes))
    }

    fn load(&self, index: usize, buffer: &Buffer) -> Result<Cow<'a, [u8]>, String> {
        match (&buffer.uri, self.blob) {
            (Some(uri), _) if is_data(uri) => data_uri(uri).map(Cow::Owned),
            (Some(uri), _) => file(uri, self.folder, buffer.byte_length.0).map(Cow::Owned),
            (None, Some(blob)) if index == 0 => Ok(Cow::Borrowed(blob)),
            (None, _) => Err(match packed(&buffer.extensions) {
                Some(name) => format!("it has no bytes but those of the extension {name}, which is not read"),
                None => "it has no URI, and the file has no binary chunk for it".into(),
            }),
        }
    }

    fn fault(&self, index: Whole, message: String) -> SceneError {
        self.blame.format(Place::Element("buffer", index.0 as u64), message)
    }
}

fn is_data(uri: &str) -> bool {
    uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:"))
}

fn data_uri(uri: &str) -> Result<Vec<u8>, String> {
    let parsed = DataUrl::process(uri).map_err(|fault| format!("data URI: {fault:?}"))?;
    let (bytes, _) = parsed.decode_to_vec().map_err(|fault| format!("data URI: {fault:?}"))?;
    Ok(bytes)
}

/// The first `length` bytes of a file, or all if it has fewer.
fn file(uri: &str, folder: &Path, length: usize) -> Result<Vec<u8>, String> {
    if uri.contains("://") {
        return Err(format!("\"{uri}\" is not a file beside the scene"));
    }
    let relative = percent_decode_str(uri).decode_utf8().map_err(|fault| format!("\"{uri}\": {fault}"))?;
    // Some writers leave a name as it is that has a per cent sign of its own, or the backslashes of Windows.
    let names = [relative.to_string(), uri.to_owned(), relative.replace('\\', "/")];
    let name = names.iter().find(|name| folder.join(name).exists()).unwrap_or(&names[0]);
    beside(&folder.join(name), length)
}
