//! `cargo xtask tidy`: rules of the house that no other tool knows, as code.

use crate::{circles, repo, vendored};
use anyhow::{Context, Result, bail};
use proc_macro2::{TokenStream, TokenTree};
use regex::Regex;
use std::path::Path;
use std::process::Command;
use std::sync::LazyLock;

/// Where `unsafe` may be: files, and folders with a slash at the end.
const UNSAFE: [&str; 5] = [
    "kernel/src/mem.rs",
    "host/prbvh/src/device/vulkan/",
    "host/prbvh/examples/your_vulkan.rs",
    "host/c/src/",
    "xtask/src/vulkan.rs",
];

/// Longest file of Rust, lines. Tests may be longer.
const LINES: usize = 400;

/// # Errors
/// Names file, line and rule of each breach.
pub(crate) fn run() -> Result<()> {
    let root = repo::root()?;
    let mut git = Command::new("git");
    git.args(["ls-files", "-z"]).current_dir(&root);
    let listed = repo::output(&mut git)?.context("git is missing, which lists the files of the project")?;
    let files: Vec<&str> = listed.split('\0').filter(|path| root.join(path).is_file()).collect();
    let mut faults = Vec::new();
    let mut of_others = Vec::new();
    for &path in &files {
        let bytes = std::fs::read(root.join(path)).with_context(|| format!("cannot read {path}"))?;
        // Only our texts have rules.
        if vendored::is_vendored(path) {
            of_others.push((path, bytes));
        } else if let Ok(text) = std::str::from_utf8(&bytes)
            && !bytes.contains(&0)
        {
            faults.extend(check(path, text));
        }
    }
    let read = |path: &str| std::fs::read_to_string(root.join(path)).with_context(|| format!("cannot read {path}"));
    let sources = files.iter().filter(|path| path.ends_with(".rs")).map(|path| Ok((path.to_string(), read(path)?)));
    faults.extend(circles::faults(&sources.collect::<Result<Vec<_>>>()?));
    faults.extend(vendored::faults(&of_others));
    if !faults.is_empty() {
        bail!("{} breaches of the rules:\n  {}", faults.len(), faults.join("\n  "));
    }
    println!("tidy: {} files", files.len());
    Ok(())
}

/// All rules on one file.
fn check(path: &str, text: &str) -> Vec<String> {
    let mut faults = [notes(path, text), absolute_paths(path, text)].concat();
    if Path::new(path).extension().is_some_and(|extension| extension == "rs") {
        faults.extend(length(path, text));
        faults.extend(unsafe_code(path, text));
    }
    faults
}

fn unsafe_code(path: &str, text: &str) -> Vec<String> {
    if UNSAFE.iter().any(|&place| if place.ends_with('/') { path.starts_with(place) } else { path == place }) {
        return Vec::new();
    }
    // Tokens, so that comments and texts may use the word.
    match text.parse() {
        Ok(tokens) => {
            let mut lines = Vec::new();
            find_unsafe(tokens, &mut lines);
            lines.iter().map(|line| format!("{path}:{line}: unsafe belongs in {}", UNSAFE.join(", "))).collect()
        }
        Err(error) => vec![format!("{path}: not Rust: {error}")],
    }
}

fn find_unsafe(tokens: TokenStream, lines: &mut Vec<usize>) {
    for token in tokens {
        match token {
            TokenTree::Group(group) => find_unsafe(group.stream(), lines),
            TokenTree::Ident(word) if word == "unsafe" => lines.push(word.span().start().line),
            _ => {}
        }
    }
}

fn length(path: &str, text: &str) -> Vec<String> {
    let lines = text.lines().count();
    let is_test = path.starts_with("tests/") || path.contains("/tests/");
    if lines <= LINES || is_test {
        return Vec::new();
    }
    vec![format!("{path}: {lines} lines, {LINES} are allowed")]
}

fn notes(path: &str, text: &str) -> Vec<String> {
    // Written so that this file keeps its own rule.
    static NOTE: LazyLock<Regex> = LazyLock::new(|| pattern(r"\b(TO[D]O|FIX[M]E)\b"));
    let bare = |line: &str| NOTE.is_match(line) && !line.contains("https://");
    numbered(text, bare)
        .map(|line| format!("{path}:{line}: a note of work to do needs the link of its issue"))
        .collect()
}

fn absolute_paths(path: &str, text: &str) -> Vec<String> {
    // An absolute path of Unix has two names at least and starts after a blank, a quote or the like.
    static UNIX: LazyLock<Regex> = LazyLock::new(|| pattern(r#"(?:^|[\s"'`(=:,])/([A-Za-z][\w.-]*)/[\w.-]"#));
    static WINDOWS: LazyLock<Regex> = LazyLock::new(|| pattern(r"\b[A-Za-z]:\\+[Uu]sers\b"));
    // The same on every machine.
    const SYSTEM: [&str; 9] = ["bin", "dev", "etc", "opt", "proc", "sys", "tmp", "usr", "var"];
    let bad = |line: &str| UNIX.captures_iter(line).any(|found| !SYSTEM.contains(&&found[1])) || WINDOWS.is_match(line);
    numbered(text, bad).map(|line| format!("{path}:{line}: a path of one machine")).collect()
}

fn numbered(text: &str, bad: impl Fn(&str) -> bool) -> impl Iterator<Item = usize> {
    (1..).zip(text.lines()).filter(move |(_, line)| bad(line)).map(|(number, _)| number)
}

#[expect(clippy::expect_used, reason = "the patterns are literals, and the tests use each")]
fn pattern(text: &str) -> Regex {
    Regex::new(text).expect("a pattern of this file")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unsafe_outside_its_places() {
        let code = "//! unsafe in a comment\nfn f() {\n    let word = \"unsafe\";\n    unsafe { g() }\n}\n";
        let faults = check("host/prbvh/src/bvh/mod.rs", code);
        assert_eq!(faults.len(), 1, "{faults:?}");
        assert!(faults[0].starts_with("host/prbvh/src/bvh/mod.rs:4: unsafe belongs in "), "{faults:?}");
        for place in ["kernel/src/mem.rs", "host/prbvh/src/device/vulkan/buffer.rs", "xtask/src/vulkan.rs"] {
            assert!(check(place, code).is_empty(), "{place}");
        }
        assert_eq!(check("kernel/src/mem.rs.rs", code).len(), 1);
        assert!(check("host/prbvh/src/lib.rs", "#![deny(unsafe_code)]").is_empty());
    }

    #[test]
    fn files_that_are_too_long() {
        let code = |lines: usize| "fn f() {}\n".repeat(lines);
        assert!(check("host/prbvh/src/lib.rs", &code(400)).is_empty());
        assert_eq!(check("host/prbvh/src/lib.rs", &code(401)), ["host/prbvh/src/lib.rs: 401 lines, 400 are allowed"]);
        assert!(check("tests/tests/all.rs", &code(401)).is_empty());
        assert!(check("README.md", &code(401)).is_empty());
    }

    #[test]
    fn notes_without_a_link() {
        for word in [concat!("TO", "DO"), concat!("FIX", "ME")] {
            let text = format!("fn f() {{}}\n// {word}: later\n// {word}: https://github.com/prbvh/prbvh/issues/1\n");
            let faults = check("host/prbvh/src/lib.rs", &text);
            assert_eq!(faults, ["host/prbvh/src/lib.rs:2: a note of work to do needs the link of its issue"]);
        }
        assert!(check("host/prbvh/src/lib.rs", "fn todo() {}").is_empty());
    }

    #[test]
    fn paths_of_one_machine() {
        let slash = '/';
        for path in ["home/ann/x", "root/x", "Users/ann/x", "workplace/x"].map(|path| format!("{slash}{path}")) {
            for text in [format!("see `{path}`"), format!("cd {path}"), format!("\"{path}\"")] {
                assert_eq!(check("README.md", &text), ["README.md:1: a path of one machine"], "{text}");
            }
        }
        assert_eq!(check("README.md", concat!("C:", r"\Users\ann")).len(), 1);
        for text in
            ["/usr/lib/x", "https://docs.rs/a/b", "a/b/c", "1 / 2 / 3", "/// doc", "../shared/x", "#!/usr/bin/env bash"]
        {
            assert!(check("README.md", text).is_empty(), "{text}");
        }
    }
}
