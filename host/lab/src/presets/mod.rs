//! Presets: settings that were chosen by measurement, and the rule that chose them.
//!
//! [`CANDIDATES`] is the one table: what was tried, and which of it each preset is. [`choose`] repeats the choice on any comparison of
//! `prbvh compare --methods candidates`.

mod choice;

pub use choice::{BALANCED_ERROR, BEST_ERROR, ChoiceError, Choices, FAST_ERROR, Score, Trial, choose};

use prbvh::build::{DEFAULT_RADIUS, TreeletSize};
use prbvh::optimize::{Epsilon, Order, PrbvhSettings, RbvhSettings, WorstFirst};
use prbvh::pipeline::{Initial, Optimizer, Settings};
use std::fmt;

/// What a user wants most.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// A tree soon.
    Fast,
    /// Most of what can be gained, in a part of the time.
    Balanced,
    /// The lowest cost, as long as it takes.
    Best,
}

impl Preset {
    /// All, the fastest first.
    pub const ALL: [Self; 3] = [Self::Fast, Self::Balanced, Self::Best];

    /// Its row of [`CANDIDATES`]; none only if no row has it.
    #[must_use]
    pub fn candidate(self) -> Option<&'static Candidate> {
        CANDIDATES.iter().find(|candidate| candidate.preset == Some(self))
    }
}

/// As on the command line.
impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Fast => "fast",
            Self::Balanced => "balanced",
            Self::Best => "best",
        })
    }
}

/// Initial tree of a candidate, with its default setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum From {
    /// LBVH.
    Lbvh,
    /// PLOC.
    Ploc,
    /// ATRBVH.
    Atrbvh,
}

/// Optimiser of a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Then {
    /// None.
    Nothing,
    /// PRBVH as published.
    Published {
        /// First µ.
        mu: u32,
        /// ε as a part of the initial cost.
        epsilon: f64,
    },
    /// PRBVH, the worst nodes first.
    WorstFirst {
        /// Most nodes of a round, as a part of all.
        most_part: f64,
        /// The same of the tail; 0 without one, and without new tops.
        tail_part: f64,
    },
    /// RBVH with undo, as it is by default.
    Rbvh,
}

impl Then {
    const fn published(mu: u32, epsilon: f64) -> Self {
        Self::Published { mu, epsilon }
    }

    const fn worst_first(most_part: f64, tail_part: f64) -> Self {
        Self::WorstFirst { most_part, tail_part }
    }
}

/// Settings that were tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Initial tree.
    pub from: From,
    /// Optimiser.
    pub then: Then,
    /// The preset that it is.
    pub preset: Option<Preset>,
}

const fn tried(from: From, then: Then) -> Candidate {
    Candidate { from, then, preset: None }
}

const fn chosen(preset: Preset, from: From, then: Then) -> Candidate {
    Candidate { from, then, preset: Some(preset) }
}

/// What was tried, and what each preset is. `cargo xtask presets` says whether given comparisons choose the same.
pub const CANDIDATES: &[Candidate] = &[
    tried(From::Lbvh, Then::Nothing),
    tried(From::Ploc, Then::Nothing),
    chosen(Preset::Fast, From::Atrbvh, Then::Nothing),
    tried(From::Lbvh, Then::published(9, 1e-3)),
    tried(From::Lbvh, Then::published(9, 1e-4)),
    tried(From::Ploc, Then::published(9, 1e-3)),
    tried(From::Ploc, Then::published(9, 1e-4)),
    tried(From::Atrbvh, Then::published(9, 1e-3)),
    tried(From::Atrbvh, Then::published(9, 1e-4)),
    tried(From::Atrbvh, Then::published(1, 1e-5)),
    chosen(Preset::Balanced, From::Lbvh, Then::worst_first(0.02, 0.0)),
    chosen(Preset::Best, From::Lbvh, Then::worst_first(0.02, 0.05)),
    tried(From::Ploc, Then::worst_first(0.02, 0.0)),
    tried(From::Atrbvh, Then::worst_first(0.02, 0.0)),
    tried(From::Ploc, Then::worst_first(0.02, 0.05)),
    tried(From::Atrbvh, Then::worst_first(0.02, 0.05)),
    tried(From::Atrbvh, Then::Rbvh),
];

impl Candidate {
    /// The settings, all else as by default.
    #[must_use]
    pub fn settings(&self) -> Settings {
        let initial = match self.from {
            From::Lbvh => Initial::Lbvh,
            From::Ploc => Initial::Ploc { radius: DEFAULT_RADIUS },
            From::Atrbvh => Initial::Atrbvh { treelet: TreeletSize::default() },
        };
        let (optimizer, prbvh) = match self.then {
            Then::Nothing => (Optimizer::None, PrbvhSettings::default()),
            Then::Rbvh => (Optimizer::Rbvh(RbvhSettings::default()), PrbvhSettings::default()),
            Then::Published { mu, epsilon } => {
                let epsilon = Epsilon::Relative(epsilon);
                (
                    Optimizer::Prbvh,
                    PrbvhSettings::published().with(|s| {
                        s.mu = mu;
                        s.epsilon = epsilon;
                    }),
                )
            }
            Then::WorstFirst { most_part, tail_part } => {
                let usual = WorstFirst::default();
                let top = if tail_part > 0.0 { usual.top } else { 0 };
                let worst_first = usual.with(|s| {
                    s.most_part = most_part;
                    s.tail_part = tail_part;
                    s.top = top;
                });
                (
                    Optimizer::Prbvh,
                    PrbvhSettings::default().with(|s| {
                        s.order = Order::WorstFirst;
                        s.worst_first = worst_first;
                    }),
                )
            }
        };
        Settings::default().with(|s| {
            s.initial = initial;
            s.optimizer = optimizer;
            s.prbvh = prbvh;
        })
    }
}

/// Its name in a comparison: `ploc, prbvh µ=9 ε=0.001`.
impl fmt::Display for Candidate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.settings().initial)?;
        match self.then {
            Then::Nothing => Ok(()),
            Then::Published { mu, epsilon } => write!(f, ", published µ={mu} ε={epsilon}"),
            Then::WorstFirst { most_part, tail_part } => {
                write!(f, ", worst first p={most_part}")?;
                if tail_part > 0.0 { write!(f, " tail={tail_part}") } else { Ok(()) }
            }
            Then::Rbvh => f.write_str(", rbvh undo"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_is_one_row_and_rows_differ() {
        for preset in Preset::ALL {
            let rows = CANDIDATES.iter().filter(|candidate| candidate.preset == Some(preset));
            assert_eq!(rows.count(), 1, "{preset}");
        }
        let names: Vec<String> = CANDIDATES.iter().map(ToString::to_string).collect();
        assert!(names.iter().enumerate().all(|(k, name)| !names[..k].contains(name)), "{names:?}");
    }

    #[test]
    fn settings_are_what_the_row_says() {
        let candidate = tried(From::Ploc, Then::published(4, 0.25));
        assert_eq!(candidate.to_string(), "ploc, published µ=4 ε=0.25");
        let settings = candidate.settings();
        assert_eq!(settings.initial, Initial::Ploc { radius: DEFAULT_RADIUS });
        assert_eq!((settings.optimizer, settings.prbvh.mu), (Optimizer::Prbvh, 4));
        assert_eq!(settings.prbvh.epsilon, Epsilon::Relative(0.25));
        let settings = tried(From::Lbvh, Then::Rbvh).settings();
        assert_eq!(settings.optimizer, Optimizer::Rbvh(RbvhSettings::default()));
    }
}
