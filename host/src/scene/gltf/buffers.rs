//! The buffers of a glTF file: beside it, in a data URI, or the blob of a GLB file.

use super::super::error::{Blame, Place, SceneError};
use data_url::DataUrl;
use gltf::Document;
use gltf::buffer::Source;
use percent_encoding::percent_decode_str;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Loads all buffers of `document`, whose relative paths start at `folder`.
pub(super) fn load(
    blame: Blame<'_>,
    document: &Document,
    mut blob: Option<Vec<u8>>,
    folder: &Path,
) -> Result<Vec<Vec<u8>>, SceneError> {
    document
        .buffers()
        .map(|buffer| {
            let fault = |message: String| blame.format(Place::Element("buffer", buffer.index() as u64), message);
            let bytes = match buffer.source() {
                Source::Bin => blob.take().ok_or_else(|| fault("the file has no binary chunk for it".into()))?,
                Source::Uri(uri) if uri.starts_with("data:") => data_uri(uri).map_err(fault)?,
                Source::Uri(uri) => beside(uri, folder, buffer.length()).map_err(fault)?,
            };
            if bytes.len() < buffer.length() {
                return Err(fault(format!("{} bytes of {} are there", bytes.len(), buffer.length())));
            }
            Ok(bytes)
        })
        .collect()
}

fn data_uri(uri: &str) -> Result<Vec<u8>, String> {
    let parsed = DataUrl::process(uri).map_err(|fault| format!("data URI: {fault:?}"))?;
    let (bytes, _) = parsed.decode_to_vec().map_err(|fault| format!("data URI: {fault:?}"))?;
    Ok(bytes)
}

/// The first `length` bytes of a file, or all if it has fewer.
fn beside(uri: &str, folder: &Path, length: usize) -> Result<Vec<u8>, String> {
    if uri.contains("://") {
        return Err(format!("\"{uri}\" is not a file beside the scene"));
    }
    let relative = percent_decode_str(uri).decode_utf8().map_err(|fault| format!("\"{uri}\": {fault}"))?;
    let path = folder.join(&*relative);
    let explain = |fault: io::Error| format!("{}: {fault}", path.display());
    // A device or a pipe could go on for ever.
    if !std::fs::metadata(&path).map_err(explain)?.is_file() {
        return Err(format!("{}: not a regular file", path.display()));
    }
    let mut bytes = Vec::new();
    let mut file = File::open(&path).map_err(explain)?.take(length as u64);
    file.read_to_end(&mut bytes).map_err(explain)?;
    Ok(bytes)
}
