//! `cargo xtask build-shaders`: kernels of Rust to modules of SPIR-V.
//!
//! ```text
//! kernel/src ─ rust-gpu, no optimiser → exact: decorate → spirv-opt → exact: trim → spirv-val → reflect → kernel/spv
//!             (compiler, compile)                       (tools)                                     (manifest)
//! ```

pub(crate) mod compile;
mod compiler;
mod exact;
mod ir;
mod manifest;
mod reflect;
mod sources;
#[cfg(test)]
mod testing;
mod tools;

use crate::repo;
use anyhow::{Context, Result, bail};
use clap::Args;
use clap::builder::{OsStringValueParser, TypedValueParser};
use compiler::{Compiler, Fetch};
use manifest::Manifest;
use prbvh_kernel::Kernel;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tools::SpirvTools;

/// What the modules are compiled for. Storage buffers, the Vulkan memory model and 64-bit atomics are in it.
const TARGET: &str = "spirv-unknown-vulkan1.2";

/// Modules by the names of their kernels.
type Modules = BTreeMap<String, Vec<u8>>;

#[derive(Args)]
pub(crate) struct BuildShaders {
    /// Write nothing: fail where kernel/spv is not what the sources give.
    #[arg(long)]
    check: bool,
    /// Folder of a rust-gpu 0.10.0 compiler (bin/rustc, bin/cargo, lib/librustc_codegen_spirv.so).
    // clap refuses an empty path, but an empty variable is how a shell or a workflow says that there is none.
    #[arg(long, value_name = "DIR", env = "RUST_GPU_DIR", value_parser = OsStringValueParser::new().map(PathBuf::from))]
    rust_gpu_dir: Option<PathBuf>,
}

impl BuildShaders {
    /// The folder that was named; an empty name is none.
    fn folder(&self) -> Option<&Path> {
        self.rust_gpu_dir.as_deref().filter(|folder| !folder.as_os_str().is_empty())
    }

    /// # Errors
    /// Names what is missing, what does not compile, or each module and what is wrong with it.
    pub(crate) fn run(self) -> Result<()> {
        let root = repo::root()?;
        let folder = root.join("kernel/spv");
        if self.check {
            return check(&root, &folder, self.folder());
        }
        let compiler = compiler::find(&root, self.folder(), Fetch::Allowed)?.with_context(|| compiler::NOT_FOUND)?;
        let (manifest, modules) = build(&root, &compiler)?;
        manifest.write(&folder, &modules)?;
        let bytes: usize = modules.values().map(Vec::len).sum();
        println!("{} modules, {bytes} bytes, by {} and {}", modules.len(), manifest.compiler, manifest.spirv_tools);
        Ok(())
    }
}

fn build(root: &Path, compiler: &Compiler) -> Result<(Manifest, Modules)> {
    let tools = SpirvTools::find()?;
    let mut compiled = compile::kernels(root, compiler)?;
    let mut modules = Modules::new();
    for kernel in Kernel::ALL {
        let name = kernel.info().name;
        let entry = format!("entries::{name}");
        let raw = compiled.remove(&entry).with_context(|| format!("the compiler gave no module for {entry}"))?;
        let exact = exact::decorate(&raw, &entry, name).with_context(|| format!("kernel {name}"))?;
        let small = tools.optimise(name, &exact)?;
        let module = exact::trim(&small).with_context(|| format!("kernel {name}"))?;
        tools.validate(name, &module)?;
        modules.insert(name.to_owned(), module);
    }
    if let Some(entry) = compiled.keys().next() {
        bail!("the compiler gave a module for {entry}, which Kernel::ALL does not list");
    }
    let manifest = Manifest::of(root, compiler.version.clone(), tools.version, &modules)?;
    no_faults(&reflect::faults(&modules))?;
    Ok((manifest, modules))
}

fn check(root: &Path, folder: &Path, rust_gpu_dir: Option<&Path>) -> Result<()> {
    let manifest = Manifest::read(folder)?;
    let (mut faults, modules) = manifest.compare_files(folder)?;
    faults.extend(manifest.compare_source(&sources::hash(root)?));
    faults.extend(reflect::faults(&modules));
    let Some(compiler) = compiler::find(root, rust_gpu_dir, Fetch::Never)? else {
        no_faults(&faults)?;
        println!("{} modules: hashes and reflection checked; not rebuilt: no rust-gpu compiler here", modules.len());
        return Ok(());
    };
    let (rebuilt, new) = build(root, &compiler)?;
    let differ = compare(&modules, &new);
    let same_tools = manifest.same_tools(&rebuilt);
    if same_tools {
        faults.extend(differ.iter().cloned());
    }
    no_faults(&faults)?;
    if same_tools {
        println!("{} modules: hashes and reflection checked, and rebuilt to the same bytes", modules.len());
    } else {
        // Another version may give other bytes without anybody being at fault.
        println!("{} modules: hashes and reflection checked, and rebuilt with other tools than", modules.len());
        println!("  {} and {}; these are", manifest.compiler, manifest.spirv_tools);
        println!("  {} and {}, and {} modules differ", rebuilt.compiler, rebuilt.spirv_tools, differ.len());
        differ.iter().for_each(|line| println!("  {line}"));
    }
    Ok(())
}

fn compare(committed: &Modules, rebuilt: &Modules) -> Vec<String> {
    let names = committed.keys().chain(rebuilt.keys().filter(|&name| !committed.contains_key(name)));
    names
        .filter_map(|name| match (committed.get(name), rebuilt.get(name)) {
            (Some(old), Some(new)) if old == new => None,
            (Some(old), Some(new)) => {
                let at = old.iter().zip(new).take_while(|(old, new)| old == new).count();
                let (old, new) = (old.len(), new.len());
                Some(format!("{name}.spv: {old} bytes committed, {new} rebuilt, first difference at byte {at}"))
            }
            (Some(_), None) => Some(format!("{name}.spv: no kernel of this name")),
            (None, _) => Some(format!("{name}.spv: not committed")),
        })
        .collect()
}

fn no_faults(faults: &[String]) -> Result<()> {
    if !faults.is_empty() {
        bail!("kernel/spv (rebuild it with `cargo xtask build-shaders`):\n  {}", faults.join("\n  "));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::FromArgMatches;

    /// What an environment variable says goes through the same parser.
    #[test]
    fn an_empty_name_of_a_folder_is_none() {
        let command = BuildShaders::augment_args(clap::Command::new("build-shaders"));
        let argument = command.get_arguments().find(|argument| argument.get_id() == "rust_gpu_dir").unwrap();
        assert_eq!(argument.get_env().unwrap(), "RUST_GPU_DIR");
        let folder = |name: &str| {
            let matches = command.clone().try_get_matches_from(["build-shaders", "--rust-gpu-dir", name]).unwrap();
            BuildShaders::from_arg_matches(&matches).unwrap().folder().map(Path::to_owned)
        };
        assert_eq!(folder(""), None);
        assert_eq!(folder("a b"), Some(PathBuf::from("a b")));
    }

    fn modules(list: &[(&str, &[u8])]) -> Modules {
        list.iter().map(|&(name, bytes)| (name.to_owned(), bytes.to_vec())).collect()
    }

    #[test]
    fn the_comparison_names_each_module_that_differs() {
        let committed = modules(&[("same", b"1"), ("changed", b"1234"), ("gone", b"3")]);
        let rebuilt = modules(&[("same", b"1"), ("changed", b"12x4"), ("new", b"4")]);
        let differ = compare(&committed, &rebuilt);
        assert_eq!(
            differ,
            [
                "changed.spv: 4 bytes committed, 4 rebuilt, first difference at byte 2",
                "gone.spv: no kernel of this name",
                "new.spv: not committed",
            ]
        );
        assert!(no_faults(&differ).is_err());
        assert!(compare(&committed, &committed).is_empty());
    }
}
