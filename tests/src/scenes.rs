//! The shared scenes, where they are there.

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
