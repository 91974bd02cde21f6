//! Whether the terminal gets colours and moving bars: the one place that knows `NO_COLOR`, `TERM=dumb`, `CLICOLOR` and `CLICOLOR_FORCE`.

use std::env::var_os;
use std::io::{IsTerminal, stderr, stdout};

/// What the user and the terminal want.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Colour {
    pub(super) on_stdout: bool,
    pub(super) on_stderr: bool,
    /// Whether a line on stderr may be drawn again and again.
    pub(super) is_animated: bool,
}

impl Colour {
    /// Of this process. Tells the crate that styles texts, too.
    pub(super) fn settle() -> Self {
        let is_set = |name: &str| var_os(name).is_some_and(|value| !value.is_empty());
        let is_not = |name: &str, value: &str| var_os(name).is_some_and(|found| !found.is_empty() && found != value);
        let wanted = Wanted {
            never: is_set("NO_COLOR"),
            always: is_not("CLICOLOR_FORCE", "0"),
            not_by_itself: var_os("CLICOLOR").is_some_and(|value| value == "0"),
            is_dumb: var_os("TERM").is_some_and(|value| value == "dumb"),
        };
        let colour = wanted.on(stdout().is_terminal(), stderr().is_terminal());
        console::set_colors_enabled(colour.on_stdout);
        console::set_colors_enabled_stderr(colour.on_stderr);
        colour
    }
}

impl Colour {
    /// For the parser of arguments, which would ask the environment by itself, and takes more for a terminal.
    pub(super) fn of_help(self) -> clap::ColorChoice {
        if self.on_stdout || self.on_stderr { clap::ColorChoice::Auto } else { clap::ColorChoice::Never }
    }
}

/// The environment.
#[derive(Clone, Copy, Debug, Default)]
struct Wanted {
    never: bool,
    always: bool,
    not_by_itself: bool,
    is_dumb: bool,
}

impl Wanted {
    fn on(self, stdout_is_terminal: bool, stderr_is_terminal: bool) -> Colour {
        let Self { never, always, not_by_itself, is_dumb } = self;
        let on = |is_terminal: bool| !never && (always || (is_terminal && !not_by_itself && !is_dumb));
        Colour {
            on_stdout: on(stdout_is_terminal),
            on_stderr: on(stderr_is_terminal),
            is_animated: stderr_is_terminal && !never && !is_dumb,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_wants_none_gets_none() {
        let on = |wanted: Wanted, terminal| {
            let Colour { on_stdout, on_stderr, is_animated } = wanted.on(terminal, terminal);
            assert_eq!(on_stdout, on_stderr);
            (on_stderr, is_animated)
        };
        let plain = Wanted::default();
        assert_eq!((on(plain, true), on(plain, false)), ((true, true), (false, false)));
        assert_eq!(on(Wanted { never: true, ..plain }, true), (false, false));
        assert_eq!(on(Wanted { is_dumb: true, ..plain }, true), (false, false));
        assert_eq!(on(Wanted { not_by_itself: true, ..plain }, true), (false, true));
        let always = Wanted { always: true, ..plain };
        assert_eq!((on(always, false), on(Wanted { is_dumb: true, ..always }, true)), ((true, false), (true, false)));
        assert_eq!(on(Wanted { never: true, ..always }, true), (false, false), "NO_COLOR wins");
        assert_eq!(plain.on(true, false), Colour { on_stdout: true, on_stderr: false, is_animated: false });
    }
}
