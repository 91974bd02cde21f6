//! All scenes at a glance: cost of every method relative to LBVH, as the paper's table gives it.

use super::chart::Chart;
use super::panel::{Curve, Names, Panel, Point};
use super::style::Style;
use super::ticks::Tick;
use super::{Figure, Value, runs};
use crate::compare::{Comparison, SceneComparison};
use crate::report::axis::Axis;
use crate::report::plot::PlotError;
use prbvh::format;

/// Method of the rows that all are compared with.
const REFERENCE: &str = "lbvh";

/// Costs relative to LBVH: a row per method, a column per scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Overview {
    /// Scenes that have a cost of LBVH, by their place in the comparison.
    pub scenes: Vec<usize>,
    /// Methods in the order in which they first appear.
    pub methods: Vec<MethodOverview>,
}

/// A method over all scenes.
#[derive(Clone, Debug, PartialEq)]
pub struct MethodOverview {
    /// Method, with µ.
    pub name: String,
    /// Cost / cost of LBVH for each of [`Overview::scenes`], unitless.
    pub ratios: Vec<Option<f64>>,
    /// Geometric mean of those that are there, unitless.
    pub mean: Option<f64>,
}

/// Costs relative to LBVH, one triangle per leaf. Where a method has rows for several devices the first with a cost counts.
#[must_use]
pub fn relative_costs(comparison: &Comparison) -> Overview {
    let all = || comparison.scenes.iter().enumerate();
    let scenes: Vec<usize> = all().filter(|(_, scene)| reference(scene).is_some()).map(|(k, _)| k).collect();
    let mut names: Vec<String> = Vec::new();
    for row in comparison.scenes.iter().flat_map(|scene| &scene.rows) {
        let name = runs::method(&row.method, row.mu);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let method = |name: String| {
        let ratio = |&k: &usize| {
            let scene = &comparison.scenes[k];
            let cost =
                scene.rows.iter().filter(|row| runs::method(&row.method, row.mu) == name).find_map(|row| row.cost);
            Some(cost? / reference(scene)?).filter(|ratio| ratio.is_finite() && *ratio > 0.0)
        };
        let ratios: Vec<Option<f64>> = scenes.iter().map(ratio).collect();
        let logs: Vec<f64> = ratios.iter().flatten().map(|ratio| ratio.ln()).collect();
        let mean = (!logs.is_empty()).then(|| (logs.iter().sum::<f64>() / logs.len() as f64).exp());
        MethodOverview { name, ratios, mean }
    };
    let methods = names.into_iter().map(method).collect();
    Overview { scenes, methods }
}

fn reference(scene: &SceneComparison) -> Option<f64> {
    scene.rows.iter().filter(|row| row.method == REFERENCE).find_map(|row| row.cost).filter(|&cost| cost > 0.0)
}

/// Cost relative to LBVH, a row of marks per method. None without a cost of LBVH.
///
/// # Errors
/// If the drawing library fails.
pub fn overview(comparison: &Comparison) -> Result<Option<Figure>, PlotError> {
    let overview = relative_costs(comparison);
    let methods: Vec<&MethodOverview> = overview.methods.iter().filter(|method| method.mean.is_some()).collect();
    // The first method is on top.
    let height_of = |k: usize| (methods.len() - k) as f64;
    let point = |k: usize, scene: &str, ratio: f64| Point {
        x: ratio,
        y: height_of(k),
        values: vec![Value::Text(methods[k].name.clone()), Value::Text(scene.to_owned()), Value::Number(ratio)],
    };
    let mut curves: Vec<Curve> = Vec::new();
    for (column, &scene) in overview.scenes.iter().enumerate() {
        let name = &comparison.scenes[scene].name;
        let points = methods.iter().enumerate().filter_map(|(k, method)| Some(point(k, name, method.ratios[column]?)));
        curves.push(Curve { name: name.clone(), style: Style(column), joined: false, points: points.collect() });
    }
    let ratios = || curves.iter().flat_map(|curve| &curve.points).map(|point| point.x);
    let tick = |(k, method): (usize, &&MethodOverview)| Tick {
        at: height_of(k),
        text: format!("{}:\u{2002}{:.3}", format::shortened(&method.name, 34), method.mean.unwrap_or(f64::NAN)),
    };
    let rows = methods.len() as f64;
    let panel = Panel {
        heading: String::new(),
        x: Axis::around(ratios()),
        y: Axis::between(0.3, rows + 0.7),
        x_title: "SAH cost / SAH cost of LBVH (no unit)".to_owned(),
        y_title: String::new(),
        x_ticks: None,
        y_ticks: Some(methods.iter().enumerate().map(tick).collect()),
        names: Names::Listed,
        curves,
    };
    let chart = Chart {
        name: "overview",
        heading: "SAH cost relative to LBVH".to_owned(),
        subject: format!("scenes: {}; the number after a method is its geometric mean", overview.scenes.len()),
        caption: "Every mark is a scene: the cost of the method's tree with one triangle per leaf, divided by that of LBVH. Further left is \
                  better."
            .to_owned(),
        note: String::new(),
        height: 250 + (44 * methods.len() as u32).max(32 * overview.scenes.len().min(40) as u32),
        columns: &["method", "scene", "cost / cost of LBVH"],
        panels: vec![panel],
    };
    chart.draw()
}
