//! `cargo xtask setup`: a Vulkan driver for the tests.

use crate::repo;
use crate::vulkan;
use anyhow::{Context, Result, bail};
use std::process::Command;

const PACKAGES: [&str; 2] = ["mesa-vulkan-drivers", "libvulkan1"];

/// Says what is there and installs what is missing.
///
/// # Errors
/// If there is no driver and it may not install one: with the command that would.
pub(crate) fn run() -> Result<()> {
    let missing = match vulkan::devices() {
        Ok(devices) if !devices.is_empty() => {
            println!("Vulkan: {}", devices.join(", "));
            return Ok(());
        }
        Ok(_) => "Vulkan drivers without a device".to_owned(),
        Err(missing) => missing,
    };
    println!("Vulkan: {missing}");
    install()?;
    match vulkan::devices() {
        Ok(devices) if !devices.is_empty() => {
            println!("Vulkan: {}", devices.join(", "));
            Ok(())
        }
        Ok(_) => bail!("{} installed, and yet no Vulkan device", PACKAGES.join(" ")),
        Err(missing) => bail!("{} installed, and yet {missing}", PACKAGES.join(" ")),
    }
}

/// Who may install packages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rights {
    Root,
    Sudo,
    None,
}

fn install() -> Result<()> {
    let has_apt = cfg!(target_os = "linux") && repo::output(Command::new("apt-get").arg("--version"))?.is_some();
    if !has_apt {
        bail!("no Vulkan driver: {}", advice(std::env::consts::OS));
    }
    let rights = rights();
    let steps = steps(rights);
    if rights == Rights::None {
        let lines: Vec<String> = steps.iter().map(|step| step.join(" ")).collect();
        bail!("no Vulkan driver, and no right to install one. Run: {}", lines.join(" && "));
    }
    for step in steps {
        println!("$ {}", step.join(" "));
        let (program, arguments) = step.split_first().context("a step has a program")?;
        repo::run(Command::new(program).args(arguments))?;
    }
    Ok(())
}

fn rights() -> Rights {
    let user = repo::output(Command::new("id").arg("-u"));
    if user.is_ok_and(|user| user.is_some_and(|id| id.trim() == "0")) {
        return Rights::Root;
    }
    let sudo = repo::output(Command::new("sudo").args(["-n", "true"]));
    if sudo.is_ok_and(|answer| answer.is_some()) { Rights::Sudo } else { Rights::None }
}

/// The commands that install the driver: run as they are, or shown to someone who may.
fn steps(rights: Rights) -> [Vec<&'static str>; 2] {
    let prefix: &[&'static str] = match rights {
        Rights::Root => &["env", "DEBIAN_FRONTEND=noninteractive"],
        Rights::Sudo => &["sudo", "-n", "env", "DEBIAN_FRONTEND=noninteractive"],
        Rights::None => &["sudo"],
    };
    let update: &[&'static str] = &["apt-get", "update"];
    let install: &[&'static str] = &["apt-get", "install", "-y", "--no-install-recommends"];
    [[prefix, update].concat(), [prefix, install, &PACKAGES].concat()]
}

fn advice(system: &str) -> &'static str {
    match system {
        "linux" => {
            "install Mesa's Vulkan drivers and the Vulkan loader with the system's package manager \
             (Fedora: `sudo dnf install mesa-vulkan-drivers vulkan-loader`, Arch: `sudo pacman -S vulkan-swrast vulkan-icd-loader`)"
        }
        "macos" => "`brew install molten-vk vulkan-loader`, or the Vulkan SDK of https://vulkan.lunarg.com/sdk",
        _ => "install the driver of the graphics card, or the Vulkan SDK of https://vulkan.lunarg.com/sdk",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shown_command_can_be_pasted() {
        let lines = steps(Rights::None).map(|step| step.join(" "));
        assert_eq!(lines[0], "sudo apt-get update");
        assert_eq!(lines[1], "sudo apt-get install -y --no-install-recommends mesa-vulkan-drivers libvulkan1");
    }

    #[test]
    fn nothing_waits_for_a_password() {
        for step in steps(Rights::Sudo) {
            assert_eq!(step[..2], ["sudo", "-n"]);
        }
        for step in steps(Rights::Root) {
            assert!(!step.contains(&"sudo"));
        }
    }
}
