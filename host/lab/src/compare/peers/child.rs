//! The process of a peer, from outside.

use super::wire::{self, PeerTree, WireError};
use prbvh::stop::Stop;
use prbvh_kernel::setup::Triangle;
use std::io;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// How peers are run.
#[derive(Clone, Debug)]
pub struct PeerHost {
    /// A program that calls [`super::serve`] as `PROGRAM peer METHOD --scene-file FILE --out FILE --threads N`.
    pub program: PathBuf,
    /// Longest time of a process, reading and writing included.
    pub timeout: Duration,
}

/// Why a peer built no tree.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PeerError {
    /// It panicked.
    #[error("panicked: {0}")]
    Panicked(String),
    /// It did not end in time.
    #[error("timed out after {} s", .0.as_secs_f64())]
    TimedOut(Duration),
    /// It ended otherwise, such as by a signal.
    #[error("failed ({status}): {said}")]
    Failed {
        /// How it ended.
        status: ExitStatus,
        /// The last line that it said.
        said: String,
    },
    /// Its files could not be written or read.
    #[error(transparent)]
    Wire(#[from] WireError),
    /// Its process could not be run.
    #[error("cannot run {program}")]
    Process {
        /// The program.
        program: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// The caller asked for an end.
    #[error("interrupted")]
    Stopped,
    /// No program is known that could run it.
    #[error("no program to run it in")]
    NoHost,
}

/// Exit code of a program of Rust that panicked; [`super::serve`]'s caller ends with it too.
const PANICKED: i32 = 101;
/// Time between two looks at the process.
const PAUSE: Duration = Duration::from_millis(5);

/// Runs a peer in a process of its own; 0 `threads` are one per core. Leaves no file behind.
pub(in crate::compare) fn run(
    host: &PeerHost,
    method: &str,
    triangles: &[Triangle],
    threads: usize,
    stop: &Stop,
) -> Result<PeerTree, PeerError> {
    let failed = |source| PeerError::Process { program: host.program.clone(), source };
    let folder = tempfile::Builder::new().prefix("prbvh-peer-").tempdir().map_err(failed)?;
    let file = |name| folder.path().join(name);
    let [scene, out, said] = [file("scene"), file("tree"), file("said")];
    wire::write_triangles(&scene, triangles)?;
    let mut command = Command::new(&host.program);
    command.args(["peer", method, "--scene-file"]).arg(&scene).arg("--out").arg(&out);
    command.args(["--threads", &threads.to_string()]).env("RUST_BACKTRACE", "0");
    let stderr = std::fs::File::create(&said).map_err(failed)?;
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(stderr);
    let mut child = command.spawn().map_err(failed)?;
    let ended = wait(&mut child, host.timeout, stop).unwrap_or_else(|source| Err(failed(source)));
    let status = match ended {
        Ok(status) => status,
        Err(why) => {
            // It may have ended in between: then there is nothing to kill.
            let _ = child.kill();
            let _ = child.wait();
            return Err(why);
        }
    };
    if status.success() {
        return Ok(wire::read_tree(&out)?);
    }
    let said = String::from_utf8_lossy(&std::fs::read(&said).map_err(failed)?).into_owned();
    let last = said.lines().rfind(|line| !line.trim().is_empty()).unwrap_or_default().to_owned();
    match status.code() {
        Some(PANICKED) => Err(PeerError::Panicked(last)),
        _ => Err(PeerError::Failed { status, said: last }),
    }
}

/// How it ended, or why it is not to go on.
fn wait(child: &mut Child, timeout: Duration, stop: &Stop) -> io::Result<Result<ExitStatus, PeerError>> {
    let start = Instant::now();
    loop {
        match child.try_wait()? {
            Some(status) => return Ok(Ok(status)),
            None if stop.is_asked() => return Ok(Err(PeerError::Stopped)),
            None if start.elapsed() >= timeout => return Ok(Err(PeerError::TimedOut(timeout))),
            None => std::thread::sleep(PAUSE),
        }
    }
}
