//! Where browsers are. The project's tasks compile this file too, which look for what the tests will find.

use std::path::{Path, PathBuf};

/// Programs of Chromium's family on the search path.
const NAMES: [&str; 8] = [
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "microsoft-edge",
    "brave-browser",
    "msedge",
];

/// The browser that the variable `CHROME` names, or else the first that is installed.
pub(crate) fn browser() -> Option<PathBuf> {
    let named = std::env::var_os("CHROME").filter(|program| !program.is_empty()).map(PathBuf::from);
    named.or_else(|| places().find(|place| place.is_file()))
}

fn places() -> impl Iterator<Item = PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    let on_path = NAMES.into_iter().flat_map(move |name| {
        let file = format!("{name}{}", std::env::consts::EXE_SUFFIX);
        folders.iter().map(|folder| folder.join(&file)).collect::<Vec<_>>()
    });
    let windows = ["ProgramFiles", "ProgramFiles(x86)", "LOCALAPPDATA"].into_iter().filter_map(std::env::var_os);
    let windows = windows.flat_map(|folder| {
        let inside = ["Google/Chrome/Application/chrome.exe", "Microsoft/Edge/Application/msedge.exe"];
        inside.map(|file| Path::new(&folder).join(file))
    });
    let mac = ["Google Chrome", "Chromium", "Microsoft Edge"].into_iter().map(|name| {
        Path::new("/").join("Applications").join(format!("{name}.app")).join("Contents").join("MacOS").join(name)
    });
    on_path.chain(windows).chain(mac)
}
