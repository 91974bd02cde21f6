//! All scenes at a glance: cost of every method relative to LBVH, as the paper's table gives it.

use super::figure::{Figure, Fit, Kind, Panel, Point, Series, Value};
use super::runs;
use crate::compare::{Comparison, SceneComparison};
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
#[must_use]
pub fn overview(comparison: &Comparison) -> Option<Figure> {
    let overview = relative_costs(comparison);
    let methods: Vec<&MethodOverview> = overview.methods.iter().filter(|method| method.mean.is_some()).collect();
    let series = |(column, &scene): (usize, &usize)| {
        let mut name = comparison.scenes[scene].name.clone();
        if overview.scenes.iter().any(|&other| other != scene && comparison.scenes[other].name == name) {
            name = format!("{name}, scene {}", scene + 1);
        }
        let point = |(k, method): (usize, &&MethodOverview)| {
            let ratio = method.ratios[column]?;
            let values = [Value::Text(method.name.clone()), Value::Text(name.clone()), Value::Number(ratio)];
            Some(Point::new(ratio, k as f64, values))
        };
        let points: Vec<Point> = methods.iter().enumerate().filter_map(point).collect();
        Series::new(name, Kind::Points, points)
    };
    let row = |method: &&MethodOverview| {
        format!("{}:\u{2002}{:.3}", format::shortened(&method.name, 34), method.mean.unwrap_or(f64::NAN))
    };
    let panel = Panel::new(
        "",
        ("SAH cost / SAH cost of LBVH (no unit)", Fit::Around),
        ("", Fit::Names(methods.iter().map(row).collect())),
        overview.scenes.iter().enumerate().map(series).collect(),
    );
    let figure = Figure {
        name: "overview",
        title: "SAH cost relative to LBVH".to_owned(),
        subject: format!("scenes: {}; the number after a method is its geometric mean", overview.scenes.len()),
        caption: "Every mark is a scene: the cost of the method's tree with one triangle per leaf, divided by that of LBVH. Further left is \
                  better."
            .to_owned(),
        columns: vec!["method", "scene", "cost / cost of LBVH"],
        panels: vec![panel],
        ..Figure::default()
    };
    figure.finished()
}
