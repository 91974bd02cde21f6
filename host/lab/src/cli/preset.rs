//! `--preset`: the settings that [`prbvh_lab::presets`] has for it.

use prbvh::pipeline::Settings;
use prbvh_lab::presets::Preset;

/// Arguments whose settings a preset has: beside it they are refused. Limits, targets and leaves may stand beside it.
pub(super) const PRESET_SETS: [&str; 16] = [
    "initial",
    "radius",
    "treelet",
    "passes",
    "bins",
    "annealing",
    "temperature",
    "no_cousins",
    "strategy",
    "order",
    "optimizer",
    "batch",
    "seed",
    "mu",
    "epsilon",
    "epsilon_absolute",
];

/// `asked` with the preset's initial tree and optimiser, and its limits.
pub(super) fn applied(preset: Preset, asked: Settings) -> Settings {
    let Some(candidate) = preset.candidate() else { return asked };
    let chosen = candidate.settings();
    asked.with(|settings| {
        settings.initial = chosen.initial;
        settings.optimizer = chosen.optimizer;
        settings.prbvh = chosen.prbvh;
    })
}

#[cfg(test)]
mod tests {
    use super::super::args::settings;
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_preset_is_plain_settings() {
        for (name, preset) in [("fast", Preset::Fast), ("balanced", Preset::Balanced), ("best", Preset::Best)] {
            let expected = preset.candidate().unwrap().settings();
            assert_eq!(settings(&format!("--preset {name}")), Ok(expected.clone()), "{name}");
            let limited =
                settings(&format!("--preset {name} --max-time 2 --max-iterations 7 --morton-bits 30")).unwrap();
            let limits = limited.limits();
            assert_eq!((limits.max_time, limits.max_iterations), (Some(Duration::from_secs(2)), 7), "{name}");
            assert_eq!((&limited.initial, limited.prbvh.mu), (&expected.initial, expected.prbvh.mu));
            assert_ne!(limited.morton_bits, expected.morton_bits);
        }
    }

    #[test]
    fn what_a_preset_sets_is_refused_beside_it_by_name() {
        for argument in [
            "--initial lbvh",
            "--radius 9",
            "--treelet 9",
            "--passes 9",
            "--bins 9",
            "--annealing 9",
            "--temperature 9",
            "--no-cousins",
            "--strategy aggressive",
            "--order published",
            "--optimizer prbvh",
            "--batch 0.1",
            "--seed 1",
            "--mu 9",
            "--epsilon 0.1",
            "--epsilon-absolute 0.1",
        ] {
            let error = settings(&format!("--preset fast {argument}")).unwrap_err();
            let name = argument.split(' ').next().unwrap();
            assert!(error.contains("--preset") && error.contains(name), "{argument}: {error}");
        }
        assert!(settings("--preset slow").unwrap_err().contains("fast, balanced, best"));
    }
}
