//! The methods of the table.

use prbvh::build::{Bins, DEFAULT_HPLOC_RADIUS, DEFAULT_RADIUS};
#[cfg(feature = "atrbvh")]
use prbvh::build::{DEFAULT_PASSES, TreeletSize};
use prbvh::bvh::MaxDepth;
use prbvh::collapse::CollapseSettings;
use prbvh::optimize::{Limits, Order, PrbvhSettings, RbvhSettings, RotationSettings, Strategy};
use prbvh::pipeline::{Initial, Optimizer, Settings};
use prbvh::presplit::PresplitSettings;
use prbvh::wide::{Layout, WideSettings, Width};

/// A way from triangles to a tree.
#[derive(Clone, Debug)]
pub struct Method {
    /// Name, for `--methods`.
    pub name: &'static str,
    /// What the pipeline is to do.
    pub settings: Settings,
    /// Whether it goes on from its initial tree; else no iteration is made, and none is missed.
    pub optimizes: bool,
}

impl Method {
    fn builder(name: &'static str, initial: Initial) -> Self {
        let none = PrbvhSettings::default().with(|s| s.limits = Limits::iterations(0));
        Self { optimizes: false, ..Self::prbvh(name, initial, none) }
    }

    /// A builder by [`Initial::of_name`].
    fn named(name: &'static str) -> Self {
        Self::builder(name, Initial::of_name(name).expect("a builder").expect("its parameters"))
    }

    fn published(name: &'static str, initial: Initial, mu: u32) -> Self {
        Self::prbvh(name, initial, PrbvhSettings::published().with(|s| s.mu = mu))
    }

    fn worst_first(name: &'static str, initial: Initial) -> Self {
        Self::prbvh(name, initial, PrbvhSettings::default().with(|s| s.order = Order::WorstFirst))
    }

    fn prbvh(name: &'static str, initial: Initial, prbvh: PrbvhSettings) -> Self {
        let settings = unbounded().with(|s| {
            s.initial = initial;
            s.prbvh = prbvh;
        });
        Self { name, settings, optimizes: true }
    }

    fn rbvh(name: &'static str) -> Self {
        let optimizer = Optimizer::Rbvh(RbvhSettings::default());
        Self { name, settings: unbounded().with(|s| s.optimizer = optimizer), optimizes: true }
    }

    fn rotations(name: &'static str, annealing_passes: u32) -> Self {
        let settings = RotationSettings::default().with(|s| s.annealing_passes = annealing_passes);
        let optimizer = Optimizer::Rotations(settings);
        Self { name, settings: unbounded().with(|s| s.optimizer = optimizer), optimizes: true }
    }

    fn conservative(mut self) -> Self {
        self.settings.prbvh.strategy = Strategy::Conservative;
        self
    }

    /// Whether it is PRBVH that goes on from the initial tree, to one triangle per leaf, each of them whole, and nothing comes after it: then its moves can be
    /// looked at.
    #[must_use]
    pub fn has_moves(&self) -> bool {
        let Settings { optimizer, adaptive, max_depth, .. } = &self.settings;
        !self.settings.splits()
            && self.optimizes
            && *optimizer == Optimizer::Prbvh
            && adaptive.is_none()
            && *max_depth == MaxDepth::OFF
    }

    fn with_adaptive_leaves(mut self) -> Self {
        self.settings.adaptive = Some(CollapseSettings::default());
        self
    }

    fn with_wide_nodes(mut self, width: Width, layout: Layout) -> Self {
        self.settings.wide = Some(WideSettings::default().with(|s| {
            s.width = width;
            s.layout = layout;
        }));
        self
    }

    fn with_splits(mut self) -> Self {
        self.settings.presplit = Some(PresplitSettings::default());
        self
    }

    fn with_bounded_depth(mut self) -> Self {
        self.settings.max_depth = MaxDepth::default();
        self
    }
}

/// Trees as deep as they become: what is to be stable is what makes them, and rays through trees of any depth.
fn unbounded() -> Settings {
    Settings::default().with(|s| s.max_depth = MaxDepth::OFF)
}

/// All methods, in the order of the table. A new builder, strategy or optimiser gets its row here and nowhere else.
#[must_use]
pub fn methods() -> Vec<Method> {
    let ploc = || Initial::Ploc { radius: DEFAULT_RADIUS };
    vec![
        Method::builder("lbvh", Initial::Lbvh),
        #[cfg(feature = "atrbvh")]
        Method::builder("atrbvh", Initial::Atrbvh { treelet: TreeletSize::DEFAULT }),
        #[cfg(feature = "atrbvh")]
        Method::builder("trbvh", Initial::Trbvh { passes: DEFAULT_PASSES }),
        Method::builder("hploc", Initial::Hploc { radius: DEFAULT_HPLOC_RADIUS }),
        Method::builder("ploc", ploc()),
        Method::builder("sah-sweep", Initial::SahSweep),
        Method::builder("sah-binned", Initial::SahBinned { bins: Bins::DEFAULT }),
        Method::named("agglomerative"),
        Method::named("aac:fast"),
        Method::named("kmeans:q2"),
        Method::named("insertion:greedy"),
        Method::named("insertion"),
        Method::named("online"),
        Method::named("hunt"),
        Method::named("phr:fast"),
        Method::worst_first("worst-first", Initial::Lbvh),
        Method::published("prbvh-9", Initial::Lbvh, 9),
        Method::published("prbvh-1", Initial::Lbvh, 1),
        Method::published("conservative-9", Initial::Lbvh, 9).conservative(),
        Method::rbvh("rbvh"),
        Method::rotations("rotations", 0),
        Method::rotations("rotations-annealed", 10),
        Method::worst_first("ploc+worst-first", ploc()),
        Method::published("ploc+prbvh-9", ploc(), 9),
        Method::published("ploc+prbvh-1", ploc(), 1),
        Method::worst_first("worst-first+adaptive", Initial::Lbvh).with_adaptive_leaves(),
        Method::worst_first("ploc+worst-first+bounded", ploc()).with_bounded_depth(),
        Method::builder("lbvh+bvh4", Initial::Lbvh).with_wide_nodes(Width::Four, Layout::Soa),
        Method::builder("lbvh+bvh8", Initial::Lbvh).with_wide_nodes(Width::Eight, Layout::Soa),
        Method::worst_first("worst-first+cwbvh", Initial::Lbvh).with_wide_nodes(Width::Eight, Layout::Cwbvh),
        Method::worst_first("presplit+worst-first+adaptive", Initial::Lbvh).with_splits().with_adaptive_leaves(),
        Method::worst_first("sbvh+worst-first", Initial::Sbvh),
    ]
}
