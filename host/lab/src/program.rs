//! The program that ran.

use serde::Serialize;

/// What ran.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Program {
    /// Name.
    pub name: String,
    /// Version of the package.
    pub version: String,
    /// Commit it was built from; `unknown` outside a repository.
    pub commit: String,
    /// Command line, program first.
    pub command_line: Vec<String>,
}

impl Program {
    /// This program, as it was called.
    #[must_use]
    pub fn current() -> Self {
        Self {
            name: "prbvh".to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: env!("PRBVH_COMMIT").to_owned(),
            // A file name need not be Unicode.
            command_line: std::env::args_os().map(|argument| argument.to_string_lossy().into_owned()).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_program_knows_itself() {
        let program = Program::current();
        assert_eq!((program.name.as_str(), program.version.as_str()), ("prbvh", env!("CARGO_PKG_VERSION")));
        assert!(program.commit == "unknown" || program.commit.bytes().all(|c| c.is_ascii_hexdigit()));
        assert!(!program.command_line.is_empty());
    }
}
