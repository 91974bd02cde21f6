//! The folder of `--out`: made, tried, and one run's alone.

use anyhow::Context;
use same_file::Handle;
use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

/// File of the lock. The system gives the lock back when the run ends, however it ends; a file that is left behind locks nothing.
const LOCK: &str = ".prbvh.lock";

/// A folder in which this run writes and no other, as long as this lives: of two at once one would leave the tree, the other the report.
#[derive(Debug)]
pub(super) struct OutFolder {
    path: PathBuf,
    /// None where the file system has no locks.
    lock: Option<File>,
}

impl OutFolder {
    /// Makes the folder and tries whether files can be made in it, before any time is spent on what is to go there.
    ///
    /// # Errors
    /// If they cannot be made, or another run writes there.
    pub(super) fn open(path: &Path) -> anyhow::Result<Self> {
        std::fs::create_dir_all(path)
            .and_then(|()| tempfile::tempfile_in(path))
            .with_context(|| format!("--out {}: no files can be made there", path.display()))?;
        let lock = match lock(&path.join(LOCK)) {
            Ok(lock) => Some(lock),
            Err(TryLockError::WouldBlock) => {
                anyhow::bail!("--out {}: another run of prbvh writes there, which holds {LOCK}", path.display())
            }
            Err(TryLockError::Error(error)) => {
                tracing::warn!("--out {}: cannot be locked against another run: {error}", path.display());
                None
            }
        };
        Ok(Self { path: path.to_owned(), lock })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for OutFolder {
    fn drop(&mut self) {
        if self.lock.is_some() {
            // While it is locked: later it could be another run's. That it stays does no harm.
            let _ = std::fs::remove_file(self.path.join(LOCK));
        }
    }
}

/// Locks the file of a path, which is made where it is not there.
fn lock(path: &Path) -> Result<File, TryLockError> {
    loop {
        let file =
            OpenOptions::new().create(true).truncate(false).write(true).open(path).map_err(TryLockError::Error)?;
        file.try_lock()?;
        // Whoever had the lock before may have taken the file away in between: then it is nobody's.
        if is_at(&file, path).map_err(TryLockError::Error)? {
            return Ok(file);
        }
    }
}

fn is_at(file: &File, path: &Path) -> io::Result<bool> {
    let ours = Handle::from_file(file.try_clone()?)?;
    match Handle::from_path(path) {
        Ok(there) => Ok(ours == there),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_run_has_a_folder_and_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("a/out");
        let first = OutFolder::open(&out).unwrap();
        let error = OutFolder::open(&out).unwrap_err().to_string();
        assert!(error.contains("another run of prbvh") && error.contains(LOCK), "{error}");
        assert!(out.join(LOCK).is_file(), "the second one took the lock of the first away");
        drop(first);
        assert_eq!(std::fs::read_dir(&out).unwrap().count(), 0);
        // What a run that was killed leaves behind.
        std::fs::write(out.join(LOCK), "").unwrap();
        drop(OutFolder::open(&out).unwrap());
        assert_eq!(std::fs::read_dir(&out).unwrap().count(), 0);
    }

    #[test]
    fn a_lock_on_a_file_that_was_taken_away_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(LOCK);
        let old = File::create(&path).unwrap();
        assert!(is_at(&old, &path).unwrap());
        std::fs::remove_file(&path).unwrap();
        assert!(!is_at(&old, &path).unwrap());
        let _new = lock(&path).unwrap();
        assert!(!is_at(&old, &path).unwrap());
    }
}
