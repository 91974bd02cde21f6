//! `cargo xtask setup`: what the tests need beside Rust: a Vulkan driver, its validation layer, a browser, and Python with numpy.

use crate::repo;
use crate::vulkan;
use anyhow::{Context, Result, bail};
use std::process::Command;

#[path = "../../tests/src/browser/places.rs"]
mod browsers;
#[path = "../../host/python/tests/interpreter/mod.rs"]
mod interpreters;

/// Something that tests need.
struct Need {
    name: &'static str,
    /// Debian's packages that bring it.
    packages: &'static [&'static str],
    /// Set to 1: do without it. The tests that need it say that they did not run.
    without: &'static str,
    /// What is there, or what is missing.
    look: fn() -> Result<String, String>,
    /// How to get it on a system without apt.
    advice: fn(&str) -> &'static str,
}

const NEEDS: [Need; 4] = [
    Need {
        name: "Vulkan driver",
        packages: &["mesa-vulkan-drivers", "libvulkan1"],
        without: "PRBVH_WITHOUT_VULKAN",
        look: || match vulkan::devices() {
            Ok(devices) if devices.is_empty() => Err("Vulkan drivers without a device".to_owned()),
            Ok(devices) => Ok(devices.join(", ")),
            Err(missing) => Err(missing),
        },
        advice: |system| match system {
            "linux" => {
                "install Mesa's Vulkan drivers and the Vulkan loader with the system's package manager \
                 (Fedora: `sudo dnf install mesa-vulkan-drivers vulkan-loader`, Arch: `sudo pacman -S vulkan-swrast vulkan-icd-loader`)"
            }
            "macos" => "`brew install molten-vk vulkan-loader`, or the Vulkan SDK of https://vulkan.lunarg.com/sdk",
            _ => "install the driver of the graphics card, or the Vulkan SDK of https://vulkan.lunarg.com/sdk",
        },
    },
    Need {
        name: "Vulkan validation layer",
        packages: &["vulkan-validationlayers"],
        without: "PRBVH_WITHOUT_VULKAN",
        look: vulkan::validation_layer,
        advice: |system| match system {
            "linux" => {
                "install the Vulkan validation layers with the system's package manager \
                 (Fedora: `sudo dnf install vulkan-validation-layers`, Arch: `sudo pacman -S vulkan-validation-layers`)"
            }
            "macos" => "`brew install vulkan-validationlayers`, or the Vulkan SDK of https://vulkan.lunarg.com/sdk",
            _ => "install the Vulkan SDK of https://vulkan.lunarg.com/sdk",
        },
    },
    Need {
        name: "browser",
        packages: &["chromium"],
        without: "PRBVH_WITHOUT_BROWSER",
        look: || match browsers::browser() {
            Some(program) => Ok(program.display().to_string()),
            None => Err("no browser of Chromium's family".to_owned()),
        },
        advice: |system| match system {
            "linux" => "install Chromium with the system's package manager, or set CHROME to a browser of its family",
            "macos" => "`brew install --cask chromium`, or set CHROME to a browser of its family",
            _ => "install Chrome or Edge, or set CHROME to a browser of their family",
        },
    },
    Need {
        name: "Python with numpy",
        packages: &["python3", "python3-numpy"],
        without: "PRBVH_WITHOUT_PYTHON",
        look: || interpreters::with_numpy().map(|(program, version)| format!("{program}, {version}")),
        advice: |_| "`python3 -m pip install numpy`, or set PRBVH_PYTHON to a Python that has it",
    },
];

/// Says what is there and installs what is missing, less what the environment does without.
///
/// # Errors
/// If something is missing and it may not install it: with the command that would.
pub(crate) fn run() -> Result<()> {
    let wanted = |need: &&Need| {
        let without = std::env::var_os(need.without).is_some_and(|value| value == "1");
        if without {
            println!("{}: not looked for ({}=1), and tests that need one do not run", need.name, need.without);
        }
        !without
    };
    let missing: Vec<&Need> = NEEDS.iter().filter(wanted).filter(|need| !is_there(need)).collect();
    if missing.is_empty() {
        return Ok(());
    }
    install(&missing)?;
    let still: Vec<&Need> = missing.into_iter().filter(|need| !is_there(need)).collect();
    if !still.is_empty() {
        bail!("{} installed, and yet {}", packages(&still).join(" "), lack(&still));
    }
    Ok(())
}

fn is_there(need: &Need) -> bool {
    let found = (need.look)();
    match &found {
        Ok(found) => println!("{}: {found}", need.name),
        Err(missing) => println!("{}: {missing}", need.name),
    }
    found.is_ok()
}

/// `no Vulkan driver (or set PRBVH_WITHOUT_VULKAN=1 to do without), no browser (…)`.
fn lack(needs: &[&Need]) -> String {
    let lack = |need: &&Need| format!("no {} (or set {}=1 to do without)", need.name, need.without);
    needs.iter().map(lack).collect::<Vec<_>>().join(", ")
}

fn packages(needs: &[&Need]) -> Vec<&'static str> {
    needs.iter().flat_map(|need| need.packages).copied().collect()
}

/// Who may install packages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rights {
    Root,
    Sudo,
    None,
}

fn install(missing: &[&Need]) -> Result<()> {
    let has_apt = cfg!(target_os = "linux") && repo::output(Command::new("apt-get").arg("--version"))?.is_some();
    if !has_apt {
        let advice: Vec<&str> = missing.iter().map(|need| (need.advice)(std::env::consts::OS)).collect();
        bail!("{}: {}", lack(missing), advice.join("; "));
    }
    let rights = rights();
    let steps = steps(rights, &packages(missing));
    if rights == Rights::None {
        let lines: Vec<String> = steps.iter().map(|step| step.join(" ")).collect();
        bail!("{}, and no right to install packages. Run: {}", lack(missing), lines.join(" && "));
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

/// The commands that install packages: run as they are, or shown to someone who may.
fn steps(rights: Rights, packages: &[&'static str]) -> [Vec<&'static str>; 2] {
    let prefix: &[&'static str] = match rights {
        Rights::Root => &["env", "DEBIAN_FRONTEND=noninteractive"],
        Rights::Sudo => &["sudo", "-n", "env", "DEBIAN_FRONTEND=noninteractive"],
        Rights::None => &["sudo"],
    };
    let update: &[&'static str] = &["apt-get", "update"];
    let install: &[&'static str] = &["apt-get", "install", "-y", "--no-install-recommends"];
    [[prefix, update].concat(), [prefix, install, packages].concat()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shown_command_can_be_pasted() {
        let all: Vec<&Need> = NEEDS.iter().collect();
        let lines = steps(Rights::None, &packages(&all)).map(|step| step.join(" "));
        assert_eq!(lines[0], "sudo apt-get update");
        assert_eq!(
            lines[1],
            "sudo apt-get install -y --no-install-recommends mesa-vulkan-drivers libvulkan1 vulkan-validationlayers chromium python3 python3-numpy"
        );
        let lines = steps(Rights::None, &packages(&all[2..])).map(|step| step.join(" "));
        assert_eq!(lines[1], "sudo apt-get install -y --no-install-recommends chromium python3 python3-numpy");
    }

    #[test]
    fn nothing_waits_for_a_password() {
        for step in steps(Rights::Sudo, &["chromium"]) {
            assert_eq!(step[..2], ["sudo", "-n"]);
        }
        for step in steps(Rights::Root, &["chromium"]) {
            assert!(!step.contains(&"sudo"));
        }
    }

    #[test]
    fn what_is_missing_is_named_with_the_way_round_it() {
        let all: Vec<&Need> = NEEDS.iter().collect();
        let text = lack(&all);
        for part in [
            "no Vulkan driver",
            "PRBVH_WITHOUT_VULKAN=1",
            "no Vulkan validation layer",
            "no browser",
            "PRBVH_WITHOUT_BROWSER=1",
        ] {
            assert!(text.contains(part), "{text}");
        }
        for system in ["linux", "macos", "windows"] {
            assert!(all.iter().all(|need| !(need.advice)(system).is_empty()));
        }
    }
}
