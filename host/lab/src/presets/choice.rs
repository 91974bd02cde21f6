//! The rule that chooses the presets.

use super::{CANDIDATES, Preset};
use serde::Serialize;

/// `fast` has at most this mean relative error.
pub const FAST_ERROR: f64 = 0.1;
/// `balanced` has at most this mean relative error.
pub const BALANCED_ERROR: f64 = 0.01;
/// `best` has at most this much more than the lowest mean relative error.
pub const BEST_ERROR: f64 = 0.001;

/// What a candidate did on a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Scene.
    pub scene: String,
    /// Name of the candidate.
    pub candidate: String,
    /// Wall time from triangles, seconds.
    pub build_s: f64,
    /// SAH cost / lowest cost known - 1.
    pub error: f64,
}

/// A candidate over all scenes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Score {
    /// Name of the candidate.
    pub name: String,
    /// Time / time of LBVH, geometric mean.
    pub time: f64,
    /// Geometric mean of cost / lowest cost known, less 1.
    pub error: f64,
    /// Whether no other is both faster and better.
    pub is_on_front: bool,
}

/// What the rule says.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Choices {
    /// Scenes that all candidates ended well on.
    pub scenes: Vec<String>,
    /// All candidates, the fastest first.
    pub scores: Vec<Score>,
    /// For each preset its name, the winner, and what the table has.
    pub presets: Vec<[String; 3]>,
}

impl Choices {
    /// Whether the table has the winners.
    #[must_use]
    pub fn agree(&self) -> bool {
        self.presets.iter().all(|[_, winner, has]| winner == has)
    }
}

/// Why there is no choice.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ChoiceError {
    /// No scene has a good row of every candidate.
    #[error("no scene has a row of every candidate that ended well: run `prbvh compare SCENE… --methods candidates --out DIR`{}", .missing.as_ref().map_or_else(String::new, |missing| format!("; the first that is missing: {missing}")))]
    NoScene {
        /// Scene and candidate.
        missing: Option<String>,
    },
    /// No candidate keeps a preset's bound.
    #[error("no candidate is fit for the preset {0}")]
    NoneFit(Preset),
}

/// Chooses among the candidates by their trials on the scenes where all ended well.
///
/// Each preset is the fastest whose error is at most a bound: [`FAST_ERROR`], [`BALANCED_ERROR`], and for `best` [`BEST_ERROR`] above the
/// lowest error of all. Time is the geometric mean over the scenes of time / time of LBVH, error that of cost / lowest cost known, less 1.
/// So every winner is on the Pareto front of the two, and only the order of the times can differ from one measurement to the next.
///
/// # Errors
/// If no scene has trials of all candidates, or none keeps a bound.
pub fn choose(trials: &[Trial]) -> Result<Choices, ChoiceError> {
    let names: Vec<String> = CANDIDATES.iter().map(ToString::to_string).collect();
    let find = |scene: &str, name: &str| {
        let is_fit = |trial: &&Trial| trial.build_s > 0.0 && trial.build_s.is_finite() && trial.error.is_finite();
        trials.iter().filter(|trial| trial.scene == scene && trial.candidate == name).find(is_fit)
    };
    let mut scenes: Vec<String> = Vec::new();
    let mut missing = None;
    for trial in trials {
        if scenes.contains(&trial.scene) {
            continue;
        }
        match names.iter().find(|name| find(&trial.scene, name).is_none()) {
            None => scenes.push(trial.scene.clone()),
            Some(name) => missing = missing.or_else(|| Some(format!("{} on {}", name, trial.scene))),
        }
    }
    if scenes.is_empty() {
        return Err(ChoiceError::NoScene { missing });
    }
    let mean = |name: &str, ratio: &dyn Fn(&Trial, &Trial) -> f64| {
        let pairs = scenes.iter().filter_map(|scene| Some((find(scene, name)?, find(scene, &names[0])?)));
        (pairs.map(|(trial, lbvh)| ratio(trial, lbvh).ln()).sum::<f64>() / scenes.len() as f64).exp()
    };
    let score = |name: &String| Score {
        name: name.clone(),
        time: mean(name, &|trial, lbvh| trial.build_s / lbvh.build_s),
        error: mean(name, &|trial, _| 1.0 + trial.error) - 1.0,
        is_on_front: false,
    };
    let mut scores: Vec<Score> = names.iter().map(score).collect();
    scores.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.error.total_cmp(&b.error)));
    let mut lowest = f64::INFINITY;
    for score in &mut scores {
        score.is_on_front = score.error < lowest;
        lowest = lowest.min(score.error);
    }
    let presets = Preset::ALL.map(|preset| {
        let bound = match preset {
            Preset::Fast => FAST_ERROR,
            Preset::Balanced => BALANCED_ERROR,
            Preset::Best => lowest + BEST_ERROR,
        };
        let winner = scores.iter().find(|score| score.error <= bound);
        let has = preset.candidate().map_or_else(String::new, ToString::to_string);
        Ok([preset.to_string(), winner.ok_or(ChoiceError::NoneFit(preset))?.name.clone(), has])
    });
    let presets = presets.into_iter().collect::<Result<_, _>>()?;
    Ok(Choices { scenes, scores, presets })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Candidates that may win here; those behind them are slow and bad.
    const TRIED: usize = 14;

    /// Trials in which the k-th candidate takes `2^k` and has an error of `0.265 - 0.02 k`, but for the changes.
    fn trials(scenes: &[&str], change: &dyn Fn(&mut Trial)) -> Vec<Trial> {
        let mut trials = Vec::new();
        for (s, scene) in scenes.iter().enumerate() {
            for (k, candidate) in CANDIDATES.iter().enumerate() {
                let mut trial = Trial {
                    scene: (*scene).to_owned(),
                    candidate: candidate.to_string(),
                    build_s: 2f64.powi(k as i32) * (1.0 + s as f64),
                    error: if k < TRIED { 0.265 - 0.02 * k as f64 } else { 1.0 },
                };
                change(&mut trial);
                trials.push(trial);
            }
        }
        trials
    }

    fn name(k: usize) -> String {
        CANDIDATES[k].to_string()
    }

    fn winners(trials: &[Trial]) -> [String; 3] {
        let choices = choose(trials).unwrap();
        [0, 1, 2].map(|k| choices.presets[k][1].clone())
    }

    #[test]
    fn the_rule_picks_by_time_and_error() {
        let last = TRIED - 1;
        let plain = trials(&["a", "b"], &|_| ());
        assert_eq!(winners(&plain), [name(9), name(last), name(last)]);
        let choices = choose(&plain).unwrap();
        assert!((choices.scores[3].time - 8.0).abs() < 1e-9 && (choices.scores[3].error - 0.205).abs() < 1e-9);
        assert!(choices.scores[..TRIED].iter().all(|score| score.is_on_front));
        // Beaten in both: off the front, and never chosen.
        let beaten = trials(&["a"], &|trial| {
            if trial.candidate == name(9) {
                trial.error = 0.5;
            }
            if trial.candidate == name(last - 2) {
                trial.error = 0.0095;
            }
            if trial.candidate == name(last) {
                trial.error = 0.009;
            }
        });
        assert_eq!(winners(&beaten), [name(10), name(last - 2), name(last - 2)]);
        assert!(!choose(&beaten).unwrap().scores[9].is_on_front);
    }

    #[test]
    fn another_winner_than_the_table_has_is_seen() {
        let choices = choose(&trials(&["a"], &|_| ())).unwrap();
        let as_in_code = Choices {
            presets: choices
                .presets
                .iter()
                .map(|[preset, _, has]| [preset.clone(), has.clone(), has.clone()])
                .collect(),
            ..choices.clone()
        };
        assert!(as_in_code.agree());
        let mut other = as_in_code;
        other.presets[1][1] = "something else".to_owned();
        assert!(!other.agree());
    }

    #[test]
    fn scenes_that_lack_a_candidate_are_left_out() {
        let lacks = |scene: &'static str| {
            move |trial: &mut Trial| {
                if trial.scene == scene && trial.candidate == name(4) {
                    trial.build_s = f64::NAN;
                }
            }
        };
        assert_eq!(choose(&trials(&["a", "b"], &lacks("b"))).unwrap().scenes, ["a"]);
        let error = choose(&trials(&["a"], &lacks("a"))).unwrap_err().to_string();
        assert!(error.contains("--methods candidates") && error.contains(&format!("{} on a", name(4))), "{error}");
        assert!(choose(&[]).is_err());
        let bad = choose(&trials(&["a"], &|trial| trial.error = 0.5)).unwrap_err();
        assert_eq!(bad, ChoiceError::NoneFit(Preset::Fast));
    }
}
