//! spirv-opt and spirv-val.

use crate::repo;
use anyhow::{Context, Result, bail, ensure};
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

/// The environment, as these programs call what [`super::TARGET`] names.
const TARGET: &str = "vulkan1.2";

/// The programs of SPIRV-Tools.
pub(super) struct SpirvTools {
    /// For the manifest, because another version may give other bytes.
    pub(super) version: String,
    folder: TempDir,
}

impl SpirvTools {
    /// # Errors
    /// Says how to install them if they are missing.
    pub(super) fn find() -> Result<Self> {
        let version = version("spirv-opt")?;
        let validator = self::version("spirv-val")?;
        ensure!(version == validator, "spirv-opt is of {version}, but spirv-val of {validator}");
        Ok(Self { version, folder: tempfile::tempdir()? })
    }

    /// The module, faster and smaller.
    ///
    /// # Errors
    /// What spirv-opt says.
    pub(super) fn optimise(&self, name: &str, module: &[u8]) -> Result<Vec<u8>> {
        let [from, to] = ["in", "out"].map(|end| self.folder.path().join(format!("{name}.{end}.spv")));
        write(&from, module)?;
        let mut command = Command::new("spirv-opt");
        command
            .arg(format!("--target-env={TARGET}"))
            .args(["--preserve-bindings", "-O", "--compact-ids"])
            .arg(&from)
            .arg("-o")
            .arg(&to);
        repo::output(&mut command).with_context(|| format!("kernel {name}"))?;
        std::fs::read(&to).with_context(|| format!("kernel {name}: spirv-opt wrote no module"))
    }

    /// # Errors
    /// What spirv-val says.
    pub(super) fn validate(&self, name: &str, module: &[u8]) -> Result<()> {
        let path = self.folder.path().join(format!("{name}.val.spv"));
        write(&path, module)?;
        // Not with `=`: spirv-val wants two words.
        repo::output(Command::new("spirv-val").args(["--target-env", TARGET]).arg(&path))
            .with_context(|| format!("kernel {name}"))?;
        Ok(())
    }
}

fn version(program: &str) -> Result<String> {
    let printed = repo::both(Command::new(program).arg("--version"))?;
    let (stdout, stderr) = printed.with_context(|| {
        format!(
            "{program} is missing. Debian and Ubuntu: `sudo apt-get install spirv-tools`; macOS: `brew install spirv-tools`; \
             elsewhere: the Vulkan SDK of https://vulkan.lunarg.com/sdk"
        )
    })?;
    // "SPIRV-Tools v2023.1 unknown hash, 2023-02-15T14:03:51", by spirv-opt to stderr.
    let printed = String::from_utf8_lossy(&[stdout, stderr].concat()).into_owned();
    let mut words = printed.split_whitespace().skip_while(|&word| word != "SPIRV-Tools");
    match (words.next(), words.next()) {
        (Some(name), Some(version)) => Ok(format!("{name} {version}")),
        _ => bail!("{program} does not say its version: {printed}"),
    }
}

fn write(path: &Path, module: &[u8]) -> Result<()> {
    std::fs::write(path, module).with_context(|| format!("cannot write {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_program_is_named_with_its_package() {
        let error = version("spirv-opt-that-nobody-has").unwrap_err().to_string();
        assert!(error.starts_with("spirv-opt-that-nobody-has is missing"), "{error}");
        assert!(error.contains("apt-get install spirv-tools"), "{error}");
    }
}
