//! What goes to stdout.

use anyhow::Context;
use std::io::{self, ErrorKind, Write};

/// Columns where the width of the terminal is not known.
const DEFAULT_COLUMNS: u16 = 100;

/// Columns of the terminal.
pub(super) fn columns() -> u16 {
    console::Term::stdout().size_checked().map_or(DEFAULT_COLUMNS, |(_, columns)| columns)
}

/// Prints a line. A reader that went away (`prbvh … | head`) is no error; a full disk is.
pub(super) fn print(text: &str) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    unless_unread(writeln!(out, "{text}").and_then(|()| out.flush())).context("stdout")
}

/// The outcome of writing, which is none where nobody reads.
pub(super) fn unless_unread(written: io::Result<()>) -> io::Result<()> {
    match written {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}
