//! kernel/spv/manifest.json: what the committed modules were made from, and what they are.

use super::sources::{self, SourceHash};
use super::{Modules, TARGET, ir};
use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

const FILE: &str = "manifest.json";

/// The manifest.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Manifest {
    /// What was compiled for.
    target: String,
    /// The compiler, with version.
    pub(super) compiler: String,
    /// spirv-opt and spirv-val, with version.
    pub(super) spirv_tools: String,
    /// Versions of the packages that matter.
    packages: BTreeMap<String, Vec<String>>,
    /// Hash of the sources and of the versions of packages.
    source_sha256: String,
    /// The modules by name.
    modules: BTreeMap<String, Entry>,
}

/// One module.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    sha256: String,
    bytes: usize,
    /// What a device must have.
    capabilities: Vec<String>,
}

impl Entry {
    fn of(module: &[u8]) -> Result<Self> {
        let capabilities = ir::capabilities(&ir::load(module)?);
        let capabilities = capabilities.into_iter().map(|name| format!("{name:?}")).collect();
        Ok(Self { sha256: sources::sha256(module), bytes: module.len(), capabilities })
    }
}

impl Manifest {
    /// # Errors
    /// If the sources cannot be read.
    pub(super) fn of(root: &Path, compiler: String, spirv_tools: String, modules: &Modules) -> Result<Self> {
        let SourceHash { sha256, packages } = sources::hash(root)?;
        let entries = modules.iter().map(|(name, module)| Ok((name.clone(), Entry::of(module)?)));
        Ok(Self {
            target: TARGET.to_owned(),
            compiler,
            spirv_tools,
            packages,
            source_sha256: sha256,
            modules: entries.collect::<Result<_>>()?,
        })
    }

    /// # Errors
    /// If there is none, or it is not readable.
    pub(super) fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(FILE);
        let text = fs::read_to_string(&path)
            .with_context(|| format!("{}: run `cargo xtask build-shaders` first", path.display()))?;
        serde_json::from_str(&text).with_context(|| path.display().to_string())
    }

    /// Writes manifest and modules, each under another name first, and removes modules of kernels that are no more.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub(super) fn write(&self, folder: &Path, modules: &Modules) -> Result<()> {
        fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
        let replace = |name: &str, bytes: &[u8]| {
            let path = folder.join(name);
            let new = folder.join(format!("{name}.new"));
            fs::write(&new, bytes).and_then(|()| fs::rename(&new, &path))
        };
        for (name, module) in modules {
            replace(&format!("{name}.spv"), module).with_context(|| format!("cannot write {name}.spv"))?;
        }
        for (name, path) in files(folder)? {
            if !modules.contains_key(&name) {
                fs::remove_file(&path).with_context(|| format!("cannot remove {}", path.display()))?;
            }
        }
        // Last: an interrupted build leaves a manifest that does not fit, never one that lies.
        let text = serde_json::to_string_pretty(self)? + "\n";
        replace(FILE, text.as_bytes()).with_context(|| format!("cannot write {FILE}"))
    }

    /// Whether both were made by the same programs.
    pub(super) fn same_tools(&self, other: &Self) -> bool {
        (&self.compiler, &self.spirv_tools) == (&other.compiler, &other.spirv_tools)
    }

    /// What is wrong with the files in `folder`, and the modules among them that this manifest lists.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub(super) fn compare_files(&self, folder: &Path) -> Result<(Vec<String>, Modules)> {
        let mut faults = Vec::new();
        let mut modules = Modules::new();
        for (name, path) in files(folder)? {
            let module = fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
            match self.modules.get(&name) {
                None => faults.push(format!("{name}.spv: not in {FILE}")),
                Some(listed) => {
                    let sha256 = sources::sha256(&module);
                    if listed.sha256 != sha256 {
                        faults.push(format!("{name}.spv: sha256 {sha256}, but {FILE} says {}", listed.sha256));
                    } else if Entry::of(&module).ok().as_ref() != Some(listed) {
                        faults.push(format!("{name}.spv: {FILE} is wrong about its size or capabilities"));
                    }
                    modules.insert(name, module);
                }
            }
        }
        let gone = self.modules.keys().filter(|&name| !modules.contains_key(name));
        faults.extend(gone.map(|name| format!("{name}.spv: missing")));
        Ok((faults, modules))
    }

    /// What has changed since the modules were made.
    pub(super) fn compare_source(&self, now: &SourceHash) -> Vec<String> {
        let mut faults = Vec::new();
        if self.target != TARGET {
            faults.push(format!("made for {}, not for {TARGET}", self.target));
        }
        let names = self.packages.keys().chain(now.packages.keys().filter(|&name| !self.packages.contains_key(name)));
        for name in names {
            let [then, now] =
                [&self.packages, &now.packages].map(|versions| versions.get(name).map(|list| list.join(", ")));
            if then != now {
                let show = |versions: Option<String>| versions.unwrap_or_else(|| "none".to_owned());
                faults.push(format!("{name} was {}, and Cargo.lock has {}", show(then), show(now)));
            }
        }
        if faults.is_empty() && self.source_sha256 != now.sha256 {
            faults.push(
                "the sources of the kernels or of their build have changed since the modules were made".to_owned(),
            );
        }
        faults
    }
}

/// Modules in a folder: name and path.
fn files(folder: &Path) -> Result<BTreeMap<String, std::path::PathBuf>> {
    let entries = fs::read_dir(folder).with_context(|| format!("cannot list {}", folder.display()))?;
    let mut files = BTreeMap::new();
    for entry in entries {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "spv")
            && let Some(name) = path.file_stem()
        {
            files.insert(name.to_string_lossy().into_owned(), path);
        }
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::super::testing::committed;
    use super::*;
    use crate::repo;

    fn written() -> (tempfile::TempDir, Manifest, Modules) {
        let folder = tempfile::tempdir().unwrap();
        let modules: Modules = ["cost_sums", "refit_climb"].map(|name| (name.to_owned(), committed(name))).into();
        fs::write(folder.path().join("of_old.spv"), b"stale").unwrap();
        let manifest = Manifest::of(&repo::root().unwrap(), "c".to_owned(), "t".to_owned(), &modules).unwrap();
        manifest.write(folder.path(), &modules).unwrap();
        (folder, manifest, modules)
    }

    #[test]
    fn what_is_written_is_read_back_and_stale_modules_go() {
        let (folder, manifest, modules) = written();
        let read = Manifest::read(folder.path()).unwrap();
        assert!(read.same_tools(&manifest));
        assert_eq!(read.compare_files(folder.path()).unwrap(), (Vec::new(), modules));
        assert_eq!(read.compare_source(&sources::hash(&repo::root().unwrap()).unwrap()), [""; 0]);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3, "two modules and the manifest");
    }

    #[test]
    fn a_changed_a_missing_and_an_unlisted_module_are_named() {
        let (folder, manifest, modules) = written();
        let path = |name: &str| folder.path().join(format!("{name}.spv"));
        let mut module = modules["cost_sums"].clone();
        *module.last_mut().unwrap() ^= 1;
        fs::write(path("cost_sums"), module).unwrap();
        fs::rename(path("refit_climb"), path("renamed")).unwrap();
        let (faults, _) = manifest.compare_files(folder.path()).unwrap();
        assert_eq!(faults.len(), 3, "{faults:?}");
        assert!(faults[0].starts_with("cost_sums.spv: sha256 "), "{faults:?}");
        assert_eq!(faults[1..], ["renamed.spv: not in manifest.json", "refit_climb.spv: missing"]);
    }

    #[test]
    fn a_changed_source_and_a_changed_package_are_named() {
        let (_folder, mut manifest, _) = written();
        let now = sources::hash(&repo::root().unwrap()).unwrap();
        manifest.source_sha256.replace_range(..1, "x");
        assert_eq!(manifest.compare_source(&now).len(), 1);
        manifest.packages.insert("glam".to_owned(), vec!["0.1.0".to_owned()]);
        let faults = manifest.compare_source(&now);
        assert!(faults[0].starts_with("glam was 0.1.0, and Cargo.lock has 0."), "{faults:?}");
    }
}
