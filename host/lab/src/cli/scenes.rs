//! The scenes that `prbvh optimize` and `prbvh plan` are given.

use super::load_scene;
use super::read_args::ReadArgs;
use super::values::BUILT_IN;
use anyhow::Context;
use clap::Args;
use prbvh::scene::Scene;
use std::collections::HashSet;
use std::ffi::OsString;
use std::io::Read;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct ScenesArgs {
    /// OBJ, PLY, STL, glTF or GLB files (also .xz, .gz, .zst), `-` for standard input, or `built-in` [default: built-in]. Of several each has a folder in that of --out.
    #[arg(value_name = "SCENE")]
    scenes: Vec<PathBuf>,
    /// A file with more scenes, one in a line; `-` for stdin. Empty lines and those that begin with # are passed over.
    #[arg(long, value_name = "FILE")]
    list: Option<PathBuf>,
    /// Size of the built-in scene.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    triangles: Option<usize>,
    /// With --out, of many scenes: leave out what is there already, made of the same triangles with the same settings.
    #[arg(long, requires = "out")]
    resume: bool,
    #[command(flatten)]
    read: ReadArgs,
}

/// A scene to load.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Named {
    pub(super) path: PathBuf,
    /// Of the built-in scene.
    pub(super) triangles: Option<usize>,
    /// How it is read.
    pub(super) read: ReadArgs,
}

impl Named {
    pub(super) fn load(&self) -> anyhow::Result<Scene> {
        load_scene(&self.path, self.triangles, &self.read)
    }
}

impl ScenesArgs {
    /// The scenes in the order of the arguments and then of the list.
    ///
    /// # Errors
    /// If the list cannot be read or has none, or a size is given and no scene that has one.
    pub(super) fn named(&self) -> anyhow::Result<Vec<Named>> {
        let mut paths = self.scenes.clone();
        if let Some(list) = &self.list {
            paths.extend(read_list(list)?);
            anyhow::ensure!(!paths.is_empty(), "--list {}: no scene is in it", list.display());
        } else if paths.is_empty() {
            paths.push(BUILT_IN.into());
        }
        let is_built_in = |path: &PathBuf| path == Path::new(BUILT_IN);
        if self.triangles.is_some() && !paths.iter().any(is_built_in) {
            let others: Vec<String> = paths.iter().take(3).map(|path| path.display().to_string()).collect();
            anyhow::bail!("--triangles is for the built-in scene, not for {}", others.join(", "));
        }
        let named = |path| Named { triangles: self.triangles.filter(|_| is_built_in(&path)), path, read: self.read };
        Ok(paths.into_iter().map(named).collect())
    }

    /// Whether they may be many, also where it is one this time: then each has a folder of its own in that of `--out`.
    pub(super) fn in_a_row(&self) -> bool {
        self.list.is_some() || self.resume || self.scenes.len() > 1
    }

    /// Whether what is there already is left out.
    pub(super) fn is_resumed(&self) -> bool {
        self.resume
    }

    /// The file of `--list`.
    pub(super) fn list(&self) -> Option<&Path> {
        self.list.as_deref()
    }
}

/// What is named twice is there once.
pub(super) fn each_once(mut scenes: Vec<Named>) -> Vec<Named> {
    let mut seen = HashSet::new();
    scenes.retain(|scene| seen.insert(scene.clone()));
    scenes
}

fn read_list(path: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let read = || {
        if path == Path::new("-") {
            let mut bytes = Vec::new();
            std::io::stdin().read_to_end(&mut bytes).map(|_| bytes)
        } else {
            std::fs::read(path)
        }
    };
    let bytes = read().with_context(|| format!("--list {}", path.display()))?;
    let lines = (1..).zip(bytes.split(|&byte| byte == b'\n')).map(|(number, line)| (number, line.trim_ascii()));
    let named = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with(b"#"));
    named
        .map(|(number, line)| {
            let name = file_name(line).with_context(|| format!("--list {}, line {number}", path.display()))?;
            Ok(name.into())
        })
        .collect()
}

/// On Unix any bytes are a name.
#[cfg(unix)]
fn file_name(bytes: &[u8]) -> anyhow::Result<OsString> {
    use std::os::unix::ffi::OsStringExt;
    Ok(OsString::from_vec(bytes.to_vec()))
}

#[cfg(not(unix))]
fn file_name(bytes: &[u8]) -> anyhow::Result<OsString> {
    Ok(std::str::from_utf8(bytes)?.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(scenes: &[&str], list: Option<&Path>, triangles: Option<usize>) -> Result<Vec<String>, String> {
        let scenes = scenes.iter().map(PathBuf::from).collect();
        let arguments =
            ScenesArgs { scenes, list: list.map(Path::to_owned), triangles, resume: false, read: ReadArgs::default() };
        let named = each_once(arguments.named().map_err(|error| format!("{error:#}"))?);
        Ok(named.iter().map(|Named { path, triangles, .. }| format!("{} {triangles:?}", path.display())).collect())
    }

    #[test]
    fn each_scene_is_there_once_and_the_list_follows() {
        let folder = tempfile::tempdir().unwrap();
        let list = folder.path().join("list.txt");
        std::fs::write(&list, "# chairs\na.obj\r\n\n  b c.ply \nbuilt-in").unwrap();
        let all = ["x.obj None", "a.obj None", "b c.ply None", "built-in Some(9)"].map(str::to_owned);
        assert_eq!(named(&["x.obj", "a.obj"], Some(&list), Some(9)), Ok(all.to_vec()));
        assert_eq!(named(&[], None, None), Ok(vec!["built-in None".to_owned()]));
        assert_eq!(named(&["a.obj", "a.obj"], None, None), Ok(vec!["a.obj None".to_owned()]));
    }

    #[test]
    fn lists_without_a_scene_and_sizes_of_files_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let list = folder.path().join("list.txt");
        std::fs::write(&list, "\n# none\n").unwrap();
        let error = named(&[], Some(&list), None).unwrap_err();
        assert!(error.contains("list.txt: no scene"), "{error}");
        let error = named(&[], Some(&folder.path().join("gone")), None).unwrap_err();
        assert!(error.starts_with("--list ") && error.contains("gone"), "{error}");
        let error = named(&["a.obj"], None, Some(5)).unwrap_err();
        assert!(error.contains("--triangles") && error.contains("a.obj"), "{error}");
    }
}
