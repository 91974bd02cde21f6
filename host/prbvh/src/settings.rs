//! What a run is asked for: initial tree, optimiser, leaves.

mod named;

use crate::build::{AacSettings, HuntSettings, KMeansSettings, PhrSettings};
use crate::build::{Bins, MortonBits, SbvhSettings, TreeletSize};
use crate::bvh::{Bvh, MaxDepth};
pub use crate::check::{FeatureOff, SettingError};
use crate::collapse::CollapseSettings;
pub use crate::given::GivenTree;
use crate::optimize::{InsertionSettings, OnlineSettings};
use crate::optimize::{IterationRow, Limits, PrbvhSettings, RbvhSettings, RotationSettings, WorstFirst};
pub use crate::parameters::ParameterError;
use crate::presplit::PresplitSettings;
use crate::wide::WideSettings;
use std::fmt;
use std::num::NonZeroU32;
#[cfg(feature = "files")]
use std::path::PathBuf;
use std::sync::Arc;

impl From<Arc<Bvh>> for Initial {
    fn from(tree: Arc<Bvh>) -> Self {
        Self::Tree(GivenTree(tree))
    }
}

impl From<Bvh> for Initial {
    fn from(tree: Bvh) -> Self {
        Arc::new(tree).into()
    }
}

/// Where the initial tree comes from.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(tag = "initial", rename_all = "kebab-case")
)]
#[non_exhaustive]
pub enum Initial {
    /// LBVH (Karras 2012), on the device.
    #[default]
    Lbvh,
    /// PLOC (Meister & Bittner 2017), on the device.
    Ploc {
        /// Places in the Morton order that a cluster looks to either side for its nearest neighbour.
        radius: NonZeroU32,
    },
    /// ATRBVH (Domingues & Pedrini 2015), on the device; only with the cargo feature `atrbvh`.
    Atrbvh {
        /// Leaves of a treelet.
        treelet: TreeletSize,
    },
    /// TRBVH (Karras & Aila 2013), on the device; only with the cargo feature `atrbvh`.
    Trbvh {
        /// Most passes over the treelets, each over about half as many as the one before.
        passes: NonZeroU32,
    },
    /// H-PLOC (Benthin et al. 2024), on the device.
    Hploc {
        /// Places in the list of a range that a cluster looks to either side for its nearest neighbour; from 31 on all of it.
        radius: NonZeroU32,
    },
    /// Full-sweep SAH, on the CPU.
    SahSweep,
    /// Binned SAH (Wald 2007), on the CPU.
    SahBinned {
        /// Bins of an axis.
        #[cfg_attr(feature = "serde", serde(default))]
        bins: Bins,
    },
    /// Exact agglomerative clustering (Walter et al. 2008), on one thread of the CPU; of up to [`MOST_AGGLOMERATED`](crate::build::MOST_AGGLOMERATED)
    /// references.
    Agglomerative,
    /// Approximate agglomerative clustering (Gu et al. 2013), on the CPU.
    Aac {
        /// Its settings.
        aac: AacSettings,
    },
    /// k-means (Meister & Bittner 2016), on the device.
    #[cfg_attr(feature = "serde", serde(rename = "kmeans"))]
    KMeans {
        /// Its settings.
        kmeans: KMeansSettings,
    },
    /// Insertion (Goldsmith & Salmon 1987, and with branch and bound), on one thread of the CPU.
    Insertion {
        /// Its settings.
        insertion: InsertionSettings,
    },
    /// Online construction (Bittner, Hapala & Havran 2015), on one thread of the CPU.
    Online {
        /// Its settings.
        online: OnlineSettings,
    },
    /// Sweeps over cuts of a constant size (Hunt, Mark & Fussell 2007), on the CPU.
    Hunt {
        /// Its settings.
        hunt: HuntSettings,
    },
    /// Progressive hierarchical refinement (Hendrich, Meister & Bittner 2017), on the CPU.
    Phr {
        /// Its settings.
        phr: PhrSettings,
    },
    /// SBVH (Stich, Friedrich & Dietrich 2009) with [`Settings::sbvh`], on the CPU: a triangle may be in several leaves.
    Sbvh,
    /// A tree over the same scene that is in memory, from [`Initial::from`]. Leaves may hold any number of primitives, and a primitive may be in several
    /// leaves (spatial splits). Each primitive of a leaf becomes a leaf of its own; [`Settings::adaptive`] makes larger ones again.
    /// [`optimize_tree`](crate::pipeline::optimize_tree) keeps the leaves, or needs no scene.
    #[cfg_attr(feature = "serde", serde(skip_deserializing))]
    Tree(GivenTree),
    /// A `tree.bvh` over the same scene with one triangle per leaf; only with the cargo feature `files`.
    #[cfg(feature = "files")]
    File {
        /// Where it is.
        #[cfg_attr(feature = "serde", serde(serialize_with = "crate::written::path"))]
        path: PathBuf,
    },
}

impl Initial {
    /// Whether it is built from Morton codes.
    pub(crate) fn has_codes(&self) -> bool {
        matches!(
            self,
            Self::Lbvh
                | Self::Ploc { .. }
                | Self::Atrbvh { .. }
                | Self::Trbvh { .. }
                | Self::Hploc { .. }
                | Self::KMeans { .. }
        )
    }

    /// As on the command line, but no path.
    pub(crate) fn method(&self) -> String {
        match self {
            #[cfg(feature = "files")]
            Self::File { .. } => "tree file".to_owned(),
            _ => self.to_string(),
        }
    }

    /// Whether it is there already, over all triangles.
    pub(crate) fn is_given(&self) -> bool {
        match self {
            Self::Tree(_) => true,
            #[cfg(feature = "files")]
            Self::File { .. } => true,
            _ => false,
        }
    }

    /// Whether this program has the builder.
    ///
    /// # Errors
    /// If a cargo feature left it out.
    pub fn check(&self) -> Result<(), FeatureOff> {
        match self {
            Self::Atrbvh { .. } if !cfg!(feature = "atrbvh") => Err(FeatureOff { method: "atrbvh", feature: "atrbvh" }),
            Self::Trbvh { .. } if !cfg!(feature = "atrbvh") => Err(FeatureOff { method: "trbvh", feature: "atrbvh" }),
            _ => Ok(()),
        }
    }
}

/// As on the command line: `lbvh`, `ploc`, `atrbvh`, `trbvh`, `hploc`, `sah-sweep`, `sah-binned`, `sbvh`, a name of [`Initial::of_name`], or the path of the file; `tree`
/// if it is in memory.
impl fmt::Display for Initial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lbvh => f.write_str("lbvh"),
            Self::Ploc { .. } => f.write_str("ploc"),
            Self::Atrbvh { .. } => f.write_str("atrbvh"),
            Self::Trbvh { .. } => f.write_str("trbvh"),
            Self::Hploc { .. } => f.write_str("hploc"),
            Self::SahSweep => f.write_str("sah-sweep"),
            Self::SahBinned { .. } => f.write_str("sah-binned"),
            Self::Agglomerative => f.write_str("agglomerative"),
            Self::Aac { aac } => named::write(f, "aac", aac),
            Self::KMeans { kmeans } => named::write(f, "kmeans", kmeans),
            Self::Insertion { insertion } => named::write(f, "insertion", insertion),
            Self::Online { online } => named::write(f, "online", online),
            Self::Hunt { hunt } => named::write(f, "hunt", hunt),
            Self::Phr { phr } => named::write(f, "phr", phr),
            Self::Sbvh => f.write_str("sbvh"),
            Self::Tree(_) => f.write_str("tree"),
            #[cfg(feature = "files")]
            Self::File { path } => path.display().fmt(f),
        }
    }
}

/// What makes the initial tree better.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(from = "written::Written", into = "written::Written")
)]
#[non_exhaustive]
pub enum Optimizer {
    /// PRBVH (Meister & Bittner 2018) with [`Settings::prbvh`], on the device.
    #[default]
    Prbvh,
    /// RBVH (Bittner, Hapala & Havran 2013), on one thread of the host.
    Rbvh(RbvhSettings),
    /// Rotations (Kensler 2008), on the device.
    Rotations(RotationSettings),
    /// Nothing: the initial tree is handed out.
    None,
}

/// As on the command line.
impl fmt::Display for Optimizer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Prbvh => "prbvh",
            Self::Rbvh(_) => "rbvh",
            Self::Rotations(_) => "rotations",
            Self::None => "none",
        })
    }
}

/// Settings of a run: the defaults, and what you set of them.
///
/// ```
/// use prbvh::pipeline::{Initial, Settings};
/// use std::time::Duration;
///
/// let mut settings = Settings::default();
/// settings.initial = Initial::SahSweep;
/// settings.limits_mut().max_time = Some(Duration::from_secs(2));
/// // The same in an expression:
/// let same = Settings::default().with(|settings| {
///     settings.initial = Initial::SahSweep;
///     settings.limits_mut().max_time = Some(Duration::from_secs(2));
/// });
/// assert_eq!(settings, same);
/// ```
/// With the cargo feature `serde` they are one object of plain keys, which reports have as it is.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default))]
#[non_exhaustive]
pub struct Settings {
    /// Where the initial tree comes from.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub initial: Initial,
    /// Length of the Morton codes.
    pub morton_bits: MortonBits,
    /// What is split before the tree is built; none: every triangle is one reference. Not for trees that are there already, nor for [`Initial::Sbvh`], nor
    /// with [`Settings::fold_duplicates`].
    pub presplit: Option<PresplitSettings>,
    /// Settings of [`Initial::Sbvh`].
    pub sbvh: SbvhSettings,
    /// The optimiser.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub optimizer: Optimizer,
    /// Settings of [`Optimizer::Prbvh`].
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub prbvh: PrbvhSettings,
    /// Adaptive leaves after the optimisation; none: one triangle per leaf.
    pub adaptive: Option<CollapseSettings>,
    /// Triangles of equal boxes are one reference while the tree is built and optimised: faster, another tree of about the same cost. Not
    /// for trees that nothing optimises or that come from a file.
    pub fold_duplicates: bool,
    /// Most links between the root and a leaf of the tree handed out, counted with one triangle per leaf: adaptive leaves, which come after
    /// it, only make it shallower.
    pub max_depth: MaxDepth,
    /// A wide tree made of the tree handed out, beside it; none: no wide tree. Its leaves are of its own choice where those of the tree are single.
    pub wide: Option<WideSettings>,
}

impl Settings {
    /// Whether every value makes sense, also of what [`Settings::optimizer`] does not look at.
    ///
    /// # Errors
    /// The first field whose value makes no sense.
    pub fn check(&self) -> Result<(), SettingError> {
        self.initial.check_parameters()?;
        self.prbvh.check()?;
        self.sbvh.check()?;
        if let Some(presplit) = &self.presplit {
            presplit.check()?;
        }
        self.check_splits()?;
        match &self.optimizer {
            Optimizer::Rbvh(settings) => settings.check()?,
            Optimizer::Rotations(settings) => settings.check()?,
            Optimizer::Prbvh | Optimizer::None => {}
        }
        self.wide.as_ref().map_or(Ok(()), WideSettings::check)?;
        self.adaptive.as_ref().map_or(Ok(()), CollapseSettings::check)
    }

    /// Whether triangles are asked to be split.
    #[must_use]
    pub fn splits(&self) -> bool {
        self.presplit.is_some() || self.initial == Initial::Sbvh
    }

    /// Refuses what is not done together with splits.
    fn check_splits(&self) -> Result<(), SettingError> {
        if self.presplit.is_some() && (self.initial.is_given() || self.initial == Initial::Sbvh) {
            let need = "none with a tree that is given, or that has splits of its own";
            return Err(SettingError { name: "presplit", value: "given".to_owned(), need });
        }
        if self.splits() && self.fold_duplicates {
            let need = "false with presplit and with the initial tree sbvh";
            return Err(SettingError { name: "fold_duplicates", value: "true".to_owned(), need });
        }
        Ok(())
    }

    /// What ends the optimiser early. Where there is none, the limits of [`Settings::prbvh`], which then end nothing.
    #[must_use]
    pub fn limits(&self) -> &Limits {
        match &self.optimizer {
            Optimizer::Rbvh(settings) => &settings.limits,
            Optimizer::Rotations(settings) => &settings.limits,
            Optimizer::Prbvh | Optimizer::None => &self.prbvh.limits,
        }
    }

    /// As [`Settings::limits`].
    pub fn limits_mut(&mut self) -> &mut Limits {
        match &mut self.optimizer {
            Optimizer::Rbvh(settings) => &mut settings.limits,
            Optimizer::Rotations(settings) => &mut settings.limits,
            Optimizer::Prbvh | Optimizer::None => &mut self.prbvh.limits,
        }
    }
}

/// What may grow is no literal outside of this library.
macro_rules! with {
    ($($settings:ty),+) => {$(
        impl $settings {
            /// The same after `change`, which sets fields: what a literal with a `..` would be.
            #[must_use]
            pub fn with(mut self, change: impl FnOnce(&mut Self)) -> Self {
                change(&mut self);
                self
            }
        }
    )+};
}

with!(
    Settings,
    PrbvhSettings,
    WorstFirst,
    RbvhSettings,
    RotationSettings,
    Limits,
    CollapseSettings,
    IterationRow,
    WideSettings
);
with!(AacSettings, KMeansSettings, InsertionSettings, OnlineSettings, HuntSettings, PhrSettings);
with!(PresplitSettings, SbvhSettings);
#[cfg(feature = "files")]
with!(crate::scene::LoadOptions);

#[cfg(test)]
mod tests;
#[cfg(feature = "serde")]
mod written;
#[cfg(all(test, feature = "files", feature = "serde"))]
mod written_tests;
