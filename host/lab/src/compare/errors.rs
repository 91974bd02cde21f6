//! Relative error against run time: how near a method comes to the lowest cost known, how soon, and which settings nothing beats.

use super::data::{
    LEVELS, OptimizerRun, Purpose, Reference, SceneComparison, SceneErrors, SettingErrors, TimesToError, is_cost,
    with_mu,
};
use crate::reference::ReferenceCost;

impl SceneComparison {
    /// Fills [`SceneComparison::errors`] and the errors of its rows. The reference is the lowest of `known` and of what is here.
    pub fn set_errors(&mut self, known: Option<&ReferenceCost>) {
        self.errors = SceneErrors::of(self, known);
        let Some(errors) = &self.errors else { return };
        for row in &mut self.rows {
            let cost = row.cost.filter(|cost| is_cost(*cost) && row.status == "ok" && !row.has_splits(self.triangles));
            row.relative_error = cost.map(|cost| errors.reference.error_of(cost));
            let same = |run: &&OptimizerRun| {
                run.purpose == Purpose::Table
                    && (&run.method, run.mu, &run.device) == (&row.method, row.mu.unwrap_or(0), &row.device)
            };
            row.time_to = self.runs.iter().find(same).map(|run| errors.reference.times(run));
        }
    }
}

impl SceneErrors {
    /// None if there is no cost. Runs on one thread are left out: their settings are there without.
    #[must_use]
    pub fn of(scene: &SceneComparison, known: Option<&ReferenceCost>) -> Option<Self> {
        let reference = Reference::of(scene, known)?;
        let runs = runs_without_splits(scene).filter(|run| run.purpose != Purpose::OneThread);
        let settings: Vec<SettingErrors> = runs.filter_map(|run| reference.setting(run)).collect();
        let pareto_front = pareto_front(&settings.iter().map(|s| (s.wall_s, s.error)).collect::<Vec<_>>());
        Some(Self { reference, levels: LEVELS, settings, pareto_front })
    }

    /// The members of the front.
    pub fn front(&self) -> impl Iterator<Item = &SettingErrors> {
        self.pareto_front.iter().filter_map(|&k| self.settings.get(k))
    }
}

/// The runs over triangles as they are: a tree over more references has other costs.
fn runs_without_splits(scene: &SceneComparison) -> impl Iterator<Item = &OptimizerRun> {
    let split =
        |run: &&OptimizerRun| scene.rows.iter().any(|row| row.method == run.method && row.has_splits(scene.triangles));
    scene.runs.iter().filter(move |run| !split(run))
}

impl Reference {
    fn of(scene: &SceneComparison, known: Option<&ReferenceCost>) -> Option<Self> {
        let rows = scene.rows.iter().filter(|row| row.status == "ok" && !row.has_splits(scene.triangles));
        let rows = rows.filter_map(|row| Some((row.cost?, with_mu(&row.method, row.mu))));
        let of_run = |run: &OptimizerRun| Some((run.lowest_cost()?, setting_name(run)));
        let here = rows.chain(runs_without_splits(scene).filter_map(of_run)).filter(|(cost, _)| is_cost(*cost));
        let here = here.min_by(|a, b| a.0.total_cmp(&b.0));
        match (here, known) {
            (Some((cost, _)), Some(known)) if known.cost <= cost => Some(known.into()),
            (Some((reference_cost, source)), _) => {
                Some(Self { reference_cost, source: format!("{source}, this comparison"), is_from_file: false })
            }
            (None, _) => None,
        }
    }

    /// `cost / reference - 1`; exactly 0 for the reference.
    #[must_use]
    pub fn error_of(&self, cost: f64) -> f64 {
        if cost == self.reference_cost { 0.0 } else { cost / self.reference_cost - 1.0 }
    }

    fn setting(&self, run: &OptimizerRun) -> Option<SettingErrors> {
        let wall_s = run.build_s + run.rows.last()?.time_s;
        let error = self.error_of(run.lowest_cost()?);
        (wall_s.is_finite() && error.is_finite()).then(|| SettingErrors {
            method: setting_name(run),
            mu: run.mu,
            device: run.device.clone(),
            wall_s,
            error,
            time_to: self.times(run),
        })
    }

    fn times(&self, run: &OptimizerRun) -> TimesToError {
        let first = |level: f64| run.rows.iter().find(|row| is_cost(row.cost) && self.error_of(row.cost) <= level);
        TimesToError {
            wall_s: LEVELS.map(|level| Some(run.build_s + first(level)?.time_s)),
            device_s: LEVELS.map(|level| Some(run.build_device_s? + first(level)?.device_s)),
        }
    }
}

impl From<&ReferenceCost> for Reference {
    fn from(known: &ReferenceCost) -> Self {
        let source = format!("{}, commit {}", known.method, known.commit);
        Self { reference_cost: known.cost, source, is_from_file: true }
    }
}

/// Method, with what is not as in the table. An optimiser of the table starts from LBVH, aggressively.
fn setting_name(run: &OptimizerRun) -> String {
    let mut name = run.method.clone();
    if run.mu > 0 && !["", "lbvh"].contains(&run.initial.as_str()) {
        name = format!("{name} from {}", run.initial);
    }
    if !["", "aggressive"].contains(&run.strategy.as_str()) {
        name = format!("{name} {}", run.strategy);
    }
    name
}

/// Places of the points of which no other is at least as low in both and lower in one, by rising first value.
fn pareto_front(points: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| points[a].0.total_cmp(&points[b].0).then(points[a].1.total_cmp(&points[b].1)));
    let mut lowest = f64::INFINITY;
    order.retain(|&k| {
        let is_better = points[k].1 < lowest;
        lowest = lowest.min(points[k].1);
        is_better
    });
    order
}

#[cfg(test)]
mod tests {
    use super::super::MethodRow;
    use super::*;
    use prbvh::bvh::SahModel;
    use prbvh::optimize::IterationRow;
    use proptest::prelude::*;

    fn run(method: &str, build_s: f64, points: &[(f64, f64)]) -> OptimizerRun {
        let row = |&(time_s, cost): &(f64, f64)| {
            IterationRow::default().with(|row| {
                row.time_s = time_s;
                row.cost = cost;
                row.device_s = 0.5 * time_s;
            })
        };
        OptimizerRun {
            method: method.to_owned(),
            purpose: Purpose::Table,
            initial: "lbvh".to_owned(),
            strategy: String::new(),
            mu: 0,
            device: "gpu".to_owned(),
            build_s,
            build_device_s: Some(0.25 * build_s),
            rows: points.iter().map(row).collect(),
            phases: Vec::new(),
            plan: Vec::new(),
        }
    }

    fn row(method: &str, cost: f64, status: &str) -> MethodRow {
        MethodRow {
            method: method.to_owned(),
            device: "gpu".to_owned(),
            cost: Some(cost),
            status: status.to_owned(),
            ..MethodRow::default()
        }
    }

    fn scene(rows: Vec<MethodRow>, runs: Vec<OptimizerRun>) -> SceneComparison {
        let (name, hash, pictures) = (String::new(), String::new(), Vec::new());
        SceneComparison { name, hash, triangles: 9, notes: Vec::new(), rows, runs, errors: None, pictures }
    }

    fn known(cost: f64) -> ReferenceCost {
        ReferenceCost {
            scene: String::new(),
            hash: String::new(),
            triangles: 9,
            sah: SahModel::default(),
            cost,
            method: "rbvh undo".to_owned(),
            commit: "abc".to_owned(),
        }
    }

    #[test]
    fn the_reference_is_the_lowest_of_file_and_comparison() {
        let rows = vec![row("lbvh", 120.0, "ok"), row("obvhs", 1.0, "invalid tree"), row("zero", 0.0, "ok")];
        let mut scene = scene(rows, vec![run("prbvh", 1.0, &[(0.0, 120.0), (1.0, 101.0), (2.0, f64::NAN)])]);
        scene.set_errors(None);
        let reference = scene.errors.clone().unwrap().reference;
        assert_eq!((reference.reference_cost, reference.is_from_file), (101.0, false));
        assert_eq!(reference.source, "prbvh, this comparison");
        assert_eq!(scene.rows[1].relative_error.or(scene.rows[2].relative_error), None);
        scene.set_errors(Some(&known(100.0)));
        let reference = scene.errors.clone().unwrap().reference;
        assert_eq!((reference.reference_cost, reference.source.as_str()), (100.0, "rbvh undo, commit abc"));
        assert!((scene.rows[0].relative_error.unwrap() - 0.2).abs() < 1e-12);
        scene.set_errors(Some(&known(101.5)));
        assert!(!scene.errors.unwrap().reference.is_from_file, "the file is not lower");
    }

    #[test]
    fn times_count_from_triangles_to_the_first_tree_that_near() {
        let points = [(0.0, 150.0), (1.0, 109.0), (2.0, 111.0), (3.0, 100.75)];
        let mut scene = scene(vec![row("prbvh", 101.0, "ok")], vec![run("prbvh", 4.0, &points)]);
        scene.set_errors(Some(&known(100.0)));
        let times = scene.rows[0].time_to.unwrap();
        assert_eq!(times.wall_s, [Some(5.0), Some(7.0), Some(7.0), Some(7.0), None]);
        assert_eq!(times.device_s, [Some(1.5), Some(2.5), Some(2.5), Some(2.5), None]);
        let errors = scene.errors.clone().unwrap();
        assert_eq!((errors.settings[0].wall_s, errors.settings[0].time_to), (7.0, times));
        scene.runs[0].build_device_s = None;
        scene.set_errors(Some(&known(100.0)));
        assert_eq!(scene.rows[0].time_to.unwrap().device_s, [None; 5]);
    }

    #[test]
    fn settings_are_named_and_one_thread_is_left_out() {
        let mut runs = vec![run("prbvh", 1.0, &[(1.0, 100.0)]), run("prbvh", 1.0, &[(1.0, 50.0)])];
        (runs[0].mu, runs[0].initial, runs[0].strategy) = (9, "ploc".to_owned(), "conservative".to_owned());
        runs[1].purpose = Purpose::OneThread;
        let errors = SceneErrors::of(&scene(Vec::new(), runs), None).unwrap();
        let names: Vec<&str> = errors.settings.iter().map(|setting| setting.method.as_str()).collect();
        assert_eq!(names, ["prbvh from ploc conservative"]);
        assert_eq!(errors.settings[0].error, 1.0, "its tree counts as known all the same");
        assert_eq!(SceneErrors::of(&scene(Vec::new(), Vec::new()), Some(&known(1.0))), None);
    }

    #[test]
    fn the_front_has_what_nothing_beats() {
        let points = [(3.0, 1.0), (1.0, 5.0), (2.0, 5.0), (2.0, 3.0), (4.0, 1.0), (2.5, 3.0)];
        assert_eq!(pareto_front(&points), [1, 3, 0]);
        assert_eq!(pareto_front(&[]), [0usize; 0]);
    }

    proptest! {
        #[test]
        fn the_front_is_what_the_definition_says(points in proptest::collection::vec((0..9u32, 0..9u32), 0..30)) {
            let points: Vec<(f64, f64)> = points.iter().map(|&(x, y)| (x.into(), y.into())).collect();
            let beats = |a: (f64, f64), b: (f64, f64)| a.0 <= b.0 && a.1 <= b.1 && a != b;
            let front = pareto_front(&points);
            for (k, &point) in points.iter().enumerate() {
                let is_beaten = points.iter().any(|&other| beats(other, point));
                prop_assert_eq!(front.iter().any(|&member| points[member] == point), !is_beaten, "{}", k);
            }
        }
    }
}
