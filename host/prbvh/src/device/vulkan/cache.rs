//! Compiled pipelines, kept between runs of the program.
//!
//! A file that cannot be read, is damaged or belongs to another driver is as good as none, and one that cannot be written is
//! not written: the cache saves time and must never cost a run.

use super::limits::PhysicalDevice;
use super::logical::LogicalDevice;
use super::objects::PipelineCache;
use crate::device::DeviceError;
use ash::vk;
use std::hash::Hasher;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Marks our files; the last byte is the version of the format: magic, check sum, data of the driver.
const MAGIC: [u8; 8] = *b"prbvhpc\x01";
const HEADER_BYTES: usize = MAGIC.len() + 8;

/// A pipeline cache and the file that it came from and goes to.
pub(super) struct StoredCache {
    cache: PipelineCache,
    device: Arc<LogicalDevice>,
    file: Option<PathBuf>,
    is_changed: bool,
}

impl StoredCache {
    /// The cache of the device in `folder`; an empty one that is not kept if there is no folder.
    pub(super) fn open(device: &Arc<LogicalDevice>, folder: Option<&Path>) -> Result<Self, DeviceError> {
        let file = folder.map(|folder| folder.join(file_name(device.physical())));
        let data = file.as_deref().and_then(load).unwrap_or_default();
        let cache = match create(device, &data) {
            Err(error) if !data.is_empty() => {
                tracing::debug!("the driver refuses its pipeline cache: {error}");
                create(device, &[])?
            }
            result => result?,
        };
        Ok(Self { cache, device: Arc::clone(device), file, is_changed: false })
    }

    /// The cache, to make pipelines with.
    pub(super) fn for_new_pipelines(&mut self) -> &PipelineCache {
        self.is_changed = true;
        &self.cache
    }

    fn save(&self, file: &Path) -> Result<(), Box<dyn std::error::Error>> {
        // SAFETY: the cache is of this device.
        let data = unsafe { self.device.raw().get_pipeline_cache_data(self.cache.raw()) }?;
        store(file, &data)?;
        Ok(())
    }
}

impl Drop for StoredCache {
    fn drop(&mut self) {
        if let Some(file) = &self.file
            && self.is_changed
            && !self.device.is_abandoned()
            && let Err(error) = self.save(file)
        {
            tracing::debug!("the pipeline cache {} was not written: {error}", file.display());
        }
    }
}

/// The folder for caches of this user, where the system has one; none in a program without the cargo feature `files`.
pub(super) fn user_folder() -> Option<PathBuf> {
    #[cfg(feature = "files")]
    return directories::ProjectDirs::from("", "", "prbvh").map(|dirs| dirs.cache_dir().to_owned());
    #[cfg(not(feature = "files"))]
    return None;
}

fn create(device: &Arc<LogicalDevice>, data: &[u8]) -> Result<PipelineCache, DeviceError> {
    let info = vk::PipelineCacheCreateInfo::default().initial_data(data);
    // SAFETY: the data is what this driver handed out (see `load`), or nothing.
    unsafe { PipelineCache::new(device, &info) }
}

fn file_name(device: &PhysicalDevice) -> String {
    let properties = &device.properties;
    let uuid: String = properties.pipeline_cache_uuid.iter().map(|byte| format!("{byte:02x}")).collect();
    format!(
        "pipelines-{:x}-{:x}-{:x}-{uuid}.bin",
        properties.vendor_id, properties.device_id, properties.driver_version
    )
}

/// The hash of the standard library may change with the compiler, which costs no more than a cold start.
fn check_sum(data: &[u8]) -> u64 {
    let mut hasher = std::hash::DefaultHasher::new();
    hasher.write(data);
    hasher.finish()
}

/// The data of a file that [`store`] wrote and nobody changed.
fn load(file: &Path) -> Option<Vec<u8>> {
    let bytes = std::fs::read(file).ok()?;
    let (header, data) = bytes.split_at_checked(HEADER_BYTES)?;
    let is_ours = header[..MAGIC.len()] == MAGIC && header[MAGIC.len()..] == check_sum(data).to_le_bytes();
    if !is_ours {
        tracing::debug!("the pipeline cache {} is damaged", file.display());
    }
    is_ours.then(|| data.to_vec())
}

/// Replaces the file as a whole, so that a reader never sees a part of it.
fn store(file: &Path, data: &[u8]) -> std::io::Result<()> {
    if let Some(folder) = file.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let mut bytes = MAGIC.to_vec();
    bytes.extend(check_sum(data).to_le_bytes());
    bytes.extend(data);
    let temporary = file.with_extension(format!("{}.tmp", std::process::id()));
    std::fs::write(&temporary, bytes).and_then(|()| std::fs::rename(&temporary, file)).inspect_err(|_| {
        // Nothing is lost if it stays.
        let _ = std::fs::remove_file(&temporary);
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damaged_files_are_ignored() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("inner").join("cache.bin");
        assert_eq!(load(&file), None, "no file");
        store(&file, b"pipelines").unwrap();
        assert_eq!(load(&file).as_deref(), Some(b"pipelines".as_slice()));
        assert_eq!(std::fs::read_dir(file.parent().unwrap()).unwrap().count(), 1, "no temporary file stays");

        let good = std::fs::read(&file).unwrap();
        for k in 0..good.len() {
            let mut bad = good.clone();
            bad[k] ^= 4;
            std::fs::write(&file, &bad).unwrap();
            assert_eq!(load(&file), None, "byte {k} changed");
            std::fs::write(&file, &good[..k]).unwrap();
            assert_eq!(load(&file), None, "{k} bytes left");
        }
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_an_error_of_the_save_only() {
        let folder = tempfile::tempdir().unwrap();
        let blocked = folder.path().join("file");
        std::fs::write(&blocked, b"").unwrap();
        assert!(store(&blocked.join("cache.bin"), b"pipelines").is_err());
    }
}
