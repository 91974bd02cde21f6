//! What is printed, as Markdown.

use crate::experiment::{Experiment, Outcome};
use prbvh::scene::Scene;
use prbvh_lab::reference::ReferenceCost;
use prbvh_tests::bench::curve::{Curve, envelope, time_to_reach};
use prbvh_tests::bench::markdown::{Markdown, ms, number};
use prbvh_tests::bench::obvhs::PROGRAM;
use prbvh_tests::bench::targets::{SceneResult, verdicts};
use std::fmt::Write;

/// What the numbers are.
pub(crate) const METHOD: &str = "\
Cost: 3 · Σ area(internal) + 2 · Σ area(leaf), ÷ area(root), one triangle per leaf, by prbvh's f64 evaluator over boxes recomputed from the
triangles, for the trees of both programs. Every tree at the end of a run is validated.
same tree: both start from the tree of obvhs's PLOC (radius 32 on all levels), each in its own form; making that form and putting it on the
device count for neither, the optimiser's own set-up counts for both. pipelines: from triangles in each program's own form to a tree in its
own form; our scaling into the safe range and the census of Morton codes count.
Times: wall, medians of alternating runs after a warm-up of each, in one pool of threads; of RBVH, which has one thread, see the column.
`ours reaches c`: the first time at which any of our configurations had a tree of that cost or less.
";

/// A scene in one experiment.
pub(crate) fn outcome(scene: &Scene, outcome: &Outcome, known: Option<&ReferenceCost>) -> String {
    let mut text = String::new();
    let initial = outcome.initial_cost.map_or_else(String::new, |cost| format!(", initial cost {cost:.3}"));
    let limit = outcome.limit_s.map_or_else(|| "none".to_owned(), |limit| format!("{limit:.2} s"));
    let _ = writeln!(
        text,
        "### {}, {} triangles: {}{initial}; {} repetitions, time limit of ours {limit}\n",
        scene.name,
        scene.triangles.len(),
        outcome.experiment.name(),
        outcome.repeat
    );
    text.push_str(&peer_points(&outcome.result));
    let _ = writeln!(text, "\n{}\n", summary(outcome, known));
    text.push_str(&configurations(outcome));
    text
}

fn peer_points(result: &SceneResult) -> String {
    let mut table =
        Markdown::new(&["<peer", "<setting", "t, ms", "c", "ours reaches c, ms", "÷ t", "<by configuration"]);
    for point in &result.points {
        table.row(&[
            PROGRAM.to_owned(),
            point.setting.clone(),
            ms(point.time_s),
            number(point.cost, 3),
            ms(point.our_time_s),
            number(point.ratio(), 2),
            if point.by.is_empty() { "never".to_owned() } else { point.by.clone() },
        ]);
    }
    table.finish()
}

fn summary(outcome: &Outcome, known: Option<&ReferenceCost>) -> String {
    let SceneResult { peer_best, worst_first, lowest, rbvh, rbvh_undo, .. } = outcome.result;
    let name_of = |cost: f64| {
        outcome.ours.iter().find(|ours| ours.final_cost == cost).map_or("none", |ours| ours.curve.name.as_str())
    };
    let best_setting = outcome.theirs.iter().find(|(_, point, _)| point.cost == peer_best);
    let best_setting = best_setting.map_or("none", |(setting, _, _)| setting.as_str());
    let points = &outcome.result.points;
    let firsts = |name: &str| points.iter().filter(|point| point.by == name).count();
    let winner = outcome.ours.iter().map(|ours| ours.curve.name.as_str()).max_by_key(|name| firsts(name));
    let winner = winner.map_or_else(String::new, |name| {
        format!("most often first: {name}, at {} of {} points; ", firsts(name), points.len())
    });
    let rbvh_ratio = |what: &str, cost: Option<f64>| match cost {
        Some(cost) => format!("{:.4} × {what} ({cost:.3})", worst_first / cost),
        None => format!("{what} did not run to its end"),
    };
    let known = known.map_or_else(String::new, |known| {
        format!(
            "; lowest known {:.3} ({}), ours {:+.2} % from it",
            known.cost,
            known.method,
            (lowest / known.cost - 1.0) * 100.0
        )
    });
    format!(
        "{winner}their best {peer_best:.3} ({best_setting}); worst first {worst_first:.3} ({}), {:.4} × theirs; our lowest {lowest:.3} ({}), {:.4} × theirs; \
         worst first is {}, {}{known}",
        name_of(worst_first),
        worst_first / peer_best,
        name_of(lowest),
        lowest / peer_best,
        rbvh_ratio("RBVH", rbvh),
        rbvh_ratio("RBVH with undo", rbvh_undo),
    )
}

fn configurations(outcome: &Outcome) -> String {
    let curves: Vec<Curve> = outcome.ours.iter().map(|ours| ours.curve.clone()).collect();
    let envelope = envelope(&curves);
    let peer_best = outcome.result.peer_best;
    let mut table = Markdown::new(&[
        "<our configuration",
        "final cost",
        "÷ their best",
        "best tree, ms",
        "their best, ms",
        "end, ms",
        "<end by",
        "points on the envelope",
        "runs",
        "f32 error",
    ]);
    for ours in &outcome.ours {
        let points = &ours.curve.points;
        table.row(&[
            ours.curve.name.clone(),
            number(ours.final_cost, 3),
            number(ours.final_cost / peer_best, 4),
            ms(time_to_reach(points, prbvh_tests::bench::curve::lowest(points))),
            ms(time_to_reach(points, peer_best)),
            ms(ours.end_s),
            ours.stop.clone(),
            envelope.iter().filter(|at| at.name == ours.curve.name).count().to_string(),
            ours.repetitions.to_string(),
            format!("{:.0e}", ours.device_error),
        ]);
    }
    table.finish()
}

/// All scenes of an experiment, a row each, and the targets.
pub(crate) fn targets(outcomes: &[(Experiment, SceneResult)]) -> String {
    let mut text = String::new();
    let mut judged = Markdown::new(&["<target", "<measured", "<", "<by"]);
    for experiment in [Experiment::SameTree, Experiment::Pipelines] {
        let results: Vec<SceneResult> =
            outcomes.iter().filter(|(of, _)| *of == experiment).map(|(_, result)| result.clone()).collect();
        if results.is_empty() {
            continue;
        }
        let _ = writeln!(text, "### {}: all scenes\n\n{}", experiment.name(), scenes(&results));
        for verdict in verdicts(experiment.name(), &results) {
            let word = verdict.word().to_owned();
            judged.row(&[verdict.target, verdict.measured, word, verdict.by]);
        }
    }
    let fewest = prbvh_tests::bench::targets::FEWEST_TRIANGLES;
    let _ = writeln!(text, "### Targets, over scenes of {fewest} triangles or more\n\n{}", judged.finish());
    text
}

fn scenes(results: &[SceneResult]) -> String {
    let mut table = Markdown::new(&[
        "<scene",
        "triangles",
        "their best cost",
        "worst first",
        "÷ theirs",
        "our lowest",
        "÷ theirs",
        "worst first ÷ RBVH",
        "worst first ÷ RBVH undo",
        "<our time ÷ t, setting by setting",
    ]);
    for result in results {
        let ratios: Vec<String> = result.points.iter().map(|point| number(point.ratio(), 2)).collect();
        table.row(&[
            result.scene.clone(),
            result.triangles.to_string(),
            number(result.peer_best, 3),
            number(result.worst_first, 3),
            number(result.worst_first / result.peer_best, 4),
            number(result.lowest, 3),
            number(result.lowest / result.peer_best, 4),
            number(result.rbvh.map(|cost| result.worst_first / cost), 4),
            number(result.rbvh_undo.map(|cost| result.worst_first / cost), 4),
            ratios.join(" "),
        ]);
    }
    table.finish()
}
