//! The folder of `--out`: made, tried, and one run's alone.

use anyhow::Context;
use same_file::Handle;
use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

/// File of the lock, where the folder itself cannot be locked.
const LOCK: &str = ".prbvh.lock";

/// A folder in which this run writes and no other, as long as this lives: of two at once one would leave the tree, the other the report. The system gives the
/// lock back when the run ends, however it ends.
#[derive(Debug)]
pub(super) struct OutFolder {
    path: PathBuf,
    _lock: Option<Lock>,
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
        let lock = match Lock::folder(path).or_else(|error| match error {
            TryLockError::WouldBlock => Err(error),
            // Not a thing of all systems: Windows opens no folder, and NFS locks none.
            TryLockError::Error(_) => Lock::file_in(path),
        }) {
            Ok(lock) => Some(lock),
            Err(TryLockError::WouldBlock) => {
                anyhow::bail!("--out {}: another run of prbvh writes there", path.display())
            }
            Err(TryLockError::Error(error)) => {
                tracing::warn!("--out {}: cannot be locked against another run: {error}", path.display());
                None
            }
        };
        Ok(Self { path: path.to_owned(), _lock: lock })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

#[derive(Debug)]
struct Lock {
    _file: File,
    /// What is to be taken away with it.
    path: Option<PathBuf>,
}

impl Lock {
    /// On the folder itself: nothing is left behind.
    fn folder(path: &Path) -> Result<Self, TryLockError> {
        let folder = File::open(path).map_err(TryLockError::Error)?;
        folder.try_lock()?;
        Ok(Self { _file: folder, path: None })
    }

    /// On a file in the folder. One that a killed run left behind is locked by nobody.
    fn file_in(folder: &Path) -> Result<Self, TryLockError> {
        let path = folder.join(LOCK);
        loop {
            let open = OpenOptions::new().create(true).truncate(false).write(true).open(&path);
            let file = open.map_err(TryLockError::Error)?;
            file.try_lock()?;
            // Whoever had the lock before may have taken the file away in between: then it is nobody's.
            if is_at(&file, &path).map_err(TryLockError::Error)? {
                return Ok(Self { _file: file, path: Some(path) });
            }
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        if let Some(path) = &self.path {
            // While it is locked: later it could be another run's. That it stays does no harm.
            let _ = std::fs::remove_file(path);
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
        let error = OutFolder::open(&out.join("../out")).unwrap_err().to_string();
        assert!(error.contains("another run of prbvh"), "{error}");
        let _other = OutFolder::open(&folder.path().join("a")).unwrap();
        drop(first);
        assert_eq!(std::fs::read_dir(&out).unwrap().count(), 0);
        drop(OutFolder::open(&out).unwrap());
    }

    #[test]
    fn a_lock_file_is_one_runs_and_is_taken_away() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(LOCK);
        // What a run that was killed leaves behind.
        std::fs::write(&path, "").unwrap();
        let first = Lock::file_in(folder.path()).unwrap();
        assert!(matches!(Lock::file_in(folder.path()), Err(TryLockError::WouldBlock)));
        assert!(path.is_file(), "the second one took the lock of the first away");
        drop(first);
        assert!(!path.exists());
    }

    #[test]
    fn a_lock_on_a_file_that_was_taken_away_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(LOCK);
        let old = File::create(&path).unwrap();
        assert!(is_at(&old, &path).unwrap());
        std::fs::remove_file(&path).unwrap();
        assert!(!is_at(&old, &path).unwrap());
        let _new = Lock::file_in(folder.path()).unwrap();
        assert!(!is_at(&old, &path).unwrap());
    }
}
