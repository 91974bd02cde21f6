//! What the runs of a scene left out.

use crate::compare::{OptimizerRun, Purpose, SceneComparison};

/// A decision, and whose it was.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct PlanLine {
    /// What was left out, why, and what that saves.
    pub(super) text: String,
    /// The methods; nothing if all that were planned have it.
    pub(super) of: String,
}

/// The decisions of the table's runs, equal ones once.
pub(super) fn plan_lines(scene: &SceneComparison) -> Vec<PlanLine> {
    let in_table = |run: &&OptimizerRun| run.purpose == Purpose::Table && !run.plan.is_empty();
    let planned: Vec<&OptimizerRun> = scene.runs.iter().filter(in_table).collect();
    let several = planned.iter().any(|run| run.device != planned[0].device);
    let name = |run: &OptimizerRun| {
        let mu = if run.mu > 0 { format!(" µ = {}", run.mu) } else { String::new() };
        let device = if several { format!(", {}", run.device) } else { String::new() };
        format!("{}{mu}{device}", run.method)
    };
    let mut texts: Vec<&String> = Vec::new();
    for text in planned.iter().flat_map(|run| &run.plan) {
        if !texts.contains(&text) {
            texts.push(text);
        }
    }
    let line = |text: &String| {
        let have = planned.iter().filter(|run| run.plan.contains(text));
        let names: Vec<String> = have.map(|run| name(run)).collect();
        let of = if names.len() == planned.len() { String::new() } else { names.join("; ") };
        PlanLine { text: text.clone(), of }
    };
    texts.into_iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use prbvh::optimize::IterationRow;

    fn run(method: &str, mu: u32, device: &str, purpose: Purpose, plan: &[&str]) -> OptimizerRun {
        OptimizerRun {
            method: method.to_owned(),
            purpose,
            initial: "lbvh".to_owned(),
            strategy: String::new(),
            mu,
            device: device.to_owned(),
            build_s: 0.0,
            build_device_s: None,
            rows: vec![IterationRow::default()],
            phases: Vec::new(),
            plan: plan.iter().map(|&line| line.to_owned()).collect(),
        }
    }

    fn lines(runs: Vec<OptimizerRun>) -> Vec<(String, String)> {
        let scene = SceneComparison {
            name: String::new(),
            hash: String::new(),
            triangles: 1,
            notes: Vec::new(),
            rows: Vec::new(),
            runs,
            errors: None,
            pictures: Vec::new(),
        };
        plan_lines(&scene).into_iter().map(|line| (line.text, line.of)).collect()
    }

    #[test]
    fn a_decision_of_all_stands_once_and_others_say_whose_they_are() {
        let [lbvh, prbvh] = [("lbvh", 0, &["paths", "collapse"][..]), ("prbvh", 9, &["collapse", "words"][..])]
            .map(|(method, mu, plan)| run(method, mu, "cpu", Purpose::Table, plan));
        let sweep = run("sah-sweep", 0, "cpu (host)", Purpose::Table, &[]);
        let figure = run("prbvh", 1, "cpu", Purpose::Mu, &["of a figure"]);
        let expected = [("paths", "lbvh"), ("collapse", ""), ("words", "prbvh µ = 9")];
        let expected = expected.map(|(text, of)| (text.to_owned(), of.to_owned()));
        assert_eq!(lines(vec![lbvh.clone(), prbvh, sweep, figure]), expected);
        let elsewhere = run("lbvh", 0, "gpu", Purpose::Table, &["paths"]);
        assert_eq!(lines(vec![lbvh, elsewhere])[1], ("collapse".to_owned(), "lbvh, cpu".to_owned()));
        assert_eq!(lines(Vec::new()), []);
    }
}
