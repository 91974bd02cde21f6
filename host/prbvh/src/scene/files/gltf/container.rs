//! From the bytes of a file to its document and its binary chunk.

use super::super::format::without_mark;
use super::document::Document;
use crate::scene::Place;
use crate::scene::error::{Blame, SceneError};
use crate::scene::files::notes::Notes;

/// What a GLB file begins with.
const MAGIC: &[u8] = b"glTF";
const HEADER_BYTES: usize = 12;
const CHUNK_HEADER_BYTES: usize = 8;

/// Reads a document, and the binary chunk of a GLB file.
pub(super) fn parse<'f>(
    blame: Blame<'_>,
    bytes: &'f [u8],
    notes: &mut Notes,
) -> Result<(Document, Option<&'f [u8]>), SceneError> {
    let (json, blob) = if bytes.starts_with(MAGIC) { chunks(blame, bytes, notes)? } else { (bytes, None) };
    let document = document(blame, json)?;
    // A file that needs a later version says so, whatever it is written as.
    if let Some(version) = document.asset.min_version.as_deref().filter(|least| !matches!(*least, "2" | "2.0")) {
        return Err(blame.format(Place::File, format!("glTF {version} is not read; 2.0 is")));
    }
    match document.asset.version.as_deref() {
        None => Ok((document, blob)),
        Some(version) if version == "2" || version.starts_with("2.") => Ok((document, blob)),
        Some(version) => Err(blame.format(Place::File, format!("glTF {version} is not read; 2.0 is"))),
    }
}

fn document(blame: Blame<'_>, json: &[u8]) -> Result<Document, SceneError> {
    /// The part that tells the version: objects of another one have other shapes.
    #[derive(serde::Deserialize)]
    struct Version {
        asset: super::document::Asset,
    }
    // Some writers pad with zero bytes in place of blanks, and DOS ends a text with a mark.
    let end = json
        .iter()
        .rposition(|byte| !byte.is_ascii_whitespace() && !matches!(*byte, 0 | 0x1a))
        .map_or(0, |last| last + 1);
    let json = without_mark(&json[..end]);
    // Names need not be read right, but any bytes that are no text would end the reading.
    let json = String::from_utf8_lossy(json);
    serde_json::from_str(&json).map_err(|fault| match serde_json::from_str::<Version>(&json) {
        Ok(Version { asset }) if asset.version.as_deref().is_some_and(|version| !version.starts_with('2')) => {
            let version = asset.version.unwrap_or_default();
            blame.format(Place::File, format!("glTF {version} is not read; 2.0 is"))
        }
        _ => blame.format(Place::File, format!("JSON: {fault}")),
    })
}

fn word(bytes: &[u8], at: usize) -> Option<usize> {
    let word = bytes.get(at..at.checked_add(4)?)?.try_into().ok()?;
    usize::try_from(u32::from_le_bytes(word)).ok()
}

/// The JSON chunk of a GLB file, and the binary one; others are passed over, as the format wants.
fn chunks<'f>(
    blame: Blame<'_>,
    bytes: &'f [u8],
    notes: &mut Notes,
) -> Result<(&'f [u8], Option<&'f [u8]>), SceneError> {
    let fault = |message: String| blame.format(Place::File, message);
    let (Some(version), Some(end)) = (word(bytes, 4), word(bytes, 8)) else {
        return Err(fault(format!("the GLB header has {HEADER_BYTES} bytes, {} are there", bytes.len())));
    };
    if version != 2 {
        return Err(fault(format!("GLB version {version} is not read; 2 is")));
    }
    if end < HEADER_BYTES {
        return Err(fault(format!("the header gives a length of {end} bytes, less than its own {HEADER_BYTES}")));
    }
    if end > bytes.len() {
        return Err(fault(format!("the file is truncated: {} bytes of {end} are there", bytes.len())));
    }
    let (mut json, mut blob) = (None, None);
    let mut at = HEADER_BYTES;
    // Padding after the last chunk is no chunk.
    while at + CHUNK_HEADER_BYTES <= end
        && let (Some(length), Some(kind)) = (word(bytes, at), bytes.get(at + 4..at + CHUNK_HEADER_BYTES))
    {
        let start = at + CHUNK_HEADER_BYTES;
        let chunk = bytes.get(start..start + length);
        let chunk = chunk.ok_or_else(|| fault(format!("the chunk at byte {at} passes the end of the file")))?;
        match kind {
            b"JSON" if json.is_none() => json = Some(chunk),
            b"BIN\0" if blob.is_none() => blob = Some(chunk),
            _ => {}
        }
        at = start + length;
    }
    // Some writers announce less than they write.
    let end = end.max(at);
    if end < bytes.len() {
        notes.add_many(Place::File, (bytes.len() - end) as u64, "a byte after the end of the GLB file is left out");
    }
    Ok((json.ok_or_else(|| fault("the file has no JSON chunk".into()))?, blob))
}
