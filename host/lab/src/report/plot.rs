//! `convergence.svg`: cost and relative error against run time.

use super::RunReport;
use super::axis::Axis;
use crate::accuracy::AccuracyReport;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use prbvh::format;
use prbvh::optimize::IterationRow;

/// Pixels. Coordinates are whole pixels, so the picture is large; it is scaled where it is shown.
const SIZE: (u32, u32) = (1600, 720);
const INK: RGBColor = RGBColor(0, 0, 0);
const GRID: RGBColor = RGBColor(218, 218, 218);
const NOTE: RGBColor = RGBColor(90, 90, 90);
/// Ratio of the last to the first time above which a linear axis would crowd the early iterations.
const LONG_RUN: f64 = 30.0;

/// A plot that could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("the plot could not be drawn: {0}")]
pub struct PlotError(pub(crate) String);

/// A curve with text at some of its points.
struct Panel {
    title: &'static str,
    x: Axis,
    y: Axis,
    x_title: &'static str,
    y_title: &'static str,
    points: Vec<(f64, f64)>,
    labels: Vec<(f64, f64, String)>,
    /// Crosses on the same axes, and their name.
    beside: Option<(&'static str, Vec<(f64, f64)>)>,
}

/// Draws SAH cost and relative error of `report.rows` against the run time. It needs no font on this machine and no colour.
///
/// # Errors
/// If the drawing library fails.
pub fn convergence(report: &RunReport) -> Result<String, PlotError> {
    let mut svg = String::new();
    draw(report, &mut svg).map_err(|error| PlotError(error.to_string()))?;
    Ok(svg)
}

type Failure = Box<dyn std::error::Error>;

fn draw(report: &RunReport, svg: &mut String) -> Result<(), Failure> {
    let root = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let triangles = format::count(report.triangles.into());
    let title = format!("{}, {triangles} triangles", format::shortened(&report.scene, 80));
    let left = |size, colour: &RGBColor| font(size, colour).pos(Pos::new(HPos::Left, VPos::Top));
    root.draw_text(&title, &left(34, &INK), (40, 22))?;
    root.draw_text(&format::shortened(&report.device, 110), &left(24, &NOTE), (40, 66))?;

    let rows: Vec<&IterationRow> =
        report.rows.iter().filter(|row| row.cost.is_finite() && row.time_s.is_finite()).collect();
    let panels = [cost_panel(&rows), error_panel(&rows, report.accuracy.as_ref())];
    root.draw_text(&notes(&panels[1]), &left(20, &NOTE), (40, SIZE.1 as i32 - 36))?;
    let plots = root.margin(104, 50, 20, 20).split_evenly((1, 2));
    for (area, panel) in plots.iter().zip(&panels) {
        draw_panel(area, panel)?;
    }
    root.present()?;
    Ok(())
}

fn cost_panel(rows: &[&IterationRow]) -> Panel {
    let x = Axis::from_zero(rows.iter().map(|row| row.time_s));
    let y = Axis::around(rows.iter().map(|row| row.cost));
    let cost = |row: &IterationRow| format!("{:.2}", row.cost);
    let mut labels = Vec::new();
    let best = rows.iter().copied().reduce(|best, row| if row.cost < best.cost { row } else { best });
    if let (Some(first), Some(best)) = (rows.first(), best) {
        if best.iteration == first.iteration {
            labels.push((best.time_s, best.cost, format!("initial and best {}", cost(best))));
        } else {
            labels.push((first.time_s, first.cost, format!("initial {}", cost(first))));
            labels.push((best.time_s, best.cost, format!("best {}, iteration {}", cost(best), best.iteration)));
        }
    }
    let points = rows.iter().map(|row| (row.time_s, row.cost)).collect();
    Panel {
        title: "SAH cost",
        x,
        y,
        x_title: "run time (s)",
        y_title: "SAH cost (no unit)",
        points,
        labels,
        beside: None,
    }
}

/// The error against the best cost, and beside it that of the numbers if they were checked.
fn error_panel(rows: &[&IterationRow], accuracy: Option<&AccuracyReport>) -> Panel {
    let times = || rows.iter().map(|row| row.time_s).filter(|&time| time > 0.0);
    let first = times().fold(f64::INFINITY, f64::min);
    let last = times().fold(0.0, f64::max);
    let (x, x_title) = if last > LONG_RUN * first {
        (Axis::log_time(times()), "run time (s, logarithmic)")
    } else {
        (Axis::from_zero(times()), "run time (s)")
    };
    let close =
        rows.iter().find(|row| row.relative_error <= 0.01).filter(|row| row.time_s > 0.0 && row.relative_error > 0.0);
    let label = |row: &&IterationRow| {
        let text = format!("within 1 % after {}, iteration {}", format::seconds(row.time_s), row.iteration);
        (row.time_s, row.relative_error, text)
    };
    let numerical = |accuracy: &AccuracyReport| -> Vec<(f64, f64)> {
        let errors = accuracy.rows.iter().filter(|row| row.cost_error.is_finite() && row.time_s.is_finite());
        errors.map(|row| (row.time_s, row.cost_error)).collect()
    };
    let beside = accuracy.map(|accuracy| ("× f32 cost against f64", numerical(accuracy)));
    let besides = beside.iter().flat_map(|(_, points)| points.iter().map(|&(_, error)| error));
    Panel {
        title: "relative error: cost / best cost − 1",
        x,
        y: Axis::log(rows.iter().map(|row| row.relative_error).chain(besides)),
        x_title,
        y_title: "relative error (no unit, logarithmic)",
        points: rows.iter().map(|row| (row.time_s, row.relative_error)).collect(),
        labels: close.map(label).into_iter().collect(),
        beside,
    }
}

/// What a logarithm cannot show and where it went.
fn notes(panel: &Panel) -> String {
    let mut notes = Vec::new();
    if panel.points.iter().any(|&(_, y)| panel.y.clips(y)) {
        notes.push(
            "Hollow points have an error of 0 (the best cost) or below the axis, and are drawn on its lower edge.",
        );
    }
    if panel.points.iter().any(|&(x, _)| panel.x.clips(x)) {
        notes.push("The initial tree, at time 0, is drawn on the left edge.");
    }
    notes.join(" ")
}

fn font(size: i32, colour: &RGBColor) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(colour)
}

fn draw_panel<'a>(area: &DrawingArea<SVGBackend<'a>, plotters::coord::Shift>, panel: &Panel) -> Result<(), Failure> {
    let mut chart = ChartBuilder::on(area)
        .caption(panel.title, font(26, &INK))
        .margin(16)
        .x_label_area_size(76)
        .y_label_area_size(104)
        .build_cartesian_2d(panel.x.range(), panel.y.range())?;
    chart
        .configure_mesh()
        .max_light_lines(1)
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(INK)
        .x_labels(panel.x.labels(7))
        .y_labels(panel.y.labels(9))
        .x_label_formatter(&|&at| panel.x.label(at))
        .y_label_formatter(&|&at| panel.y.label(at))
        .label_style(font(21, &INK))
        .axis_desc_style(font(22, &INK))
        .x_desc(panel.x_title)
        .y_desc(panel.y_title)
        .draw()?;

    let placed = || panel.points.iter().map(|&(x, y)| (panel.x.place(x), panel.y.place(y)));
    chart.draw_series(LineSeries::new(placed(), INK.stroke_width(2)))?;
    // Many points would run together into a band.
    let radius = if panel.points.len() > 150 { 3 } else { 5 };
    let hollow = |y: f64| panel.y.clips(y);
    chart.draw_series(placed().zip(&panel.points).map(|(at, &(_, y))| {
        let style = if hollow(y) { WHITE.filled() } else { INK.filled() };
        Circle::new(at, radius, style)
    }))?;
    let zeros = placed().zip(&panel.points).filter(|&(_, &(_, y))| hollow(y));
    chart.draw_series(zeros.map(|(at, _)| Circle::new(at, radius, INK.stroke_width(2))))?;

    if let Some((name, points)) = &panel.beside {
        let at = |&(x, y): &(f64, f64)| (panel.x.place(x), panel.y.place(y));
        chart.draw_series(points.iter().map(|point| Cross::new(at(point), 5, NOTE.stroke_width(2))))?;
        if let Some(last) = points.last() {
            let style = font(22, &NOTE).pos(Pos::new(HPos::Right, VPos::Bottom));
            chart.draw_series([EmptyElement::at(at(last)) + Text::new(*name, (0, -14), style)])?;
        }
    }

    let middle = (panel.x.range().start + panel.x.range().end) / 2.0;
    for (x, y, text) in &panel.labels {
        let at = (panel.x.place(*x), panel.y.place(*y));
        // Inwards; curves fall, so there is room to the upper right and the lower left.
        let (side, shift) = if at.0 > middle { (HPos::Right, (-16, 14)) } else { (HPos::Left, (14, -14)) };
        let low = panel.y.place(*y) < panel.y.range().start + 0.1 * (panel.y.range().end - panel.y.range().start);
        let (shift, from) = match side {
            HPos::Right if low => ((0, -18), VPos::Bottom),
            HPos::Right => (shift, VPos::Top),
            _ => (shift, VPos::Bottom),
        };
        let style = font(22, &INK).pos(Pos::new(side, from));
        chart.draw_series([Circle::new(at, 10, INK.stroke_width(2))])?;
        chart.draw_series([EmptyElement::at(at) + Text::new(text.clone(), shift, style)])?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::testing::report;
    use super::*;
    use crate::accuracy::AccuracyRow;
    use prbvh::optimize::set_relative_errors;

    /// Points of both panels; rings around labelled ones are not filled.
    fn points(svg: &str) -> usize {
        let document = roxmltree::Document::parse(svg).unwrap();
        let circles = document.descendants().filter(|node| node.has_tag_name("circle"));
        circles.filter(|circle| circle.attribute("fill") != Some("none")).count()
    }

    fn texts(svg: &str) -> Vec<String> {
        let document = roxmltree::Document::parse(svg).unwrap();
        let texts = document.descendants().filter(|node| node.has_tag_name("text"));
        texts.map(|node| node.text().unwrap_or_default().trim().to_owned()).collect()
    }

    fn with_costs(costs: &[f64]) -> RunReport {
        let mut report = report(costs.len() as u32 - 1);
        for (row, cost) in report.rows.iter_mut().zip(costs) {
            row.cost = *cost;
        }
        set_relative_errors(&mut report.rows);
        report
    }

    #[test]
    fn every_row_is_a_point_in_both_panels() {
        for iterations in [0, 1, 2, 40, 500] {
            let svg = convergence(&report(iterations)).unwrap();
            assert_eq!(points(&svg), 2 * (iterations as usize + 1));
        }
    }

    #[test]
    fn checked_numbers_are_crosses_beside_the_error() {
        let lines = |svg: &str| svg.matches("<line").count() + svg.matches("<polyline").count();
        let plain = report(20);
        let mut checked = report(20);
        let row = |row: &IterationRow| AccuracyRow {
            iteration: row.iteration,
            time_s: row.time_s,
            exact_cost: row.cost,
            cost_error: 1e-7,
            cost_bound: 1e-5,
            predicted_decrease: 0.0,
            measured_decrease: 0.0,
            prediction_bound: None,
            search: None,
        };
        let rows = plain.rows.iter().map(row).collect();
        checked.accuracy = Some(AccuracyReport { search: None, breaches: Vec::new(), rows });
        let [without, with] = [plain, checked].map(|report| convergence(&report).unwrap());
        assert!(lines(&with) >= lines(&without) + 21, "{} and {}", lines(&with), lines(&without));
        let named = |svg: &str| texts(svg).iter().any(|text| text.contains("f32 cost against f64"));
        assert!(named(&with) && !named(&without));
        assert_eq!(points(&with), points(&without));
    }

    #[test]
    fn scene_device_and_units_are_named() {
        let texts = texts(&convergence(&report(40)).unwrap()).join("\n");
        for part in
            ["sponza_crytek, 262,267 triangles", "AMD EPYC", "run time (s)", "SAH cost", "initial 312.50", "best 195."]
        {
            assert!(texts.contains(part), "{part} is not in\n{texts}");
        }
    }

    #[test]
    fn equal_costs_and_costs_without_sense_are_drawn() {
        assert_eq!(points(&convergence(&with_costs(&[5.0; 4])).unwrap()), 8);
        assert_eq!(points(&convergence(&with_costs(&[0.0; 3])).unwrap()), 6);
        assert_eq!(points(&convergence(&with_costs(&[1e30, 1e-30, 3.0])).unwrap()), 6);
        // What is no number has no place.
        assert_eq!(points(&convergence(&with_costs(&[f64::NAN, 4.0, f64::INFINITY])).unwrap()), 2);
        let mut nothing = report(0);
        nothing.rows.clear();
        assert_eq!(points(&convergence(&nothing).unwrap()), 0);
    }

    #[test]
    fn clipping_is_said() {
        let said = |report: &RunReport| texts(&convergence(report).unwrap()).join(" ");
        assert!(said(&report(40)).contains("Hollow points have an error of 0"));
        assert!(said(&report(400)).contains("at time 0, is drawn on the left edge"));
        assert!(!said(&report(4)).contains("left edge"));
    }

    #[test]
    fn names_are_escaped_and_shortened() {
        let mut report = report(3);
        report.scene = "<a & b> \"ü\"".to_owned();
        report.device = "long ".repeat(100);
        let texts = texts(&convergence(&report).unwrap());
        assert!(texts.iter().any(|text| text.starts_with("<a & b> \"ü\", 262,267")), "{texts:?}");
        assert!(texts.iter().all(|text| text.chars().count() <= 120));
    }
}
