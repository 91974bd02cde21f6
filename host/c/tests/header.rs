//! The committed header is the one that the sources make.

#[path = "../examples/header.rs"]
mod header;

#[test]
fn the_header_is_current() {
    let committed = include_str!("../include/prbvh.h").replace("\r\n", "\n");
    let differs = committed.lines().zip(header::text().lines()).position(|(a, b)| a != b);
    let current = committed == header::text();
    assert!(current, "include/prbvh.h is old from line {differs:?} on: `cargo run -p prbvh-c --example header`");
}
