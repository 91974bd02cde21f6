//! No output may be an input: the scene would be gone.

use super::values::BUILT_IN;
use anyhow::Context;
use percent_encoding::percent_decode_str;
use std::collections::HashMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Refuses outputs that are among the inputs, also by another path or a link, before anything is done.
///
/// # Errors
/// Names the first.
pub(super) fn refuse_overwrite<'a>(
    inputs: impl IntoIterator<Item = &'a Path>,
    outputs: impl IntoIterator<Item = PathBuf>,
) -> anyhow::Result<()> {
    // A file has one length, and few others have the same.
    let mut by_length: HashMap<u64, Vec<PathBuf>> = HashMap::new();
    for output in outputs {
        if let Some(length) = length(&output) {
            by_length.entry(length).or_default().push(output);
        }
    }
    if by_length.is_empty() {
        return Ok(());
    }
    for input in inputs.into_iter().flat_map(files_of) {
        for output in length(&input).and_then(|length| by_length.get(&length)).into_iter().flatten() {
            let is_same = same_file::is_same_file(&input, output);
            if is_same.with_context(|| format!("{} and {}", input.display(), output.display()))? {
                anyhow::bail!("{}: is read as {} and would be overwritten", output.display(), input.display());
            }
        }
    }
    Ok(())
}

/// Of what is there and a file. To look into a pipe would wait for it.
fn length(path: &Path) -> Option<u64> {
    std::fs::metadata(path).ok().filter(|there| there.is_file()).map(|there| there.len())
}

/// The files in a folder that `is_output` takes for outputs by their names.
pub(super) fn outputs_in(folder: &Path, is_output: impl Fn(&OsStr) -> bool) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.filter(|entry| is_output(&entry.file_name())).map(|entry| entry.path()).collect()
}

/// The files that an argument names: of a glTF scene those of its buffers, too.
fn files_of(input: &Path) -> Vec<PathBuf> {
    if input == Path::new(BUILT_IN) {
        return Vec::new();
    }
    if input == Path::new("-") {
        return vec!["/dev/stdin".into()];
    }
    let mut files = vec![input.to_owned()];
    if input.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gltf")) && input.is_file() {
        files.extend(buffers_of(input));
    }
    files
}

/// The files of the buffers of a glTF file; none if it is no JSON, which its reader will say.
fn buffers_of(gltf: &Path) -> Vec<PathBuf> {
    let json = std::fs::read(gltf).ok().and_then(|bytes| serde_json::from_slice::<serde_json::Value>(&bytes).ok());
    let buffers = json.as_ref().and_then(|json| json["buffers"].as_array()).into_iter().flatten();
    let names = buffers.filter_map(|buffer| buffer["uri"].as_str()).filter(|uri| !uri.starts_with("data:"));
    let names = names.filter_map(|uri| percent_decode_str(uri).decode_utf8().ok());
    names.map(|name| gltf.with_file_name(&*name)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_output_that_is_read_is_refused_by_any_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::create_dir(path("sub")).unwrap();
        for name in ["scene.obj", "other.obj", "my buffer.bin"] {
            std::fs::write(path(name), name).unwrap();
        }
        std::fs::hard_link(path("scene.obj"), path("hard.obj")).unwrap();
        let gltf = r#"{"buffers": [{"uri": "data:,x"}, {"byteLength": 1}, {"uri": "my%20buffer.bin"}]}"#;
        std::fs::write(path("scene.gltf"), gltf).unwrap();
        let refused = |input: &str, output: &str| {
            let refused = refuse_overwrite([&*path(input)], [path("gone.png"), path(output)]);
            refused.map_err(|error| error.to_string())
        };
        for (input, output) in [
            ("scene.obj", "scene.obj"),
            ("scene.obj", "sub/../scene.obj"),
            ("scene.obj", "hard.obj"),
            ("scene.gltf", "scene.gltf"),
            ("scene.gltf", "my buffer.bin"),
        ] {
            let error = refused(input, output).unwrap_err();
            assert!(error.contains("would be overwritten"), "{input}, {output}: {error}");
        }
        for (input, output) in [("scene.obj", "other.obj"), ("gone.obj", "gone.png"), ("scene.obj", "sub")] {
            assert_eq!(refused(input, output), Ok(()), "{input}, {output}");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink("scene.obj", path("soft.obj")).unwrap();
            assert!(refused("scene.obj", "soft.obj").is_err() && refused("soft.obj", "scene.obj").is_err());
        }
        let named = outputs_in(folder.path(), |name| Path::new(name).extension() == Some(OsStr::new("bin")));
        assert_eq!(named, [path("my buffer.bin")]);
        assert!(outputs_in(&path("gone"), |_| true).is_empty());
    }
}
