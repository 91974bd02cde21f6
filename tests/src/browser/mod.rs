//! A real browser without a window, for pages.

mod places;

use crate::command;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A browser of Chromium's family.
#[derive(Clone, Debug)]
pub struct Browser {
    program: PathBuf,
}

/// A page after its scripts have run.
#[derive(Clone, Debug)]
pub struct Visited {
    /// The document as HTML.
    pub dom: String,
    /// All that went to the console: errors, refused requests, and messages.
    pub console: Vec<String>,
}

/// Window and colours.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `prefers-color-scheme: dark`.
    pub dark: bool,
}

impl Browser {
    /// The one that the variable `CHROME` names, or else the first that is installed; none with `PRBVH_WITHOUT_BROWSER=1`, which is said.
    ///
    /// # Panics
    /// If there is none otherwise.
    #[must_use]
    pub fn find() -> Option<Self> {
        if std::env::var_os("PRBVH_WITHOUT_BROWSER").is_some_and(|value| value == "1") {
            let test = std::thread::current().name().unwrap_or("a test").to_owned();
            eprintln!("not run in a browser (PRBVH_WITHOUT_BROWSER=1): {test}");
            return None;
        }
        let program = places::browser().unwrap_or_else(|| {
            panic!(
                "no browser: `cargo xtask setup` installs Debian's chromium where it may; else set CHROME to one of Chromium's family.\n\
                 To test without a browser set PRBVH_WITHOUT_BROWSER=1."
            )
        });
        Some(Self { program })
    }

    /// Opens a file, waits until its scripts are done, and takes the document.
    ///
    /// # Panics
    /// If the browser fails or hangs.
    #[must_use]
    pub fn visit(&self, page: &Path, view: View) -> Visited {
        let ended = self.run(page, view, &["--dump-dom", "--enable-logging=stderr", "--v=0"]);
        assert!(ended.stdout.contains("</html>"), "{}: no document: {}", page.display(), ended.stderr);
        let console = ended.stderr.lines().filter(|line| line.contains(":CONSOLE")).map(str::to_owned).collect();
        Visited { dom: ended.stdout, console }
    }

    /// A picture of the top of a file in a window of this size, as PNG.
    ///
    /// # Panics
    /// If the browser fails or hangs.
    #[must_use]
    pub fn screenshot(&self, page: &Path, view: View) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("page.png");
        let ended = self.run(page, view, &[&format!("--screenshot={}", file.display()), "--hide-scrollbars"]);
        std::fs::read(&file).unwrap_or_else(|error| panic!("{error}: {}", ended.stderr))
    }

    fn run(&self, page: &Path, view: View, flags: &[&str]) -> command::Ended {
        let profile = tempfile::tempdir().unwrap();
        let mut command = Command::new(&self.program);
        command
            // A test is often root in a container, where Chromium's sandbox does not start. The page is ours.
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
            .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg(format!("--window-size={},{}", view.width, view.height))
            .arg(format!("--blink-settings=preferredColorScheme={}", if view.dark { 0 } else { 1 }))
            // Of the page's time, not of the clock's.
            .arg("--virtual-time-budget=5000")
            .args(flags)
            .arg(file_url(page));
        command::start(&mut command).wait().ok()
    }
}

fn file_url(path: &Path) -> String {
    let path = std::path::absolute(path).unwrap();
    let path = path.to_string_lossy().replace('\\', "/");
    let mut url = format!("file://{}", if path.starts_with('/') { "" } else { "/" });
    for byte in path.bytes() {
        if byte.is_ascii_alphanumeric() || b"/:-_.~".contains(&byte) {
            url.push(char::from(byte));
        } else {
            url.push_str(&format!("%{byte:02X}"));
        }
    }
    url
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_url_has_no_blanks() {
        if cfg!(unix) {
            assert_eq!(file_url(Path::new("/a b/ü#.html")), "file:///a%20b/%C3%BC%23.html");
        }
    }
}
