//! The page of a comparison, in a real browser.

use prbvh::report::page;
use prbvh_tests::made_up;

#[test]
fn look() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("page");
    let paths = page::write(&made_up::comparison(10), &folder).unwrap();
    println!("{} files, page {} bytes", paths.len(), paths[0].metadata().unwrap().len());
}
