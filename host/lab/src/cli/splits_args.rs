//! The arguments that split triangles.

use clap::{Args, ValueEnum};
use prbvh::pipeline::{Initial, Settings};
use prbvh::presplit::{PresplitForm, PresplitSettings};

/// Splits of triangles.
#[derive(Clone, Debug, Args)]
pub(super) struct SplitsArgs {
    /// Split triangles with large boxes before the initial tree is built, into at most so many more references, as a part of the triangles [default: 0.3].
    #[arg(long, value_name = "BUDGET", num_args = 0..=1, require_equals = true, default_missing_value = USUAL, value_parser = budget)]
    presplit: Option<f64>,
    /// Which triangles are split, and where [default: level].
    #[arg(long, value_enum, requires = "presplit")]
    presplit_form: Option<FormArg>,
    /// Most further references of --initial sbvh, as a part of the triangles [default: 0.3].
    #[arg(long, value_name = "BUDGET", value_parser = budget, allow_negative_numbers = true)]
    sbvh_budget: Option<f64>,
    /// SBVH splits in space where the children of the best object split overlap in more than this part of the root's area [default: 1e-5].
    #[arg(long, value_name = "ALPHA", allow_negative_numbers = true)]
    sbvh_alpha: Option<f64>,
    /// Bins of each axis between which SBVH splits in space, 2 to 256 [default: 32].
    #[arg(long, value_name = "N")]
    sbvh_bins: Option<u32>,
    /// Whether SBVH leaves a reference whole on one side where that costs less [default: true].
    #[arg(long, value_name = "BOOL")]
    sbvh_unsplit: Option<bool>,
}

/// [`PresplitSettings::BUDGET`].
const USUAL: &str = "0.3";

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum FormArg {
    /// Those through which the coarse planes of the scene go.
    Level,
    /// Those of large extents.
    ExtentArea,
    /// As SBVH does.
    Sbvh,
}

impl SplitsArgs {
    /// Sets what the arguments say.
    ///
    /// # Errors
    /// If one is for another initial tree.
    pub(super) fn apply(&self, settings: &mut Settings) -> anyhow::Result<()> {
        settings.presplit = self.presplit.map(|budget| {
            PresplitSettings::default().with(|presplit| {
                presplit.budget = budget;
                presplit.form = match self.presplit_form {
                    None => presplit.form,
                    Some(FormArg::Level) => PresplitForm::Level,
                    Some(FormArg::ExtentArea) => PresplitForm::ExtentArea,
                    Some(FormArg::Sbvh) => PresplitForm::Sbvh,
                };
            })
        });
        if let Some(budget) = self.sbvh_budget {
            let initial = &settings.initial;
            anyhow::ensure!(*initial == Initial::Sbvh, "--sbvh-budget is for --initial sbvh, not for {initial}");
            settings.sbvh.budget = budget;
        }
        let is_asked = self.sbvh_alpha.is_some() || self.sbvh_bins.is_some() || self.sbvh_unsplit.is_some();
        let takes_its_references = settings.presplit.is_some_and(|presplit| presplit.form == PresplitForm::Sbvh);
        anyhow::ensure!(
            !is_asked || settings.initial == Initial::Sbvh || takes_its_references,
            "--sbvh-alpha, --sbvh-bins and --sbvh-unsplit are for --initial sbvh and --presplit-form sbvh"
        );
        let sbvh = &mut settings.sbvh;
        sbvh.alpha = self.sbvh_alpha.unwrap_or(sbvh.alpha);
        sbvh.bins = self.sbvh_bins.unwrap_or(sbvh.bins);
        sbvh.unsplit = self.sbvh_unsplit.unwrap_or(sbvh.unsplit);
        Ok(())
    }
}

fn budget(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(part) if part > 0.0 && part <= 16.0 => Ok(part),
        _ => Err("not a number above 0 and at most 16".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::super::args::settings;
    use super::*;
    use prbvh::build::SbvhSettings;

    #[test]
    fn splits_are_asked_for_with_or_without_a_budget() {
        let presplit = |arguments: &str| settings(arguments).map(|settings| settings.presplit);
        let with = |budget, form| {
            Ok(Some(PresplitSettings::default().with(|s| {
                s.budget = budget;
                s.form = form;
            })))
        };
        assert_eq!(presplit(""), Ok(None));
        assert_eq!(presplit("--presplit"), Ok(Some(PresplitSettings::default())));
        assert_eq!(presplit("--presplit=0.5 --presplit-form sbvh"), with(0.5, PresplitForm::Sbvh));
        assert_eq!(presplit("--presplit --presplit-form extent-area"), with(0.3, PresplitForm::ExtentArea));
        let sbvh = settings("--initial sbvh --sbvh-budget 0.1").unwrap();
        assert_eq!((&sbvh.initial, sbvh.sbvh.budget), (&Initial::Sbvh, 0.1));
        let sbvh =
            settings("--presplit --presplit-form sbvh --sbvh-alpha 0.01 --sbvh-bins 8 --sbvh-unsplit false").unwrap();
        assert_eq!((sbvh.sbvh.alpha, sbvh.sbvh.bins, sbvh.sbvh.unsplit), (0.01, 8, false));
        assert_eq!(
            settings("--initial sbvh --sbvh-bins 64").unwrap().sbvh,
            SbvhSettings::default().with(|s| s.bins = 64)
        );
        for (arguments, part) in [
            ("--presplit --sbvh-unsplit false", "are for --initial sbvh and --presplit-form sbvh"),
            ("--initial sbvh --sbvh-alpha -1", "sbvh.alpha is -1"),
            ("--initial sbvh --sbvh-bins 1", "sbvh.bins is 1, but must be from 2 to 256"),
            ("--presplit=0", "above 0 and at most 16"),
            ("--presplit=-1", "above 0 and at most 16"),
            ("--presplit=nan", "above 0 and at most 16"),
            ("--presplit-form level", "--presplit"),
            ("--sbvh-budget 0.1", "--sbvh-budget is for --initial sbvh, not for lbvh"),
            ("--presplit --initial sbvh", "presplit is given, but must be none"),
            ("--presplit --initial a.bvh", "presplit is given, but must be none"),
            ("--presplit --fold-duplicates", "fold_duplicates is true, but must be false with presplit"),
            ("--presplit --check-numerics", "--check-numerics is for trees without splits"),
        ] {
            let error = settings(arguments).unwrap_err();
            assert!(error.contains(part), "{arguments}: {error}");
        }
        assert_eq!(USUAL.parse(), Ok(PresplitSettings::BUDGET));
    }
}
