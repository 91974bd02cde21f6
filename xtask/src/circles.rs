//! Circles of imports: modules of one folder that need each other. Whoever reads one of them has to read them all.
//!
//! A module needs another one if it names the other or something of it, in a `use` or in the code, also by a name that the parent hands on
//! (`pub use`). A parent and its children are one thing, and tests may look at everything.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use std::collections::{BTreeMap, BTreeSet};

/// Places of a crate's modules, from the root on: `["device", "vulkan"]`.
type Place = Vec<String>;

/// Deepest chain of names that hand on names.
const MOST_HANDED_ON: usize = 8;

/// What a module names.
#[derive(Debug, Default)]
struct Module {
    /// Paths as written: `["super", "books", "CHUNK"]`.
    named: Vec<Place>,
    /// Paths of `use` items, whose last name is one of the module's own.
    used: Vec<Place>,
}

/// The circles among the modules of each crate of these files, which are pairs of path and text.
pub(crate) fn faults(files: &[(String, String)]) -> Vec<String> {
    let mut crates: BTreeMap<&str, BTreeMap<Place, Module>> = BTreeMap::new();
    for (path, text) in files {
        let Some((folder, file)) = path.split_once("/src/").filter(|(_, file)| !is_of_tests(file)) else { continue };
        // What is not Rust is another rule's business.
        let Ok(tokens) = text.parse() else { continue };
        let module = Module::of(tokens);
        crates.entry(folder).or_default().insert(place(file), module);
    }
    let circles = crates.iter().flat_map(|(folder, modules)| {
        let circles = circles(modules).into_iter();
        circles.map(move |circle| format!("{folder}/src: a circle of imports: {}", circle.join(" → ")))
    });
    circles.collect()
}

fn is_of_tests(file: &str) -> bool {
    file.split('/')
        .any(|part| matches!(part.trim_end_matches(".rs"), "tests" | "testing" | "bin") || part.ends_with("_tests.rs"))
}

/// `device/vulkan/mod.rs` is `device::vulkan`.
fn place(file: &str) -> Place {
    let mut place: Place = file.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
    if matches!(place.last().map(String::as_str), Some("mod" | "lib" | "main")) {
        place.pop();
    }
    place
}

impl Module {
    fn of(tokens: TokenStream) -> Self {
        let mut module = Self::default();
        module.read(&tokens.into_iter().collect::<Vec<_>>());
        module
    }

    fn read(&mut self, tokens: &[TokenTree]) {
        let mut rest = tokens;
        while let [first, after @ ..] = rest {
            rest = match first {
                TokenTree::Punct(mark) if mark.as_char() == '#' && is_for_tests(after) => past_item(after),
                TokenTree::Ident(word) if word == "use" => {
                    let end = after.iter().position(|token| is_mark(token, ';')).unwrap_or(after.len());
                    used(&after[..end], &mut Place::new(), &mut self.used);
                    &after[end..]
                }
                TokenTree::Ident(_) => {
                    let (path, end) = path(rest);
                    if path.len() > 1 {
                        self.named.push(path);
                    }
                    &rest[end..]
                }
                TokenTree::Group(group) => {
                    self.read(&group.stream().into_iter().collect::<Vec<_>>());
                    after
                }
                _ => after,
            };
        }
    }
}

fn is_mark(token: &TokenTree, mark: char) -> bool {
    matches!(token, TokenTree::Punct(punct) if punct.as_char() == mark)
}

/// Whether an attribute begins here that only a test build has: `[cfg(test)]`.
fn is_for_tests(tokens: &[TokenTree]) -> bool {
    let Some(TokenTree::Group(group)) = tokens.first() else { return false };
    let text = group.stream().to_string();
    text.starts_with("cfg")
        && text.split(|c: char| !c.is_alphanumeric()).any(|word| word == "test")
        && !text.contains("not")
}

/// What comes after the item whose attribute begins here.
fn past_item(tokens: &[TokenTree]) -> &[TokenTree] {
    let is_end = |token: &TokenTree| match token {
        TokenTree::Group(group) => group.delimiter() == Delimiter::Brace,
        token => is_mark(token, ';'),
    };
    let end = tokens.iter().position(is_end).map_or(tokens.len(), |end| end + 1);
    &tokens[end..]
}

/// The names of a path that begins here, and how many tokens it has.
fn path(tokens: &[TokenTree]) -> (Place, usize) {
    let mut names = Place::new();
    let mut end = 0;
    while let Some(TokenTree::Ident(name)) = tokens.get(end) {
        names.push(name.to_string());
        end += 1;
        let [first, second, TokenTree::Ident(_), ..] = &tokens[end..] else { break };
        if !(is_mark(first, ':') && is_mark(second, ':')) {
            break;
        }
        end += 2;
    }
    (names, end.max(1))
}

/// The paths of a tree of `use`, below `prefix`.
fn used(tree: &[TokenTree], prefix: &mut Place, paths: &mut Vec<Place>) {
    for part in tree.split(|token| is_mark(token, ',')) {
        let (names, end) = path(part);
        let length = prefix.len();
        prefix.extend(names);
        match part.get(end..).unwrap_or_default() {
            [colon, _, TokenTree::Group(group)] if is_mark(colon, ':') => {
                used(&group.stream().into_iter().collect::<Vec<_>>(), prefix, paths);
            }
            _ if part.is_empty() => {}
            _ => paths.push(prefix.clone()),
        }
        prefix.truncate(length);
    }
}

/// A path from the root of the crate; none if it leads into another crate.
fn absolute(from: &Place, path: &[String], modules: &BTreeMap<Place, Module>) -> Option<Place> {
    let mut base = from.clone();
    let mut rest = path;
    match path.first()?.as_str() {
        "crate" => {
            base.clear();
            rest = &path[1..];
        }
        "self" => rest = &path[1..],
        "super" => {
            while let [first, after @ ..] = rest
                && first == "super"
            {
                base.pop();
                rest = after;
            }
        }
        child => {
            base.push(child.to_owned());
            let is_child = modules.contains_key(&base);
            base.pop();
            if !is_child {
                return None;
            }
        }
    }
    base.extend_from_slice(rest);
    Some(base)
}

/// The module that has what an absolute path leads to, past all that hand it on.
fn home(mut path: Place, modules: &BTreeMap<Place, Module>) -> Place {
    for _ in 0..MOST_HANDED_ON {
        let mut length = path.len();
        while length > 0 && !modules.contains_key(&path[..length]) {
            length -= 1;
        }
        let module = path[..length].to_vec();
        let Some(name) = path.get(length) else { return module };
        let handed_on = modules.get(&module).and_then(|found| {
            let uses = found.used.iter().filter(|used| used.last() == Some(name));
            uses.filter_map(|used| absolute(&module, used, modules)).find(|used| used[..] != path[..=length])
        });
        match handed_on {
            Some(elsewhere) => path = elsewhere,
            None => return module,
        }
    }
    path
}

/// The circles of a crate, each as the modules along it, the first one again at the end.
fn circles(modules: &BTreeMap<Place, Module>) -> Vec<Vec<String>> {
    let mut needs: BTreeMap<Place, BTreeSet<Place>> = BTreeMap::new();
    for (place, module) in modules {
        let paths = module.named.iter().chain(&module.used);
        for target in paths.filter_map(|path| absolute(place, path, modules)).map(|path| home(path, modules)) {
            let common = place.iter().zip(&target).take_while(|(a, b)| a == b).count();
            if common < place.len() && common < target.len() {
                needs.entry(place[..=common].to_vec()).or_default().insert(target[..=common].to_vec());
            }
        }
    }
    let mut circles: Vec<Vec<String>> = Vec::new();
    let mut seen = BTreeSet::new();
    for start in needs.keys() {
        if seen.contains(start) {
            continue;
        }
        if let Some(circle) = way_back(start, &needs) {
            seen.extend(circle.iter().cloned());
            circles.push(circle.iter().map(|place| place.join("::")).collect());
        }
    }
    circles
}

/// The shortest way from a module over others back to it.
fn way_back(start: &Place, needs: &BTreeMap<Place, BTreeSet<Place>>) -> Option<Vec<Place>> {
    let mut came_from: BTreeMap<&Place, &Place> = BTreeMap::new();
    let mut queue = std::collections::VecDeque::from([start]);
    while let Some(place) = queue.pop_front() {
        for next in needs.get(place).into_iter().flatten() {
            if next == start {
                let mut way = vec![start.clone(), place.clone()];
                let mut at = place;
                while at != start {
                    at = came_from[at];
                    way.push(at.clone());
                }
                way.reverse();
                return Some(way);
            }
            if !came_from.contains_key(next) {
                came_from.insert(next, place);
                queue.push_back(next);
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::faults;

    fn found(files: &[(&str, &str)]) -> Vec<String> {
        faults(&files.iter().map(|(path, text)| ((*path).to_owned(), (*text).to_owned())).collect::<Vec<_>>())
    }

    #[test]
    fn two_modules_that_need_each_other_are_a_circle() {
        let a = ("x/src/a.rs", "use super::b::B;");
        for b in ["use crate::a::A;", "fn f() { super::a::g(); }", "use super::{a::{A, C}, d::D};"] {
            let faults = found(&[("x/src/lib.rs", "mod a; mod b;"), a, ("x/src/b.rs", b)]);
            assert_eq!(faults, ["x/src: a circle of imports: a → b → a"], "{b}");
        }
    }

    #[test]
    fn a_name_that_the_parent_hands_on_is_its_owners() {
        let files = [
            ("x/src/lib.rs", "mod a; mod b; pub use a::{A, C}; pub use b::B;"),
            ("x/src/a.rs", "use crate::B;"),
            ("x/src/b.rs", "use super::C;"),
        ];
        assert_eq!(found(&files), ["x/src: a circle of imports: a → b → a"]);
    }

    #[test]
    fn longer_circles_are_shown_whole() {
        let files = [
            ("x/src/m/mod.rs", "mod a; mod b; mod c;"),
            ("x/src/m/a.rs", "use super::b::B;"),
            ("x/src/m/b/mod.rs", "mod deep;"),
            ("x/src/m/b/deep.rs", "use crate::m::c::C;"),
            ("x/src/m/c.rs", "use crate::m::a::A;"),
        ];
        assert_eq!(found(&files), ["x/src: a circle of imports: m::a → m::b → m::c → m::a"]);
    }

    #[test]
    fn parents_tests_and_other_crates_make_no_circle() {
        let files = [
            ("x/src/lib.rs", "pub mod a; pub mod b; pub use a::A; pub struct Here;"),
            ("x/src/a.rs", "use super::Here; use crate::b::B; use b::Other;"),
            (
                "x/src/b.rs",
                "use super::Here; // crate::a\n const T: &str = \"crate::a\"; #[cfg(test)] mod tests { use crate::a::A; }",
            ),
            ("x/src/b/tests/mod.rs", "use crate::a::A;"),
            ("y/src/b.rs", "use x::a::A;"),
        ];
        assert!(found(&files).is_empty());
    }
}
