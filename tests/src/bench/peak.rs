//! The most memory that a process had in use, where the system tells it.

/// Most bytes of this process in memory since [`forget`]; none where the system does not tell.
#[must_use]
pub fn bytes() -> Option<u64> {
    peak_of_status(&std::fs::read_to_string("/proc/self/status").ok()?)
}

/// Starts anew from what is in memory now, where the system can; else the peak is that since the start of the process.
pub fn forget() {
    // 5 resets the peak (man 5 proc). Elsewhere there is no such file.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// `VmHWM` of Linux's `status` of a process, in bytes.
fn peak_of_status(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_is_read_from_its_line_alone() {
        let status = "Name:\tx\nVmPeak:\t    9999 kB\nVmHWM:\t    1234 kB\nVmRSS:\t     77 kB\n";
        assert_eq!(peak_of_status(status), Some(1234 * 1024));
        for broken in ["", "VmPeak:\t 1 kB\n", "VmHWM:\t 12 MB\n", "VmHWM:\t many kB\n"] {
            assert_eq!(peak_of_status(broken), None, "{broken}");
        }
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_peak_is_at_least_what_was_touched() {
        let before = bytes().unwrap();
        let touched = vec![1u8; 64 << 20];
        assert!(touched.iter().step_by(4096).all(|&byte| byte == 1));
        assert!(bytes().unwrap() > before.max(60 << 20));
    }
}
