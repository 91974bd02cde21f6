//! The arguments that choose the optimiser.

use super::values::not_negative;
use clap::{Args, ValueEnum};
use prbvh::optimize::{RbvhSettings, RotationSettings};
use prbvh::pipeline::Optimizer;

/// The optimiser, and what RBVH alone needs.
#[derive(Clone, Debug, Args)]
pub(super) struct OptimizerArgs {
    /// prbvh: parallel, on the device; rbvh: Bittner, Hapala & Havran 2013, on one thread; rotations: Kensler 2008, on the device; none: the initial
    /// tree as it is.
    #[arg(long, value_enum, default_value_t)]
    optimizer: OptimizerArg,
    /// Part of the nodes that a batch of RBVH reinserts [default: 0.01].
    #[arg(long, value_name = "PART", value_parser = part, allow_negative_numbers = true)]
    batch: Option<f64>,
    /// Seed of what RBVH and annealing pick at random [default: 1].
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    seed: Option<u64>,
    /// Passes of annealing before rotations climb [default: 0].
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    annealing: Option<u32>,
    /// Temperature at the start of the annealing, in mean areas of an internal node [default: 0.1].
    #[arg(long, value_name = "AREAS", value_parser = not_negative, allow_negative_numbers = true)]
    temperature: Option<f64>,
    /// Rotations of a child and a grandchild only, not of two grandchildren.
    #[arg(long)]
    no_cousins: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum OptimizerArg {
    #[default]
    Prbvh,
    Rbvh,
    Rotations,
    None,
}

/// Which arguments of PRBVH were said beside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Beside {
    pub(super) mu: bool,
    pub(super) epsilon: bool,
    pub(super) epsilon_absolute: bool,
    pub(super) strategy: bool,
    pub(super) is_worst_first: bool,
}

impl OptimizerArgs {
    /// The optimiser that the arguments say.
    ///
    /// # Errors
    /// If a setting is for another one.
    pub(super) fn settings(&self, beside: Beside) -> anyhow::Result<Optimizer> {
        let chosen = match self.optimizer {
            OptimizerArg::Prbvh => Optimizer::Prbvh,
            OptimizerArg::None => Optimizer::None,
            OptimizerArg::Rotations => Optimizer::Rotations(RotationSettings::default()),
            OptimizerArg::Rbvh => Optimizer::Rbvh(RbvhSettings::default().with(|settings| {
                settings.batch = self.batch.unwrap_or(settings.batch);
                settings.seed = self.seed.unwrap_or(settings.seed);
            })),
        };
        let chosen = match chosen {
            Optimizer::Rotations(mut settings) => {
                settings.cousins = !self.no_cousins;
                settings.annealing_passes = self.annealing.unwrap_or(settings.annealing_passes);
                settings.temperature = self.temperature.unwrap_or(settings.temperature);
                if let Some(seed) = self.seed {
                    let seed = u32::try_from(seed);
                    settings.seed = seed.map_err(|_| anyhow::anyhow!("--seed of rotations has 32 bits"))?;
                }
                Optimizer::Rotations(settings)
            }
            other => other,
        };
        let prbvh =
            [("--mu", beside.mu), ("--epsilon", beside.epsilon), ("--epsilon-absolute", beside.epsilon_absolute)];
        let rbvh = [("--batch", self.batch.is_some())];
        let random = [("--seed", self.seed.is_some())];
        let rotations = [
            ("--annealing", self.annealing.is_some()),
            ("--temperature", self.temperature.is_some()),
            ("--no-cousins", self.no_cousins),
        ];
        for (name, own, settings) in [
            ("prbvh", &[OptimizerArg::Prbvh][..], &prbvh[..]),
            ("rbvh", &[OptimizerArg::Rbvh], &rbvh),
            ("rbvh or rotations", &[OptimizerArg::Rbvh, OptimizerArg::Rotations], &random),
            ("rotations", &[OptimizerArg::Rotations], &rotations),
        ] {
            let foreign = settings.iter().find(|(_, is_set)| *is_set && !own.contains(&self.optimizer));
            if let Some((argument, _)) = foreign {
                anyhow::bail!("{argument} is for --optimizer {name}, not for {chosen}");
            }
        }
        let published = [&prbvh[..], &[("--strategy", beside.strategy)]].concat();
        if beside.is_worst_first
            && let Some((argument, _)) = published.iter().find(|(_, is_set)| *is_set)
        {
            anyhow::bail!("{argument} is for --order published, not for worst-first");
        }
        Ok(chosen)
    }
}

fn part(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(part) if part > 0.0 && part <= 1.0 => Ok(part),
        _ => Err("not a number above 0 and at most 1".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::super::args::settings;
    use super::*;
    use prbvh::optimize::Limits;
    use std::time::Duration;

    #[test]
    fn an_optimizer_takes_its_own_settings_only() {
        let optimizer = |arguments: &str| settings(arguments).map(|settings| settings.optimizer);
        assert_eq!(optimizer(""), Ok(Optimizer::Prbvh));
        assert_eq!(optimizer("--optimizer prbvh --order published --mu 4 --epsilon 0"), Ok(Optimizer::Prbvh));
        assert_eq!(optimizer("--optimizer none"), Ok(Optimizer::None));
        assert_eq!(optimizer("--optimizer rbvh"), Ok(Optimizer::Rbvh(RbvhSettings::default())));
        let expected = RbvhSettings::default().with(|s| {
            s.batch = 0.5;
            s.seed = 7;
            s.limits = Limits::iterations(3).with(|s| s.max_time = Some(Duration::from_secs(2)));
        });
        let arguments = "--optimizer rbvh --batch 0.5 --seed 7 --max-iterations 3 --max-time 2";
        assert_eq!(optimizer(arguments), Ok(Optimizer::Rbvh(expected)));
        let rotations = |change: &dyn Fn(&mut RotationSettings)| {
            Ok(Optimizer::Rotations(RotationSettings::default().with(|s| change(s))))
        };
        assert_eq!(optimizer("--optimizer rotations"), rotations(&|_| {}));
        let arguments =
            "--optimizer rotations --no-cousins --annealing 9 --temperature 0.5 --seed 7 --max-iterations 3";
        let expected = rotations(&|s| {
            (s.cousins, s.annealing_passes, s.temperature, s.seed) = (false, 9, 0.5, 7);
            s.limits = Limits::iterations(3);
        });
        assert_eq!(optimizer(arguments), expected);
        for (arguments, part) in [
            ("--annealing 3", "--annealing is for --optimizer rotations, not for prbvh"),
            ("--optimizer rbvh --no-cousins", "--no-cousins is for --optimizer rotations, not for rbvh"),
            ("--optimizer rotations --temperature -1", "-1"),
            ("--optimizer rotations --seed 4294967296", "32 bits"),
            ("--optimizer rotations --batch 0.1", "--batch is for --optimizer rbvh, not for rotations"),
            ("--optimizer rbvh --mu 9", "--mu is for --optimizer prbvh, not for rbvh"),
            ("--optimizer none --epsilon 0.1", "--epsilon is for --optimizer prbvh, not for none"),
            ("--optimizer rbvh --epsilon-absolute 0.1", "--epsilon-absolute is for --optimizer prbvh"),
            ("--batch 0.1", "--batch is for --optimizer rbvh, not for prbvh"),
            ("--optimizer none --seed 1", "--seed is for --optimizer rbvh or rotations, not for none"),
            ("--mu 9", "--mu is for --order published, not for worst-first"),
            ("--strategy conservative", "--strategy is for --order published, not for worst-first"),
            ("--optimizer rbvh --batch 0", "above 0 and at most 1"),
            ("--optimizer rbvh --batch 1.5", "above 0 and at most 1"),
            ("--optimizer rbvh --batch nan", "above 0 and at most 1"),
            ("--optimizer sah", "rbvh"),
        ] {
            let error = optimizer(arguments).unwrap_err();
            assert!(error.contains(part), "{arguments}: {error}");
        }
    }
}
