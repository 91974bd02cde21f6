//! Runs the tests in Python on the module that cargo built.

mod interpreter;

use std::path::{Path, PathBuf};
use std::process::Command;

/// The module as cargo has it beside this test.
fn built() -> PathBuf {
    let name = format!("{}_prbvh{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    std::env::current_exe().unwrap().parent().unwrap().join(name)
}

#[test]
fn the_tests_in_python_pass() {
    if std::env::var_os("PRBVH_WITHOUT_PYTHON").is_some_and(|value| value == "1") {
        println!("not run: the_tests_in_python_pass (PRBVH_WITHOUT_PYTHON=1)");
        return;
    }
    let (python, _) = interpreter::with_numpy()
        .unwrap_or_else(|missing| panic!("{missing}. PRBVH_WITHOUT_PYTHON=1 leaves the tests of the module out."));

    // The package as pip would install it.
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let site = tempfile::tempdir().unwrap();
    let folder = site.path().join("prbvh");
    std::fs::create_dir(&folder).unwrap();
    for file in std::fs::read_dir(package.join("python/prbvh")).unwrap().map(Result::unwrap) {
        if file.file_type().unwrap().is_file() {
            std::fs::copy(file.path(), folder.join(file.file_name())).unwrap();
        }
    }
    let module = if cfg!(windows) { "_prbvh.pyd" } else { "_prbvh.abi3.so" };
    std::fs::copy(built(), folder.join(module)).unwrap();

    let mut run = Command::new(&python);
    run.args(["-B", "-W", "error", "-m", "unittest", "test_prbvh"]).current_dir(package.join("tests"));
    let output = run.env("PYTHONPATH", site.path()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    let tests = include_str!("test_prbvh.py").matches("    def test_").count();
    assert!(output.status.success() && said.contains(&format!("Ran {tests} tests")), "{run:?}:\n{said}");
}
