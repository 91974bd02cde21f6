//! Builders and optimisers by name, as on the command line: `lbvh`, `aac:fast`, `aac:delta=8,epsilon=0.15`.

use super::{Initial, Optimizer, ParameterError, SettingError};
use crate::build::{Bins, DEFAULT_HPLOC_RADIUS, DEFAULT_PASSES, DEFAULT_RADIUS, TreeletSize};
use crate::optimize::{RbvhSettings, RotationSettings};
use std::fmt::{self, Display};

impl Initial {
    /// The names of [`Initial::of_name`], with commas between.
    pub const NAMES: &str = "lbvh, ploc, atrbvh, trbvh, hploc, sah-sweep, sah-binned, sbvh, agglomerative, aac, kmeans, insertion, online, hunt, phr";

    /// A builder by its name; none if it is no such name. `aac` (`:fast`, `:hq`), `kmeans` (`:q1` to `:q5`), `insertion` (`:greedy`), `online`, `hunt` and `phr`
    /// (`:fast`, `:hq`) may have a colon and a preset or `parameter=value` with commas between. What is not said is as by default.
    ///
    /// ```
    /// use prbvh::Initial;
    ///
    /// let initial = Initial::of_name("kmeans:k=16,p=5,i=5").unwrap()?;
    /// assert_eq!(initial.to_string(), "kmeans:q3");
    /// assert!(Initial::of_name("aac:delta=0").unwrap().is_err() && Initial::of_name("random").is_none());
    /// # Ok::<(), prbvh::settings::ParameterError>(())
    /// ```
    ///
    /// # Errors
    /// Inside, if the parameters are none of the builder's, or make no sense.
    #[must_use]
    pub fn of_name(text: &str) -> Option<Result<Self, ParameterError>> {
        let (name, parameters) = text.split_once(':').unwrap_or((text, ""));
        Some(match name {
            "aac" => parameters.parse().map(|aac| Self::Aac { aac }),
            "kmeans" => parameters.parse().map(|kmeans| Self::KMeans { kmeans }),
            "insertion" => parameters.parse().map(|insertion| Self::Insertion { insertion }),
            "online" => parameters.parse().map(|online| Self::Online { online }),
            "hunt" => parameters.parse().map(|hunt| Self::Hunt { hunt }),
            "phr" => parameters.parse().map(|phr| Self::Phr { phr }),
            _ => {
                let plain = Self::without_parameters(name)?;
                let unknown = || ParameterError::Unknown { text: parameters.to_owned(), known: "none" };
                if parameters.is_empty() { Ok(plain) } else { Err(unknown()) }
            }
        })
    }

    fn without_parameters(name: &str) -> Option<Self> {
        Some(match name {
            "lbvh" => Self::Lbvh,
            "ploc" => Self::Ploc { radius: DEFAULT_RADIUS },
            "atrbvh" => Self::Atrbvh { treelet: TreeletSize::DEFAULT },
            "trbvh" => Self::Trbvh { passes: DEFAULT_PASSES },
            "hploc" => Self::Hploc { radius: DEFAULT_HPLOC_RADIUS },
            "sah-sweep" => Self::SahSweep,
            "sah-binned" => Self::SahBinned { bins: Bins::DEFAULT },
            "sbvh" => Self::Sbvh,
            "agglomerative" => Self::Agglomerative,
            _ => return None,
        })
    }

    /// Whether the parameters make sense.
    ///
    /// # Errors
    /// The first that makes none.
    pub fn check_parameters(&self) -> Result<(), SettingError> {
        match self {
            Self::Aac { aac } => aac.check(),
            Self::KMeans { kmeans } => kmeans.check(),
            Self::Insertion { insertion } => insertion.check(),
            Self::Online { online } => online.check(),
            Self::Hunt { hunt } => hunt.check(),
            Self::Phr { phr } => phr.check(),
            _ => Ok(()),
        }
    }
}

impl Optimizer {
    /// The names of [`Optimizer::of_name`], with commas between.
    pub const NAMES: &str = "prbvh, rbvh, rotations, none";

    /// An optimiser by its name, with its settings by default; none if it is no such name.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Some(match name {
            "prbvh" => Self::Prbvh,
            "rbvh" => Self::Rbvh(RbvhSettings::default()),
            "rotations" => Self::Rotations(RotationSettings::default()),
            "none" => Self::None,
            _ => return None,
        })
    }
}

/// A name, and its parameters if it has any that are not understood.
pub(super) fn write(f: &mut fmt::Formatter<'_>, name: &str, parameters: &impl Display) -> fmt::Result {
    let parameters = parameters.to_string();
    if parameters.is_empty() { f.write_str(name) } else { write!(f, "{name}:{parameters}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::{AacSettings, HuntSettings, KMeansSettings, PhrSettings};
    use crate::optimize::{InsertionSettings, OnlineSettings};

    fn named(text: &str) -> Result<Initial, String> {
        Initial::of_name(text).expect(text).map_err(|error| error.to_string())
    }

    #[test]
    fn names_are_read_as_they_are_written() {
        let cases = [
            ("agglomerative", Initial::Agglomerative),
            ("aac:fast", Initial::Aac { aac: AacSettings::FAST }),
            ("aac:hq", Initial::Aac { aac: AacSettings::default() }),
            ("aac:delta=9,epsilon=0.25", Initial::Aac { aac: AacSettings { delta: 9, epsilon: 0.25 } }),
            ("kmeans:q1", Initial::KMeans { kmeans: KMeansSettings::Q1 }),
            ("kmeans:q5", Initial::KMeans { kmeans: KMeansSettings::Q5 }),
            ("kmeans:k=2,p=1,i=0,seed=7", Initial::KMeans { kmeans: KMeansSettings { k: 2, p: 1, i: 0, seed: 7 } }),
            ("insertion", Initial::Insertion { insertion: InsertionSettings::default() }),
            ("insertion:greedy", Initial::Insertion { insertion: InsertionSettings::GREEDY }),
            ("online", Initial::Online { online: OnlineSettings::default() }),
            ("hunt", Initial::Hunt { hunt: HuntSettings::default() }),
            ("hunt:cut=50", Initial::Hunt { hunt: HuntSettings { cut: 50 } }),
            ("phr:fast", Initial::Phr { phr: PhrSettings::FAST }),
            ("phr:hq", Initial::Phr { phr: PhrSettings::default() }),
        ];
        for (name, initial) in cases {
            assert_eq!(named(name).as_ref(), Ok(&initial), "{name}");
            assert_eq!(initial.to_string(), name);
            let first = name.split(':').next().unwrap();
            assert!(Initial::NAMES.split(", ").any(|known| known == first), "{name}");
        }
        for name in Initial::NAMES.split(", ") {
            let initial = named(name).unwrap();
            assert_eq!(initial.to_string().split(':').next(), Some(name));
        }
        assert_eq!(named("aac"), named("aac:hq"));
        assert_eq!(named("online:seed=3").unwrap().to_string(), "online:batch=0.25,worst=0.05,most_steps=1024,seed=3");
        assert!(Initial::of_name("tree").is_none() && Initial::of_name("aac.bvh").is_none());
        for name in Optimizer::NAMES.split(", ") {
            assert_eq!(Optimizer::of_name(name).unwrap().to_string(), name);
        }
        assert!(Optimizer::of_name("PRBVH").is_none());
    }

    #[test]
    fn what_are_no_parameters_is_told() {
        for (text, part) in [
            ("aac:slow", "`slow` is neither a preset nor `name=value`: there are fast, hq, delta=N, epsilon=E"),
            ("aac:fast,delta=3", "`fast` is neither"),
            ("aac:delta=many", "delta=many: invalid digit"),
            ("aac:delta=1", "aac.delta is 1, but must be 2 to 65536"),
            ("aac:epsilon=NaN", "aac.epsilon is NaN, but must be 0 to 0.5"),
            ("kmeans:k=65", "kmeans.k is 65, but must be 2 to 64"),
            ("kmeans:p=0", "kmeans.p is 0, but must be 1 to 30"),
            ("kmeans:i=201", "kmeans.i is 201, but must be 200 or less"),
            ("kmeans:q6", "q1, q2, q3, q4, q5, k=N"),
            ("online:batch=0", "online.batch is 0, but must be a finite number above 0"),
            ("online:worst=1.5", "online.worst is 1.5, but must be above 0 and at most 1"),
            ("insertion:seed=-1", "seed=-1: invalid digit"),
            ("hunt:cut=1", "hunt.cut is 1, but must be 2 to 65536"),
            ("phr:alpha=inf", "phr.alpha is inf, but must be 0 to 8"),
            ("phr:delta=-1", "phr.delta is -1, but must be 0 to 64"),
            ("agglomerative:fast", "there are none"),
            ("lbvh:bits=30", "`bits=30` is neither a preset nor `name=value`: there are none"),
        ] {
            let error = named(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
