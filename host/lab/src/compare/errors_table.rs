//! The second table of a scene on the terminal: time to within 10 %, 5 %, 2 %, 1 % and 0.1 % of the lowest cost known.

use super::data::with_mu;
use super::fitted::{Fitted, fitted};
use super::{LEVELS, SceneComparison, SettingErrors};
use prbvh::format;

/// A row per method, µ and device, at most `width` columns wide where two columns fit, and lines with the reference and the Pareto front.
/// None if no cost is known.
#[must_use]
pub fn errors_table(scene: &SceneComparison, width: u16) -> Option<String> {
    let errors = scene.errors.as_ref().filter(|errors| !errors.settings.is_empty())?;
    let settings = &errors.settings;
    let column = |header: String, rank, is_text, cell: &dyn Fn(usize, &SettingErrors) -> String| {
        let cells = settings.iter().enumerate().map(|(k, setting)| cell(k, setting)).collect();
        Fitted { header, rank, is_text, cells }
    };
    let time = |time: Option<f64>| time.map_or_else(|| "-".to_owned(), format::seconds);
    let mut columns = vec![
        column("method".to_owned(), 0, true, &|_, s| format::shortened(&s.method, 36)),
        column("µ".to_owned(), 2, false, &|_, s| if s.mu > 0 { s.mu.to_string() } else { "-".to_owned() }),
    ];
    if settings.iter().any(|setting| setting.device != settings[0].device) {
        columns.push(column("device".to_owned(), 3, true, &|_, s| format::shortened(&s.device, 14)));
    }
    columns.push(column("error".to_owned(), 1, false, &|k, s| {
        let mark = if errors.pareto_front.contains(&k) { "*" } else { "" };
        format!("{mark}{}", percent(s.error))
    }));
    for (k, level) in (0u32..).zip(LEVELS) {
        let at = k as usize;
        columns.push(column(format!("to {}", short(level)), 4 + k, false, &|_, s| time(s.time_to.wall_s[at])));
    }
    if settings.iter().any(|setting| setting.time_to.device_s.iter().any(Option::is_some)) {
        for (k, level) in (0u32..).zip(LEVELS) {
            let at = k as usize;
            let header = format!("kernels to {}", short(level));
            columns.push(column(header, 14 - k, false, &|_, s| time(s.time_to.device_s[at])));
        }
    }
    let (table, left_out) = fitted(columns, width);
    let reference = &errors.reference;
    let mut text = format!(
        "error = cost ÷ lowest known - 1; lowest known: {:.3} ({})\n{table}\n",
        reference.reference_cost, reference.source
    );
    let front: Vec<String> = errors.front().map(|setting| name(setting, settings)).collect();
    text.push_str(&format!("* Pareto front of time and error: {}\n", front.join("; ")));
    if !left_out.is_empty() {
        text.push_str(&format!("no room for: {}\n", left_out.join(", ")));
    }
    Some(text)
}

/// Method and µ, and the device where that would be the name of several.
fn name(setting: &SettingErrors, all: &[SettingErrors]) -> String {
    let same = |other: &SettingErrors| (&other.method, other.mu) == (&setting.method, setting.mu);
    let twice = all.iter().any(|other| same(other) && other.device != setting.device);
    let device = if twice { format!(" on {}", format::shortened(&setting.device, 24)) } else { String::new() };
    format!("{}{device}", with_mu(&setting.method, (setting.mu > 0).then_some(setting.mu)))
}

fn short(level: f64) -> String {
    format!("{} %", 100.0 * level)
}

fn percent(error: f64) -> String {
    format!("{:.2} %", 100.0 * error)
}

#[cfg(test)]
mod tests {
    use super::super::{OptimizerRun, Purpose};
    use super::*;
    use prbvh::optimize::IterationRow;

    fn scene() -> SceneComparison {
        let run = |method: &str, mu, build_s, cost: f64| OptimizerRun {
            method: method.to_owned(),
            purpose: Purpose::Table,
            initial: "lbvh".to_owned(),
            strategy: String::new(),
            mu,
            device: "gpu".to_owned(),
            build_s,
            build_device_s: Some(0.5 * build_s),
            rows: vec![IterationRow::default().with(|row| row.cost = cost)],
            phases: Vec::new(),
            plan: Vec::new(),
        };
        let runs = vec![run("lbvh", 0, 0.5, 108.0), run("slow", 0, 3.0, 107.0), run("prbvh", 9, 2.0, 100.0)];
        let (name, hash, pictures, rows) = ("hall".to_owned(), String::new(), Vec::new(), Vec::new());
        let mut scene =
            SceneComparison { name, hash, triangles: 9, notes: Vec::new(), rows, runs, errors: None, pictures };
        scene.set_errors(None);
        scene
    }

    #[test]
    fn it_says_times_reference_and_front_and_fits() {
        let scene = scene();
        let text = errors_table(&scene, 200).unwrap();
        for part in
            ["100.000 (prbvh, this comparison)", "*8.00 %", " 7.00 %", "*0.00 %", "500 ms", "250 ms", "to 0.1 %"]
        {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert!(text.contains("error: lbvh; prbvh µ=9\n") && !text.contains("no room"), "{text}");
        for width in [30u16, 60, 80, 100] {
            let text = errors_table(&scene, width).unwrap();
            let lines = text.lines().filter(|line| line.starts_with('─') || line.contains("lbvh "));
            assert!(lines.clone().count() >= 3 && text.contains("no room for: "), "{text}");
            assert!(lines.map(|line| line.chars().count()).max().unwrap() <= width.into(), "{width}: {text}");
        }
    }

    #[test]
    fn devices_are_named_where_there_are_several() {
        let mut scene = scene();
        scene.runs.push(OptimizerRun { device: "cpu".to_owned(), build_s: 0.1, ..scene.runs[0].clone() });
        scene.set_errors(None);
        let text = errors_table(&scene, 200).unwrap();
        assert!(text.contains("device") && text.contains("error: lbvh on cpu; prbvh µ=9\n"), "{text}");
        scene.errors = None;
        assert_eq!(errors_table(&scene, 200), None);
    }
}
