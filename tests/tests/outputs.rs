//! Where outputs go: stdout that fails, pipes, devices and links in the place of files, inputs that would be overwritten, folders that another run has.
#![cfg(target_os = "linux")]

use prbvh_tests::command::{Fifo, run, start};
use std::fs::{self, File};
use std::io::Read;
use std::os::unix::fs::{FileTypeExt, symlink};
use std::path::Path;
use std::process::{Command, Stdio};
use tempfile::{TempDir, tempdir};

const PRBVH: &str = env!("CARGO_BIN_EXE_prbvh-under-test");

const SMALL: [&str; 6] = ["--device", "cpu", "--size", "8x8", "--samples", "1"];

/// A folder with a scene of two triangles, and a tree over it.
fn with_a_scene() -> TempDir {
    let folder = tempdir().unwrap();
    fs::write(folder.path().join("scene.obj"), "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n").unwrap();
    let _ = run(PRBVH, folder.path(), &["optimize", "scene.obj", "--device", "cpu", "--out", "made"]).ok();
    folder
}

fn is_picture(path: &Path) -> bool {
    fs::read(path).unwrap().starts_with(b"\x89PNG")
}

#[test]
fn a_full_stdout_is_an_error_of_every_command() {
    let folder = with_a_scene();
    let commands = [
        "--help",
        "--version",
        "devices",
        "devices --json",
        "optimize scene.obj --device cpu --out out",
        "optimize scene.obj --device cpu --json",
        "optimize scene.obj made/tree.bvh --device cpu --json",
        "plan scene.obj --device cpu",
        "plan scene.obj --device cpu --json",
        "stats made/tree.bvh",
        "stats made/tree.bvh --json",
        "render scene.obj --device cpu --size 8x8",
        "compare scene.obj --device cpu --rays off --methods lbvh",
        "compare scene.obj --device cpu --rays off --methods lbvh --json",
        "stability --list",
        "stability --device cpu --cases one --methods lbvh --json",
    ];
    for arguments in commands {
        let full = File::options().write(true).open("/dev/full").unwrap();
        let mut command = Command::new(PRBVH);
        command.current_dir(folder.path()).args(arguments.split(' ')).stdin(Stdio::null()).stdout(full);
        let ended = command.output().unwrap();
        let stderr = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(1), "{arguments}: {stderr}");
        assert!(stderr.contains("stdout: No space left on device") && !stderr.contains("panicked"), "{stderr}");
    }
    assert!(folder.path().join("out/report.json").is_file(), "files do not depend on stdout");
    assert!(is_picture(&folder.path().join("render.png")));
}

#[test]
fn pipes_devices_and_links_are_written_through() {
    let folder = with_a_scene();
    let path = |name: &str| folder.path().join(name);
    let render = |out: &str| {
        let ended = run(PRBVH, folder.path(), &[&["render", "scene.obj", "-o", out, "-q"], &SMALL[..]].concat());
        assert!(ended.ok().stderr.is_empty());
    };
    // By a link, so that a program that replaces it does no harm.
    symlink("/dev/null", path("null.png")).unwrap();
    render("null.png");
    assert!(fs::metadata(path("null.png")).unwrap().file_type().is_char_device());

    fs::write(path("behind.png"), "old").unwrap();
    for (link, file) in [("link.png", "behind.png"), ("dangling.png", "new.png")] {
        symlink(file, path(link)).unwrap();
        render(link);
        assert!(fs::symlink_metadata(path(link)).unwrap().is_symlink() && is_picture(&path(file)), "{link}");
    }

    let _fifo = Fifo::new(&path("fifo.png"));
    std::thread::scope(|scope| {
        let read = scope.spawn(|| fs::read(path("fifo.png")).unwrap());
        render("fifo.png");
        assert!(read.join().unwrap().starts_with(b"\x89PNG"));
    });
    assert!(fs::metadata(path("fifo.png")).unwrap().file_type().is_fifo());

    let full = run(PRBVH, folder.path(), &[&["render", "scene.obj", "-o", "/dev/full"], &SMALL[..]].concat());
    full.refused(&["/dev/full", "No space left"]);
}

#[test]
fn an_input_is_never_overwritten() {
    let folder = with_a_scene();
    let path = |name: &str| folder.path().join(name);
    fs::hard_link(path("scene.obj"), path("hard.obj")).unwrap();
    symlink("scene.obj", path("soft.obj")).unwrap();
    fs::create_dir(path("out")).unwrap();
    symlink("../scene.obj", path("out/compare.json")).unwrap();
    symlink("../scene.obj", path("out/tree.bvh")).unwrap();
    let scene = fs::read(path("scene.obj")).unwrap();
    let tree = fs::read(path("made/tree.bvh")).unwrap();
    let commands = [
        "render scene.obj -o scene.obj",
        "render scene.obj -o ./made/../scene.obj",
        "render scene.obj -o hard.obj",
        "render soft.obj -o scene.obj",
        "render scene.obj -o soft.obj",
        "render scene.obj --tree made/tree.bvh -o made/tree.bvh",
        "optimize scene.obj --out out",
        "optimize scene.obj --initial made/tree.bvh --out made",
        "compare scene.obj --out out",
    ];
    for arguments in commands {
        let arguments: Vec<&str> = arguments.split(' ').chain(["--device", "cpu"]).collect();
        let ended = run(PRBVH, folder.path(), &arguments);
        ended.refused(&["would be overwritten"]);
        assert!(!ended.stderr.contains("iteration"), "{}", ended.stderr);
        assert!(fs::read(path("scene.obj")).unwrap() == scene, "{arguments:?}");
        assert!(fs::read(path("made/tree.bvh")).unwrap() == tree, "{arguments:?}");
    }
}

#[test]
fn a_folder_belongs_to_one_run_and_to_none_that_was_killed() {
    let folder = with_a_scene();
    let long = "optimize --triangles 100000 --order published --epsilon 0 --device cpu --out out";
    let mut first = start(Command::new(PRBVH).current_dir(folder.path()).args(long.split(' ')));
    first.until(&["iteration   2 "]);
    for second in ["optimize scene.obj --device cpu --out out", "compare scene.obj --device cpu --rays off --out ./out"]
    {
        let arguments: Vec<&str> = second.split(' ').collect();
        run(PRBVH, folder.path(), &arguments).refused(&["another run of prbvh"]);
    }
    first.signal("KILL");
    assert_eq!(first.wait().code, None);
    let _ = run(PRBVH, folder.path(), &["optimize", "scene.obj", "--device", "cpu", "--out", "out"]).ok();
    let report = fs::read_to_string(folder.path().join("out/report.json")).unwrap();
    assert!(report.contains("\"scene\": \"scene\""));
}

#[test]
fn where_every_row_fails_stderr_says_why_even_in_silence() {
    let folder = with_a_scene();
    let arguments = ["compare", "scene.obj", "--device", "cpu", "--methods", "planted-panic", "-qq", "--json"];
    let ended = run(PRBVH, folder.path(), &arguments);
    assert_eq!(ended.code, Some(1));
    assert!(ended.stderr.contains("1 of 1 rows failed") && ended.stderr.contains("panicked"), "{}", ended.stderr);
    assert_eq!(ended.json()["rows"].as_array().unwrap().len(), 1);
}

/// What a terminal is sent.
fn on_a_terminal(arguments: &[&str], environment: &[(&str, &str)]) -> String {
    use rustix::pty::{OpenptFlags, grantpt, ioctl_tiocgptpeer, openpt, unlockpt};
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY;
    let ours = openpt(flags).unwrap();
    grantpt(&ours).unwrap();
    unlockpt(&ours).unwrap();
    let theirs = ioctl_tiocgptpeer(&ours, flags).unwrap();
    let folder = with_a_scene();
    let mut command = Command::new(PRBVH);
    for name in ["NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE"] {
        command.env_remove(name);
    }
    command.env("TERM", "xterm-256color").envs(environment.iter().copied());
    command.current_dir(folder.path()).args(arguments).stdin(Stdio::null());
    command.stdout(theirs.try_clone().unwrap()).stderr(theirs);
    let mut child = command.spawn().unwrap();
    // It has ends of the terminal, too.
    drop(command);
    let mut said = Vec::new();
    let mut terminal = File::from(ours);
    let mut bytes = [0; 4096];
    // An error is the end: nobody has the other side any more.
    while let Ok(read @ 1..) = terminal.read(&mut bytes) {
        said.extend_from_slice(&bytes[..read]);
    }
    child.wait().unwrap();
    String::from_utf8_lossy(&said).into_owned()
}

#[test]
fn a_terminal_gets_colours_and_motion_unless_they_are_not_wanted() {
    const ESCAPE: char = '\x1b';
    let commands: [&[&str]; 3] = [
        &["optimize", "scene.obj", "--device", "cpu"],
        &["compare", "scene.obj", "--device", "cpu", "--rays", "off", "--methods", "lbvh,planted-panic"],
        &["optimize", "--frobnicate"],
    ];
    for arguments in commands {
        let plain = on_a_terminal(arguments, &[]);
        assert!(plain.contains(ESCAPE), "{arguments:?} shows nothing: {plain:?}");
        let cases: [&[(&str, &str)]; 3] =
            [&[("NO_COLOR", "1")], &[("TERM", "dumb")], &[("NO_COLOR", "1"), ("CLICOLOR_FORCE", "1")]];
        for environment in cases {
            let said = on_a_terminal(arguments, environment);
            assert!(!said.contains(ESCAPE) && !said.is_empty(), "{arguments:?}, {environment:?}: {said:?}");
            assert!(
                !said.replace("\r\n", "\n").contains('\r'),
                "{arguments:?}, {environment:?}: a line moves: {said:?}"
            );
        }
    }
}
