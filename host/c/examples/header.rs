//! Writes `include/prbvh.h` anew.

use std::path::Path;

/// The header as the sources have it.
pub(crate) fn text() -> String {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(package.join("cbindgen.toml")).expect("cbindgen.toml");
    let builder = cbindgen::Builder::new().with_config(config).with_src(package.join("src").join("lib.rs"));
    let mut header = Vec::new();
    builder.generate().expect("the sources as a header").write(&mut header);
    String::from_utf8(header).expect("a header of text")
}

#[allow(dead_code, reason = "the test of the header has this file as a module")]
fn main() -> std::io::Result<()> {
    std::fs::write(Path::new(env!("CARGO_MANIFEST_DIR")).join("include").join("prbvh.h"), text())
}
