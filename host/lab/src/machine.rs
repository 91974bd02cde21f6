//! The machine that a run was made on.

use serde::{Deserialize, Serialize};
use sysinfo::{CpuRefreshKind, MemoryRefreshKind, RefreshKind, System};

/// Processor, memory and system. Unknown names are empty, unknown sizes 0.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// Processor, as it names itself.
    pub cpu: String,
    /// Logical cores.
    pub cores: u32,
    /// Memory, bytes.
    pub memory_bytes: u64,
    /// Operating system, its version and its architecture.
    pub os: String,
}

impl Machine {
    /// This machine.
    #[must_use]
    pub fn current() -> Self {
        let what = RefreshKind::nothing()
            .with_cpu(CpuRefreshKind::nothing())
            .with_memory(MemoryRefreshKind::nothing().with_ram());
        // A system that tells nothing of itself is no reason to lose a run.
        let system = System::new_with_specifics(what).ok();
        let name =
            system.as_ref().and_then(|system| system.cpus().first()).map_or("", |cpu| cpu.brand()).trim().to_owned();
        let os = System::long_os_version().unwrap_or_else(|_| std::env::consts::OS.to_owned());
        Self {
            cpu: name,
            cores: std::thread::available_parallelism().map_or(0, |cores| cores.get() as u32),
            memory_bytes: system.as_ref().map_or(0, System::total_memory),
            os: format!("{os}, {}", std::env::consts::ARCH),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_machine_has_cores_memory_and_a_system() {
        let machine = Machine::current();
        assert!(machine.cores >= 1 && machine.memory_bytes > 1 << 24, "{machine:?}");
        assert!(machine.os.ends_with(std::env::consts::ARCH), "{machine:?}");
    }
}
