//! Runs rust-gpu over the kernel crate.
//!
//! In a process of its own, because `spirv-builder` hands its environment on to the compiler.

use super::compiler::Compiler;
use super::{Modules, TARGET};
use anyhow::{Context, Result, bail};
use clap::Args;
use spirv_builder::{Capability, ModuleResult, SpirvBuilder, SpirvMetadata};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The process of its own. Prints a JSON object: paths of modules by their entry points.
#[derive(Args)]
pub(crate) struct CompileKernels {
    #[arg(long)]
    kernel: PathBuf,
    #[arg(long)]
    codegen: PathBuf,
    #[arg(long)]
    toolchain: String,
}

impl CompileKernels {
    /// # Errors
    /// If the kernels do not compile; the compiler has said why.
    pub(crate) fn run(self) -> Result<()> {
        let mut builder = SpirvBuilder::new(self.kernel, TARGET);
        builder.rustc_codegen_spirv_location = Some(self.codegen);
        builder.toolchain_overwrite = Some(self.toolchain);
        builder.capabilities = vec![Capability::Int64, Capability::Int64Atomics];
        builder.multimodule = true;
        builder.build_script.defaults = false;
        builder.spirv_metadata = SpirvMetadata::None;
        // It folds float arithmetic; it may run after `exact` has forbidden that.
        builder.extra_args = vec!["--no-spirv-opt".to_owned()];
        let built = builder.build().context("rust-gpu")?;
        let ModuleResult::MultiModule(modules) = built.module else {
            bail!("rust-gpu gave one module for all kernels");
        };
        println!("{}", serde_json::to_string(&modules)?);
        Ok(())
    }
}

/// Modules by their entry points, as rust-gpu leaves them.
///
/// # Errors
/// If the kernels do not compile.
pub(super) fn kernels(root: &Path, compiler: &Compiler) -> Result<Modules> {
    let mut child = Command::new(std::env::current_exe()?);
    child.arg("compile-kernels").arg("--kernel").arg(root.join("kernel"));
    child.arg("--codegen").arg(&compiler.codegen).arg("--toolchain").arg(&compiler.toolchain);
    // rust-gpu inlines everything and recurses deeply while it does.
    child.env("RUST_MIN_STACK", "16777216");
    // The modules depend on nothing that happens to be set here, nor on the profile of the host's binaries.
    child.env_remove("RUSTGPU_CODEGEN_ARGS").env_remove("RUSTGPU_RUSTFLAGS").env("RUSTGPU_CARGOFLAGS", "--locked");
    child.env("CARGO_PROFILE_RELEASE_OPT_LEVEL", "3").env("CARGO_PROFILE_RELEASE_LTO", "false");
    let child = child.stdin(Stdio::null()).stderr(Stdio::inherit()).output().context("cannot start the task again")?;
    if !child.status.success() {
        bail!("the kernels do not compile (see above)");
    }
    let paths: BTreeMap<String, PathBuf> = serde_json::from_slice(&child.stdout).context("paths of the modules")?;
    let read = |(entry, path): (String, PathBuf)| {
        let module = std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
        Ok((entry, module))
    };
    paths.into_iter().map(read).collect()
}
