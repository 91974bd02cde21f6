//! The arguments that say how low a cost is low enough.

use super::values::not_negative;
use clap::Args;
use prbvh::pipeline::{Optimizer, Settings};
use prbvh::scene::Scene;
use prbvh_lab::reference::ReferenceCost;

/// When the optimiser may stop before it has converged.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct TargetArgs {
    /// Stop at this SAH cost with one triangle per leaf, or a lower one.
    #[arg(long, value_name = "COST", value_parser = not_negative, allow_negative_numbers = true)]
    target_cost: Option<f64>,
    /// Stop when the cost is at most this part above the lowest known of the scene, such as 0.01.
    #[arg(long, value_name = "PART", value_parser = not_negative, allow_negative_numbers = true, conflicts_with = "target_cost")]
    target_error: Option<f64>,
}

impl TargetArgs {
    /// Gives the target to the optimiser of the settings.
    ///
    /// # Errors
    /// If there is no optimiser, or an error is asked for and no cost of the scene is known.
    pub(super) fn apply(
        &self,
        settings: &mut Settings,
        scene: &Scene,
        known: Option<&ReferenceCost>,
    ) -> anyhow::Result<()> {
        let (argument, target) = match (self.target_cost, self.target_error, known) {
            (None, None, _) => return Ok(()),
            (Some(cost), _, _) => ("--target-cost", cost),
            (None, Some(error), Some(known)) => ("--target-error", known.cost * (1.0 + error)),
            (None, Some(_), None) => anyhow::bail!(
                "--target-error: no reference cost is known of {} (hash {}): say --target-cost",
                scene.name,
                scene.hash
            ),
        };
        anyhow::ensure!(
            settings.optimizer != Optimizer::None,
            "{argument} is for an optimiser, and there is none to stop"
        );
        settings.limits_mut().target_cost = Some(target);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use prbvh::bvh::SahModel;
    use prbvh::optimize::RbvhSettings;
    use prbvh::scene::built_in;

    #[test]
    fn a_target_goes_to_the_optimiser_that_runs() {
        let scene = built_in(100);
        let known = ReferenceCost {
            scene: scene.name.clone(),
            hash: scene.hash.clone(),
            triangles: 100,
            sah: SahModel::default(),
            cost: 40.0,
            method: String::new(),
            commit: String::new(),
        };
        let target = |target_cost, target_error, known: Option<&ReferenceCost>, optimizer: Optimizer| {
            let mut settings = Settings::default().with(|s| s.optimizer = optimizer);
            let applied = TargetArgs { target_cost, target_error }.apply(&mut settings, &scene, known);
            applied.map_err(|error| error.to_string())?;
            Ok::<_, String>(settings.limits().target_cost)
        };
        let rbvh = || Optimizer::Rbvh(RbvhSettings::default());
        assert_eq!(target(None, None, Some(&known), Optimizer::Prbvh), Ok(None));
        assert_eq!(target(Some(50.0), None, None, Optimizer::Prbvh), Ok(Some(50.0)));
        assert_eq!(target(None, Some(0.25), Some(&known), rbvh()), Ok(Some(50.0)));
        let error = target(None, Some(0.25), None, rbvh()).unwrap_err();
        assert!(error.contains(&scene.hash) && error.contains("--target-cost"), "{error}");
        let error = target(Some(50.0), None, None, Optimizer::None).unwrap_err();
        assert!(error.starts_with("--target-cost is for an optimiser"), "{error}");
    }
}
