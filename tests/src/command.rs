//! The `prbvh` command as a user runs it.

use crate::devices::validation_is_installed;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::NamedTempFile;

/// A command that takes longer hangs.
const PATIENCE: Duration = Duration::from_secs(120);

/// A command that has ended.
#[derive(Debug)]
pub struct Ended {
    /// The arguments, for messages.
    pub arguments: String,
    /// Exit code; `None` if a signal ended it.
    pub code: Option<i32>,
    /// What it printed.
    pub stdout: String,
    /// Its log and errors.
    pub stderr: String,
}

/// A named pipe in the place of a file: who reads it waits for its writer, so that a test knows where a program is.
#[cfg(target_os = "linux")]
#[derive(Debug)]
pub struct Fifo(std::path::PathBuf);

#[cfg(target_os = "linux")]
impl Fifo {
    /// Makes it.
    ///
    /// # Panics
    /// If there is no `mkfifo` to make it with.
    #[must_use]
    pub fn new(path: &Path) -> Self {
        let made = Command::new("mkfifo").arg(path).status().unwrap();
        assert!(made.success(), "{}: no fifo", path.display());
        Self(path.to_owned())
    }

    /// Waits until somebody has it open to read.
    ///
    /// # Panics
    /// If nobody does.
    #[must_use]
    pub fn read_by(&self, running: &mut Running) -> std::fs::File {
        use std::os::unix::fs::OpenOptionsExt;
        // Of Linux: an error where nobody reads, instead of a wait.
        const O_NONBLOCK: i32 = 0o4000;
        let start = Instant::now();
        loop {
            match std::fs::OpenOptions::new().write(true).custom_flags(O_NONBLOCK).open(&self.0) {
                Ok(file) => return file,
                Err(error) => {
                    let goes_on = running.is_running() && start.elapsed() < PATIENCE;
                    assert!(goes_on, "prbvh {}: {error}; it said:\n{}", running.arguments, running.stderr());
                    std::thread::sleep(Duration::from_millis(2));
                }
            }
        }
    }
}

/// A command that runs.
#[derive(Debug)]
pub struct Running {
    arguments: String,
    child: Child,
    stdout: NamedTempFile,
    stderr: NamedTempFile,
}

/// Runs a program in a folder to its end.
///
/// # Panics
/// If it cannot be started, panics, or hangs.
#[must_use]
pub fn run(program: &str, folder: &Path, arguments: &[&str]) -> Ended {
    start(Command::new(program).current_dir(folder).args(arguments)).wait()
}

/// Starts a program, on `--device vulkan` under the validation layer where that is installed. Its output goes to files, so that it never
/// waits for a reader.
///
/// # Panics
/// If it cannot be started.
#[must_use]
pub fn start(command: &mut Command) -> Running {
    let on_vulkan =
        command.get_args().zip(command.get_args().skip(1)).any(|pair| pair.0 == "--device" && pair.1 == "vulkan");
    if on_vulkan && validation_is_installed() {
        command.arg("--validate");
    }
    let arguments: Vec<_> = command.get_args().map(|argument| argument.to_string_lossy().into_owned()).collect();
    let (stdout, stderr) = (NamedTempFile::new().unwrap(), NamedTempFile::new().unwrap());
    command.stdin(Stdio::null()).stdout(stdout.reopen().unwrap()).stderr(stderr.reopen().unwrap());
    let child = command.spawn().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    Running { arguments: arguments.join(" "), child, stdout, stderr }
}

impl Running {
    /// Sends a signal, such as `INT`.
    ///
    /// # Panics
    /// If there is no `kill` to send it with.
    #[cfg(unix)]
    pub fn signal(&self, name: &str) {
        let sent = Command::new("kill").args([format!("-{name}"), self.child.id().to_string()]).status().unwrap();
        assert!(sent.success(), "prbvh {}: {name} was not sent", self.arguments);
    }

    /// Waits until its log has these texts, one after another.
    ///
    /// # Panics
    /// If it ends or hangs before.
    pub fn until(&mut self, texts: &[&str]) {
        let has_all = |log: &str| {
            texts.iter().try_fold(log, |rest, text| rest.find(text).map(|at| &rest[at + text.len()..])).is_some()
        };
        let start = Instant::now();
        loop {
            // In this order: what it said last is there when it has ended.
            let goes_on = self.is_running() && start.elapsed() < PATIENCE;
            let log = self.stderr();
            if has_all(&log) {
                return;
            }
            assert!(goes_on, "prbvh {}: no {texts:?} in:\n{log}", self.arguments);
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Whether it has not ended yet.
    ///
    /// # Panics
    /// If the system does not know.
    pub fn is_running(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }

    /// The log and the errors so far.
    ///
    /// # Panics
    /// If they cannot be read.
    #[must_use]
    pub fn stderr(&self) -> String {
        whole(&self.stderr)
    }

    /// Waits for the end.
    ///
    /// # Panics
    /// If the program panics or hangs.
    #[must_use]
    pub fn wait(mut self) -> Ended {
        let start = Instant::now();
        let status = loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                break status;
            }
            if start.elapsed() > PATIENCE {
                self.child.kill().unwrap();
                panic!("prbvh {}: hangs; it said:\n{}", self.arguments, self.stderr());
            }
            std::thread::sleep(Duration::from_millis(2));
        };
        let (stdout, stderr) = (whole(&self.stdout), self.stderr());
        assert!(!stderr.contains("panicked at"), "prbvh {}: {stderr}", self.arguments);
        Ended { arguments: std::mem::take(&mut self.arguments), code: status.code(), stdout, stderr }
    }
}

/// A test that fails leaves no program behind.
impl Drop for Running {
    fn drop(&mut self) {
        // Most have ended by themselves.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn whole(file: &NamedTempFile) -> String {
    String::from_utf8_lossy(&std::fs::read(file).unwrap()).into_owned()
}

impl Ended {
    /// Asserts that it went well.
    ///
    /// # Panics
    /// If it did not.
    #[must_use]
    pub fn ok(self) -> Self {
        assert_eq!(self.code, Some(0), "prbvh {}: {}", self.arguments, self.stderr);
        self
    }

    /// Asserts that it ended with an error whose text has these parts, and printed nothing else.
    ///
    /// # Panics
    /// If it did not.
    pub fn refused(&self, parts: &[&str]) {
        let Self { arguments, code, stdout, stderr } = self;
        assert!(matches!(code, Some(1 | 2)), "prbvh {arguments}: ended with {code:?}: {stderr}");
        assert_eq!(stdout, "", "prbvh {arguments}");
        for part in parts {
            assert!(stderr.contains(part), "prbvh {arguments}: \"{part}\" is missing in: {stderr}");
        }
    }

    /// What it printed, as one JSON value.
    ///
    /// # Panics
    /// If it is none.
    #[must_use]
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("prbvh {}: {error}", self.arguments))
    }
}
