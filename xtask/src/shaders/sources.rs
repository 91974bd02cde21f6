//! Hash of everything that the modules are made from, save the programs that make them.

use anyhow::{Context, Result};
use serde::Deserialize;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Packages that are compiled into the modules or that make them.
const PACKAGES: [&str; 11] = [
    "bitflags",
    "bytemuck",
    "bytemuck_derive",
    "glam",
    "libm",
    "num-traits",
    "rspirv",
    "spirv-builder",
    "spirv-std",
    "spirv-std-macros",
    "spirv-std-types",
];

/// Files of this task that decide what the modules are.
const TASK: [&str; 5] = ["mod.rs", "compile.rs", "exact.rs", "ir.rs", "tools.rs"];

/// Hash of the sources, and the versions of packages that it covers.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct SourceHash {
    pub(super) sha256: String,
    pub(super) packages: BTreeMap<String, Vec<String>>,
}

/// Hashes the sources of the project at `root`.
///
/// # Errors
/// If a file cannot be read.
pub(super) fn hash(root: &Path) -> Result<SourceHash> {
    let mut files = vec![PathBuf::from("kernel/Cargo.toml")];
    list(root, Path::new("kernel/src"), &mut files)?;
    files.extend(TASK.map(|name| Path::new("xtask/src/shaders").join(name)));
    // Bytes, not the order of the operating system.
    let mut files: Vec<(String, PathBuf)> = files.into_iter().map(|file| (slashes(&file), root.join(file))).collect();
    files.sort();
    let mut hasher = Sha256::new();
    for (name, path) in files {
        let bytes = std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
        absorb(&mut hasher, name.as_bytes());
        absorb(&mut hasher, &bytes);
    }
    let lock = root.join("Cargo.lock");
    let lock = std::fs::read_to_string(&lock).with_context(|| format!("cannot read {}", lock.display()))?;
    let packages = packages(&lock)?;
    for (name, versions) in &packages {
        absorb(&mut hasher, name.as_bytes());
        versions.iter().for_each(|version| absorb(&mut hasher, version.as_bytes()));
    }
    Ok(SourceHash { sha256: hex(hasher), packages })
}

/// Hash of one piece of data.
pub(super) fn sha256(bytes: &[u8]) -> String {
    hex(Sha256::new_with_prefix(bytes))
}

fn hex(hasher: Sha256) -> String {
    format!("{:x}", hasher.finalize())
}

/// With its length, so that no two lists of data give the same bytes.
fn absorb(hasher: &mut Sha256, bytes: &[u8]) {
    hasher.update((bytes.len() as u64).to_le_bytes());
    hasher.update(bytes);
}

fn list(root: &Path, folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    let entries = std::fs::read_dir(root.join(folder)).with_context(|| format!("cannot list {}", folder.display()))?;
    for entry in entries {
        let entry = entry?;
        let path = folder.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            list(root, &path, files)?;
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    Ok(())
}

fn slashes(path: &Path) -> String {
    path.iter().map(|part| part.to_string_lossy()).collect::<Vec<_>>().join("/")
}

fn packages(lock: &str) -> Result<BTreeMap<String, Vec<String>>> {
    #[derive(Deserialize)]
    struct Lock {
        package: Vec<Package>,
    }
    #[derive(Deserialize)]
    struct Package {
        name: String,
        version: String,
    }
    let lock: Lock = toml::from_str(lock).context("Cargo.lock")?;
    let mut packages = BTreeMap::<String, Vec<String>>::new();
    for package in lock.package.into_iter().filter(|package| PACKAGES.contains(&package.name.as_str())) {
        packages.entry(package.name).or_default().push(package.version);
    }
    packages.values_mut().for_each(|versions| versions.sort());
    Ok(packages)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// A project with the files that are hashed.
    fn project() -> tempfile::TempDir {
        let root = tempfile::tempdir().unwrap();
        let write = |path: &str, text: &str| {
            let path = root.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        write(
            "Cargo.lock",
            "[[package]]\nname = \"glam\"\nversion = \"0.33.0\"\n\n[[package]]\nname = \"x\"\nversion = \"1.0.0\"\n",
        );
        write("kernel/Cargo.toml", "[package]");
        write("kernel/src/lib.rs", "//! Kernels.");
        write("kernel/src/prbvh/search.rs", "// search");
        TASK.iter().for_each(|name| write(&format!("xtask/src/shaders/{name}"), "// task"));
        root
    }

    #[test]
    fn one_character_changes_the_hash() {
        let root = project();
        let before = hash(root.path()).unwrap();
        assert_eq!(before, hash(root.path()).unwrap());
        for path in ["kernel/Cargo.toml", "kernel/src/prbvh/search.rs", "xtask/src/shaders/exact.rs", "Cargo.lock"] {
            let path = root.path().join(path);
            let text = fs::read_to_string(&path).unwrap();
            fs::write(&path, text.replace("0.33.0", "0.33.1") + "#").unwrap();
            assert_ne!(before.sha256, hash(root.path()).unwrap().sha256, "{}", path.display());
            fs::write(&path, text).unwrap();
        }
        assert_eq!(before, hash(root.path()).unwrap());
    }

    #[test]
    fn a_new_file_and_a_renamed_one_change_the_hash() {
        let root = project();
        let before = hash(root.path()).unwrap();
        let path = |name| root.path().join("kernel/src/prbvh").join(name);
        fs::rename(path("search.rs"), path("find.rs")).unwrap();
        assert_ne!(before, hash(root.path()).unwrap());
        fs::rename(path("find.rs"), path("search.rs")).unwrap();
        fs::write(path("lock.rs"), "").unwrap();
        assert_ne!(before, hash(root.path()).unwrap());
    }

    #[test]
    fn other_packages_do_not_matter() {
        let root = project();
        let before = hash(root.path()).unwrap();
        let lock = root.path().join("Cargo.lock");
        fs::write(&lock, fs::read_to_string(&lock).unwrap().replace("1.0.0", "2.0.0")).unwrap();
        assert_eq!(before, hash(root.path()).unwrap());
    }
}
