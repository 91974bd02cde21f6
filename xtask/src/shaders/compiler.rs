//! Finds the rust-gpu compiler: a prebuilt folder, or what `cargo-gpu-install` installs through rustup.

use crate::repo;
use anyhow::{Context, Result, bail};
use cargo_gpu_install::install::Install;
use cargo_gpu_install::spirv_source::{CrateMetadata, SpirvSource};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The version of rust-gpu: that of `spirv-std` and `spirv-builder`.
const VERSION: &str = "0.10.0";

/// The name under which rustup knows a prebuilt folder.
const TOOLCHAIN: &str = "rust-gpu-0.10";

/// Both ways to a compiler.
pub(super) const NOT_FOUND: &str = "no rust-gpu 0.10.0 compiler. Two ways to one:\n  \
    1. a prebuilt folder with bin/rustc, bin/cargo and lib/librustc_codegen_spirv.so: name it by `--rust-gpu-dir DIR`\n     \
       or RUST_GPU_DIR, or put it at rust-gpu-0.10.0 in the user's cache folder (~/.cache on Linux);\n  \
    2. `cargo xtask build-shaders` without a folder: cargo-gpu-install lets rustup fetch the nightly that rust-gpu 0.10.0\n     \
       pins, and builds the rest. It needs rustup, a C++ compiler and the internet";

/// A compiler that works.
#[derive(Debug)]
pub(crate) struct Compiler {
    /// The codegen library.
    pub(super) codegen: PathBuf,
    /// The rustup toolchain that loads it.
    pub(super) toolchain: String,
    /// For the manifest.
    pub(super) version: String,
}

/// Whether a missing compiler may be downloaded.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Fetch {
    Allowed,
    Never,
}

/// The compiler, or `None` if there is none and it may not be fetched.
///
/// # Errors
/// If a folder was named and does not hold one, or if the installation fails: with both ways to a compiler.
pub(super) fn find(root: &Path, named: Option<&Path>, fetch: Fetch) -> Result<Option<Compiler>> {
    let cache = cargo_gpu_install::cache_dir()?.with_file_name(format!("rust-gpu-{VERSION}"));
    let folder = named.or_else(|| cache.is_dir().then_some(cache.as_path()));
    if let Some(folder) = folder {
        return prebuilt(folder).map(Some);
    }
    let kernel = root.join("kernel");
    if fetch == Fetch::Never && !is_installed(&kernel)? {
        return Ok(None);
    }
    let installed = install(kernel).context(NOT_FOUND)?;
    Ok(Some(installed))
}

fn prebuilt(folder: &Path) -> Result<Compiler> {
    let folder = std::path::absolute(folder)?;
    let library = codegen_file();
    let [rustc, cargo] = ["rustc", "cargo"].map(|name| format!("{name}{}", std::env::consts::EXE_SUFFIX));
    let codegen = folder.join("lib").join(library);
    for file in [&folder.join("bin").join(rustc), &folder.join("bin").join(cargo), &codegen] {
        if !file.is_file() {
            bail!("{} is missing: {NOT_FOUND}", file.display());
        }
    }
    let sysroot = |command: &mut Command| -> Result<Option<PathBuf>> {
        let printed = repo::output(command.args(["--print", "sysroot"]))?;
        Ok(printed.and_then(|path| Path::new(path.trim()).canonicalize().ok()))
    };
    let ours = sysroot(&mut Command::new(folder.join("bin/rustc")))
        .with_context(|| format!("the compiler in {} does not start", folder.display()))?;
    // An error here is rustup not knowing the name.
    let linked = sysroot(Command::new("rustup").args(["run", TOOLCHAIN, "rustc"])).unwrap_or(None);
    if linked.is_none() || linked != ours {
        repo::run(Command::new("rustup").args(["toolchain", "link", TOOLCHAIN]).arg(&folder))
            .context("rustup must know the compiler")?;
    }
    compiler(codegen, TOOLCHAIN.to_owned())
}

/// Whether `cargo-gpu-install` has built the codegen library before.
fn is_installed(kernel: &Path) -> Result<bool> {
    let metadata = CrateMetadata::query(kernel.to_owned())?;
    let source = SpirvSource::new(&metadata, None, None)?;
    Ok(source.install_dir()?.join(codegen_file()).is_file())
}

fn install(kernel: PathBuf) -> Result<Compiler> {
    println!("installing rust-gpu {VERSION} through cargo-gpu-install (rustup fetches the nightly that it pins)");
    let backend = Install::from_shader_crate(kernel).run()?;
    compiler(backend.rustc_codegen_spirv_location, backend.toolchain_channel)
}

fn compiler(codegen: PathBuf, toolchain: String) -> Result<Compiler> {
    let printed = repo::output(Command::new("rustup").args(["run", &toolchain, "rustc", "--version"]))?;
    let rustc = printed.context("rustup is missing: see https://rustup.rs")?;
    let version = format!("{}, rustc_codegen_spirv {VERSION}", rustc.trim());
    Ok(Compiler { codegen, toolchain, version })
}

fn codegen_file() -> String {
    use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
    format!("{DLL_PREFIX}rustc_codegen_spirv{DLL_SUFFIX}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_without_a_compiler_is_refused_with_both_ways_to_one() {
        let empty = tempfile::tempdir().unwrap();
        let root = repo::root().unwrap();
        let error = find(&root, Some(empty.path()), Fetch::Never).unwrap_err().to_string();
        for words in ["rustc", "is missing", "--rust-gpu-dir", "RUST_GPU_DIR", "cargo-gpu-install"] {
            assert!(error.contains(words), "{words} in {error}");
        }
    }
}
