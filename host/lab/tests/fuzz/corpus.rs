//! `tests/corpus`: for each target files that once broke it, and in `valid` small files to damage.

use super::targets::{Bytes, Target};
use std::path::{Path, PathBuf};

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).filter(|path| path.is_file()).collect();
    files.sort();
    files
}

fn folder(target: &Target) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/corpus").join(target.name)
}

fn read(target: &Target, path: &Path) -> Bytes {
    let name = path.file_name().unwrap().to_string_lossy();
    let known = |extension: &&&str| name.ends_with(&format!(".{extension}"));
    let extension = target.extensions.iter().find(known);
    (extension.unwrap_or_else(|| panic!("{name}: not for {}", target.name)), std::fs::read(path).unwrap())
}

/// The small valid files.
pub(crate) fn valid(target: &Target) -> Vec<Bytes> {
    files(&folder(target).join("valid")).iter().map(|path| read(target, path)).collect()
}

/// What is wrong with the files of the corpus, and how many there are. Valid ones must be read.
pub(crate) fn replay(target: &Target) -> (Vec<String>, usize) {
    let mut faults = Vec::new();
    let [broken, valid] = [folder(target), folder(target).join("valid")].map(|folder| files(&folder));
    for path in broken.iter().chain(&valid) {
        if let Err(fault) = target.check(&read(target, path)) {
            faults.push(format!("{}: {fault}", path.display()));
        }
    }
    for path in &valid {
        if let Err(error) = (target.read)(path) {
            faults.push(format!("a valid file is refused: {error}"));
        }
    }
    (faults, broken.len() + valid.len())
}
