//! Files that are whole or not there; and what is no file.

use std::fs::OpenOptions;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Why a file was not written.
#[derive(Debug, thiserror::Error)]
#[error("{path} could not be written ({doing})")]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// The step that failed.
    pub doing: &'static str,
    /// Why.
    #[source]
    pub source: io::Error,
}

/// Symbolic links on the way to a file before it is taken for a circle; as many as Linux follows.
const MOST_LINKS: u32 = 40;
/// Bytes for the system at a time.
const BUFFER_BYTES: usize = 1 << 16;

/// Lets `fill` write a file of a temporary name beside the one that `path` names, syncs it and gives it that name. The folder is made if it is not
/// there. On failure nothing is left behind, and a file that had the name before stays as it was.
///
/// A symbolic link stays: the file that it leads to is written. What is there and no file, such as a pipe or a device, stays too, and takes the bytes as they
/// come ([`is_written_through`]).
///
/// # Errors
/// If the folder or the file cannot be made, or if `fill` fails.
pub fn write_atomically(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), WriteError> {
    let failed = |doing| move |source| WriteError { path: path.to_owned(), doing, source };
    if is_written_through(path) {
        // A pipe opens once somebody reads it.
        let file = OpenOptions::new().write(true).open(path).map_err(failed("opening it"))?;
        let mut buffered = BufWriter::with_capacity(BUFFER_BYTES, file);
        return fill(&mut buffered).and_then(|()| buffered.flush()).map_err(failed("filling it"));
    }
    let path = &behind_links(path).map_err(failed("following its links"))?;
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    std::fs::create_dir_all(folder).map_err(failed("making its folder"))?;
    let mut builder = tempfile::Builder::new();
    builder.prefix(".prbvh-").suffix(".part");
    // A temporary file is private by default; this one is to become an ordinary file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder).map_err(failed("making a temporary file beside it"))?;
    let mut buffered = BufWriter::with_capacity(BUFFER_BYTES, file.as_file_mut());
    fill(&mut buffered).and_then(|()| buffered.flush()).map_err(failed("filling it"))?;
    drop(buffered);
    file.as_file().sync_all().map_err(failed("syncing it"))?;
    file.persist(path).map_err(|error| failed("giving it its name")(error.error))?;
    Ok(())
}

/// Whether there is something of this name that is neither a file nor a folder: a pipe, a device.
#[must_use]
pub fn is_written_through(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|there| !there.is_file() && !there.is_dir())
}

/// The path of the file itself, whether it is there or not.
fn behind_links(path: &Path) -> io::Result<PathBuf> {
    let mut at = path.to_owned();
    for _ in 0..MOST_LINKS {
        match std::fs::read_link(&at) {
            // A relative link counts from its own folder.
            Ok(target) => at = at.parent().unwrap_or(Path::new("")).join(target),
            Err(_) => return Ok(at),
        }
    }
    Err(io::Error::other(format!("more than {MOST_LINKS} symbolic links")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::error::Error;

    fn names(folder: &Path) -> Vec<String> {
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn a_file_replaces_another_and_its_folder_is_made() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b/c.txt");
        for text in ["one", "two"] {
            write_atomically(&path, |out| out.write_all(text.as_bytes())).unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
        assert_eq!(names(path.parent().unwrap()), ["c.txt"]);
    }

    #[test]
    fn a_failure_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.txt");
        std::fs::write(&path, "old").unwrap();
        let error = write_atomically(&path, |out| {
            out.write_all(&[b'x'; 1 << 20])?;
            Err(io::Error::other("disk full"))
        })
        .unwrap_err();
        assert!(error.to_string().contains("c.txt"), "{error}");
        assert_eq!(error.source().unwrap().to_string(), "disk full");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(names(folder.path()), ["c.txt"]);
    }

    #[test]
    fn a_panic_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.txt");
        let result = std::panic::catch_unwind(|| write_atomically(&path, |_| panic!("in the middle")));
        assert!(result.is_err());
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn a_folder_that_is_a_file_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        let error = write_atomically(&file.join("c.txt"), |_| Ok(())).unwrap_err();
        assert_eq!(error.doing, "making its folder");
        // The name taken by a folder.
        let error = write_atomically(folder.path(), |_| Ok(())).unwrap_err();
        assert_eq!(error.doing, "giving it its name");
        assert_eq!(names(folder.path()), ["file"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_stay_and_lead_to_the_file() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::create_dir(path("there")).unwrap();
        std::fs::write(path("there/file"), "old").unwrap();
        symlink("there/file", path("link")).unwrap();
        symlink("link", path("chain")).unwrap();
        symlink("there/new", path("dangling")).unwrap();
        for (link, file, text) in
            [("chain", "there/file", "by a chain"), ("dangling", "there/new", "by a dangling one")]
        {
            write_atomically(&path(link), |out| out.write_all(text.as_bytes())).unwrap();
            assert!(std::fs::symlink_metadata(path(link)).unwrap().is_symlink(), "{link}");
            assert!(std::fs::symlink_metadata(path(file)).unwrap().is_file(), "{file}");
            assert_eq!(std::fs::read_to_string(path(file)).unwrap(), text);
        }
        assert_eq!(names(&path("there")).len(), 2);

        symlink("circle", path("circle")).unwrap();
        let error = write_atomically(&path("circle"), |_| Ok(())).unwrap_err();
        assert_eq!(error.doing, "following its links");
        assert!(std::fs::symlink_metadata(path("circle")).unwrap().is_symlink());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn devices_take_what_comes_and_say_what_they_refuse() {
        let null = Path::new("/dev/null");
        assert!(is_written_through(null));
        write_atomically(null, |out| out.write_all(b"gone")).unwrap();
        assert!(is_written_through(null), "it was replaced by a file");
        let error = write_atomically(Path::new("/dev/full"), |out| out.write_all(b"too much")).unwrap_err();
        assert_eq!((error.doing, error.source.kind()), ("filling it", io::ErrorKind::StorageFull));
    }

    #[cfg(unix)]
    #[test]
    fn others_may_read_the_file_as_any_other() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (ours, plain) = (folder.path().join("ours"), folder.path().join("plain"));
        write_atomically(&ours, |_| Ok(())).unwrap();
        std::fs::write(&plain, "").unwrap();
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }
}
