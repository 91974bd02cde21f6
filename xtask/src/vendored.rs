//! Files of others in the repository are what was published: a folder of a `vendor` folder lists their SHA-256 in `SHA256SUMS`, as
//! `sha256sum` writes it.

use sha2::{Digest, Sha256};
use std::collections::BTreeMap;

const LIST: &str = "SHA256SUMS";
/// Ours: where the files come from.
const README: &str = "README.md";

/// Whether a file of the repository is somebody else's.
pub(crate) fn is_vendored(path: &str) -> bool {
    path.split('/').rev().skip(1).any(|folder| folder == "vendor")
}

/// Files that are not as listed, are not listed, or are listed and not there. `files` are pairs of path and content.
pub(crate) fn faults(files: &[(&str, Vec<u8>)]) -> Vec<String> {
    let mut folders: BTreeMap<&str, BTreeMap<&str, &[u8]>> = BTreeMap::new();
    for (path, bytes) in files.iter().filter(|(path, _)| is_vendored(path)) {
        let (folder, name) = path.rsplit_once('/').unwrap_or(("", path));
        folders.entry(folder).or_default().insert(name, bytes);
    }
    folders.iter().flat_map(|(folder, files)| of_folder(folder, files)).collect()
}

fn sha256(bytes: &[u8]) -> String {
    format!("{:x}", Sha256::digest(bytes))
}

fn of_folder(folder: &str, files: &BTreeMap<&str, &[u8]>) -> Vec<String> {
    let list = files.get(LIST).map_or_else(String::new, |bytes| String::from_utf8_lossy(bytes).into_owned());
    let listed: BTreeMap<&str, &str> =
        list.lines().filter_map(|line| line.split_once("  ")).map(|(sum, name)| (name, sum)).collect();
    let fault = |(name, bytes): (&&str, &&[u8])| match listed.get(name) {
        None if [LIST, README].contains(name) => None,
        None => Some(format!("{folder}/{name}: is not in {LIST}")),
        Some(sum) if sha256(bytes) == **sum => None,
        Some(_) => Some(format!("{folder}/{name}: is not what {LIST} says")),
    };
    let missing = listed.keys().filter(|name| !files.contains_key(*name));
    let missing = missing.map(|name| format!("{folder}/{LIST}: {name} is not there"));
    files.iter().filter_map(fault).chain(missing).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_others_is_as_it_was_published() {
        let list = format!("{}  a.js\n", sha256(b"let a;"));
        let found = |list: &str, files: &[(&'static str, &str)]| {
            let list =
                [("lab/vendor/a/SHA256SUMS", list), ("lab/vendor/a/README.md", "from there"), ("src/b.js", "ours")];
            let all = list.iter().chain(files).map(|(path, text)| (*path, text.as_bytes().to_vec()));
            faults(&all.collect::<Vec<_>>())
        };
        assert_eq!(found(&list, &[("lab/vendor/a/a.js", "let a;")]), [""; 0]);
        assert_eq!(
            found(&list, &[("lab/vendor/a/a.js", "let b;")]),
            ["lab/vendor/a/a.js: is not what SHA256SUMS says"]
        );
        assert_eq!(found("", &[("lab/vendor/a/a.js", "let a;")]), ["lab/vendor/a/a.js: is not in SHA256SUMS"]);
        assert_eq!(found(&list, &[]), ["lab/vendor/a/SHA256SUMS: a.js is not there"]);
        assert!(!is_vendored("lab/vendor") && !is_vendored("lab/vendored/a.js") && is_vendored("vendor/a/b/c.js"));
    }
}
