//! Fuzzing: no scene and no bytes make prbvh panic, take memory out of proportion, or answer with anything but a valid result or a clear
//! error. Found inputs stay in `tests/corpus`, which is replayed first. `cargo xtask fuzz --minutes N` goes on with other seeds.

mod cases;
mod corpus;
mod damage;
mod scenes;
mod targets;

use cases::Budget;
use targets::{FILES, Target};

#[test]
fn files_that_once_broke_a_loader() {
    for target in FILES {
        let (faults, count) = corpus::replay(target);
        assert!(faults.is_empty(), "{}:\n{}", target.name, faults.join("\n"));
        println!("{}: {count} files", target.name);
    }
}

fn fuzz_files(name: &str) {
    let target = Target::named(name);
    let samples = corpus::valid(target);
    // Debug builds read some thousand small files in a second.
    cases::run(name, Budget::of_tests(600), damage::case(samples.len()), |case| target.check(&case.bytes(&samples)));
}

#[test]
fn obj() {
    fuzz_files("obj");
}

#[test]
fn ply() {
    fuzz_files("ply");
}

#[test]
fn stl() {
    fuzz_files("stl");
}

#[test]
fn gltf() {
    fuzz_files("gltf");
}

#[test]
fn content() {
    fuzz_files("content");
}

#[test]
fn packed() {
    fuzz_files("packed");
}

#[test]
fn tree() {
    fuzz_files("tree");
}

#[test]
fn scenes() {
    cases::run("scenes", Budget::of_tests(40), scenes::case(), scenes::check);
}

mod planted {
    //! The harness itself: loaders with each of the faults that it is there for.

    use super::cases::{self, Budget};
    use super::targets::{Outcome, Target};
    use super::{corpus, damage};
    use std::path::Path;

    fn planted(read: fn(&Path) -> Outcome) -> Target {
        Target { name: "obj", extensions: &["obj"], bound: 1 << 20, read }
    }

    fn bytes(path: &Path) -> Vec<u8> {
        std::fs::read(path).unwrap()
    }

    fn fault(read: fn(&Path) -> Outcome) -> String {
        planted(read).check(&("obj", b"v 0 0 0\n".to_vec())).unwrap_err()
    }

    #[test]
    fn a_panic_is_found() {
        let fault = fault(|_| panic!("planted"));
        assert!(fault.starts_with("panic: planted"), "{fault}");
    }

    #[test]
    fn memory_out_of_proportion_is_found() {
        let hungry = |path: &Path| {
            let promised = bytes(path).len() << 20;
            Err(format!("{}: {} bytes", path.display(), Vec::<u8>::with_capacity(promised).capacity()))
        };
        assert!(fault(hungry).contains("bytes of memory for a file of 8 bytes"));
    }

    #[test]
    fn an_unclear_error_is_found() {
        assert!(fault(|_| Err("bad".to_owned())).contains("does not name the file"));
        assert!(fault(|path| Err(format!("{}: {}", path.display(), "x".repeat(5000)))).contains("characters"));
    }

    #[test]
    fn an_invalid_result_is_found() {
        assert!(fault(|_| Ok(Err("no tree".to_owned()))).contains("invalid result: no tree"));
    }

    /// A loader that panics at a byte that no valid file has is found by mutations, and the input that is shown is small.
    #[test]
    fn mutations_reach_a_panicking_loader() {
        let target = planted(|path| {
            assert!(!bytes(path).contains(&0xff), "planted");
            Err(path.display().to_string())
        });
        let samples = corpus::valid(&target);
        let found = cases::search(Budget { seed: 1, cases: 2000 }, damage::case(samples.len()), |case| {
            target.check(&case.bytes(&samples))
        });
        let (case, text) = found.expect_err("the planted panic is not found");
        assert!(text.contains("panic: planted"), "{text}");
        assert!(case.bytes(&samples).1.len() < 400, "{case:?}");
    }
}
