//! Python with numpy. `cargo xtask setup` has this file as a module, too.

use std::process::Command;

/// A Python that has numpy, and what it is: of `PRBVH_PYTHON`, `python3` on the path and the system's the first that has.
pub(crate) fn with_numpy() -> Result<(String, String), String> {
    let chosen = std::env::var("PRBVH_PYTHON").ok();
    let candidates = [chosen.as_deref(), Some("python3"), Some("/usr/bin/python3")];
    const PROGRAM: &str = "import sys, numpy; print('Python', sys.version.split()[0], 'with numpy', numpy.__version__)";
    for program in candidates.into_iter().flatten() {
        if let Ok(output) = Command::new(program).args(["-c", PROGRAM]).output()
            && output.status.success()
        {
            let text = String::from_utf8_lossy(&output.stdout).trim().to_owned();
            return Ok((program.to_owned(), text));
        }
    }
    Err("no python3 with numpy (Debian and Ubuntu: apt-get install python3-numpy; or set PRBVH_PYTHON to one)"
        .to_owned())
}
