//! The shared scenes, where they are there.

use prbvh::scene::{self, Scene};
use std::path::{Path, PathBuf};

/// Folder of real scenes: `PRBVH_SCENES`, else `../shared/scenes` beside the checkout.
#[must_use]
pub fn folder() -> PathBuf {
    std::env::var_os("PRBVH_SCENES")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/scenes"), PathBuf::from)
}

/// Files of the shared scenes by size; says on stderr where there are none.
#[must_use]
pub fn shared() -> Vec<PathBuf> {
    let folder = folder();
    let Ok(entries) = std::fs::read_dir(&folder) else {
        eprintln!("no shared scenes: {} is not there (set PRBVH_SCENES)", folder.display());
        return Vec::new();
    };
    let mut files: Vec<(u64, PathBuf)> = entries
        .flatten()
        .filter(|entry| entry.file_name().to_string_lossy().contains(".obj"))
        .map(|entry| (entry.metadata().map_or(0, |metadata| metadata.len()), entry.path()))
        .collect();
    files.sort();
    files.into_iter().map(|(_, path)| path).collect()
}

/// The shared scenes whose file name contains `part`, one after another.
///
/// # Panics
/// At a file that is no scene.
pub fn loaded(part: &str) -> impl Iterator<Item = Scene> {
    let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let named = shared().into_iter().filter(move |path| name(path).contains(part));
    named.map(|path| scene::load(&path).unwrap_or_else(|error| panic!("{error}")))
}
