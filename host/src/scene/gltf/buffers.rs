//! The buffers of a glTF file: beside it, in a data URI, or the blob of a GLB file.

use super::super::error::{Blame, Place, SceneError};
use data_url::DataUrl;
use gltf::Document;
use gltf::buffer::Source;
use percent_encoding::percent_decode_str;
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
                Source::Uri(uri) => beside(uri, folder).map_err(fault)?,
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

fn beside(uri: &str, folder: &Path) -> Result<Vec<u8>, String> {
    if uri.contains("://") {
        return Err(format!("\"{uri}\" is not a file beside the scene"));
    }
    let relative = percent_decode_str(uri).decode_utf8().map_err(|fault| format!("\"{uri}\": {fault}"))?;
    let path = folder.join(&*relative);
    std::fs::read(&path).map_err(|fault| format!("{}: {fault}", path.display()))
}
