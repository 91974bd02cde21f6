//! The arguments that ask for a wide tree.

use anyhow::ensure;
use clap::{Args, ValueEnum};
use prbvh::wide::{CollapseMethod, Layout, WideSettings, Width};

/// The nodes of the tree that rays go through.
#[derive(Clone, Debug, Args)]
pub(super) struct WideArgs {
    /// Most children of a node [default: 2, but 8 with --layout cwbvh].
    #[arg(long, value_enum)]
    pub(super) width: Option<WidthArg>,
    /// How wide nodes lie in memory [default: soa].
    #[arg(long, value_enum)]
    pub(super) layout: Option<LayoutArg>,
    /// How the children of wide nodes are chosen [default: optimal].
    #[arg(long, value_enum)]
    pub(super) wide_collapse: Option<WideCollapseArg>,
    /// Move subtrees of the binary tree to where the wide tree costs less, below the ancestor so many levels above their parent, 0 to 4 [default: 0].
    #[arg(long, value_name = "LEVELS")]
    pub(super) wide_reach: Option<u32>,
}

impl WideArgs {
    /// None for nodes of two.
    ///
    /// # Errors
    /// If two arguments contradict each other.
    pub(super) fn settings(&self) -> anyhow::Result<Option<WideSettings>> {
        let usual = if self.layout == Some(LayoutArg::Cwbvh) { WidthArg::Eight } else { WidthArg::Two };
        let width = match self.width.unwrap_or(usual) {
            WidthArg::Two => {
                ensure!(self.layout.is_none(), "--layout is for --width 4 and 8");
                ensure!(self.wide_collapse.is_none(), "--wide-collapse is for --width 4 and 8");
                ensure!(self.wide_reach.is_none(), "--wide-reach is for --width 4 and 8");
                return Ok(None);
            }
            WidthArg::Four => Width::Four,
            WidthArg::Eight => Width::Eight,
        };
        let settings = WideSettings::default().with(|settings| {
            settings.width = width;
            settings.layout = match self.layout {
                Some(LayoutArg::Cwbvh) => Layout::Cwbvh,
                Some(LayoutArg::Soa) | None => Layout::Soa,
            };
            settings.method = match self.wide_collapse {
                Some(WideCollapseArg::Greedy) => CollapseMethod::Greedy,
                Some(WideCollapseArg::Optimal) | None => CollapseMethod::Optimal,
            };
        });
        let settings = settings.with(|settings| settings.reach = self.wide_reach.unwrap_or(settings.reach));
        settings.check()?;
        Ok(Some(settings))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum WidthArg {
    #[value(name = "2")]
    Two,
    #[value(name = "4")]
    Four,
    #[value(name = "8")]
    Eight,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum LayoutArg {
    /// Boxes as they are.
    Soa,
    /// Compressed nodes of eight children.
    Cwbvh,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum WideCollapseArg {
    /// The tree of least cost.
    Optimal,
    /// The largest child is opened until the node is full.
    Greedy,
}

#[cfg(test)]
mod tests {
    use super::super::args::settings;
    use super::*;

    #[test]
    fn a_wide_tree_is_asked_for_by_width_or_layout() {
        let wide = |arguments: &str| settings(arguments).map(|settings| settings.wide);
        let of = |width, layout, method| {
            Ok(Some(WideSettings::default().with(|s| {
                s.width = width;
                s.layout = layout;
                s.method = method;
            })))
        };
        assert_eq!([wide(""), wide("--width 2")], [Ok(None), Ok(None)]);
        assert_eq!(wide("--width 4"), of(Width::Four, Layout::Soa, CollapseMethod::Optimal));
        assert_eq!(
            wide("--width 8 --layout soa --preset best"),
            of(Width::Eight, Layout::Soa, CollapseMethod::Optimal)
        );
        assert_eq!(
            wide("--layout cwbvh --wide-collapse greedy"),
            of(Width::Eight, Layout::Cwbvh, CollapseMethod::Greedy)
        );
        let reach = wide("--width 8 --wide-reach 2").map(|wide| wide.map(|wide| wide.reach));
        assert_eq!(reach, Ok(Some(2)));
        for (arguments, part) in [
            ("--wide-reach 1", "--wide-reach is for --width 4 and 8"),
            ("--width 4 --wide-reach 5", "wide.reach is 5, but must be from 0 to 4"),
            ("--width 4 --wide-reach 1 --wide-collapse greedy", "0 where the collapse is greedy"),
            ("--width 3", "2, 4, 8"),
            ("--width 4 --layout cwbvh", "8 where the layout is cwbvh"),
            ("--width 2 --layout soa", "--layout is for --width 4 and 8"),
            ("--layout soa", "--layout is for --width 4 and 8"),
            ("--wide-collapse greedy", "--wide-collapse is for --width 4 and 8"),
            ("--layout bvh4", "soa, cwbvh"),
        ] {
            let error = wide(arguments).unwrap_err();
            assert!(error.contains(part), "{arguments}: {error}");
        }
    }
}
