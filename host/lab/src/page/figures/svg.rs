//! A figure as an SVG file: what the page shows without scripts and on paper.
//!
//! Axes are drawn by plotters. The series are a layer of our own over them: one SVG element per line with its pattern of dashes, where the
//! library would cut every dash into an element.

use super::figure::{Figure, Kind, LIST_STEP, Panel, Point, Scale, Series, WIDTH};
use super::style::Look;
use crate::report::plot::PlotError;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use prbvh::format;
use std::fmt::Write;

/// Room for the titles above and the note below.
const HEAD: u32 = 96;
const FOOT: u32 = 44;
/// Room for the list of names.
const LIST: u32 = 330;
const GRID: RGBColor = RGBColor(222, 222, 222);
const NOTE: RGBColor = RGBColor(80, 80, 80);
const TEXT_SIZE: i32 = 23;
/// `font-size` that the drawing library makes of that.
const TEXT_PIXELS: f64 = TEXT_SIZE as f64 / 1.24;
/// About the width of a character, pixels. There is no font to measure: this is wide for most.
const ADVANCE: f64 = 0.59 * TEXT_PIXELS;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Failure = Box<dyn std::error::Error>;

/// Draws the figure. It needs no font on this machine.
///
/// # Errors
/// If the drawing library fails.
pub fn svg(figure: &Figure) -> Result<String, PlotError> {
    let (mut drawn, mut layer) = (String::new(), String::new());
    draw(figure, &mut drawn, &mut layer).map_err(|error| PlotError(error.to_string()))?;
    let title = escaped(&format!("{}: {}", figure.subject, figure.title));
    let head = format!("<svg role=\"img\" aria-label=\"{title}\" ");
    let drawn = drawn.replacen("<svg ", &head, 1);
    let (open, body) = drawn.split_at(drawn.find('>').map_or(0, |end| end + 1));
    let body = body.trim_end().strip_suffix("</svg>").unwrap_or(body);
    Ok(format!("{open}\n<title>{title}</title>\n<desc>{}</desc>{body}{layer}\n</svg>\n", escaped(&figure.caption)))
}

fn draw(figure: &Figure, text: &mut String, layer: &mut String) -> Result<(), Failure> {
    let names = figure.listed();
    let height = HEAD + FOOT + figure.rows.iter().sum::<u32>();
    let root = SVGBackend::with_string(text, (WIDTH, height)).into_drawing_area();
    root.fill(&WHITE)?;
    root.draw_text(&clean(&figure.title, 80), &left(34, &BLACK), (40, 20))?;
    root.draw_text(&clean(&figure.subject, 110), &left(22, &NOTE), (40, 62))?;
    root.draw_text(&figure.note, &left(22, &NOTE), (40, height as i32 - 36))?;
    let room = if names.is_empty() { 16 } else { LIST };
    let (_, mut rest) = root.margin(0, FOOT, 16, room).split_vertically(HEAD);
    for (row, panels) in figure.rows.iter().zip(figure.panels.chunks(figure.across)) {
        let (row, below) = rest.split_vertically(*row);
        for (area, panel) in row.split_evenly((1, figure.across)).iter().zip(panels) {
            draw_panel(area, panel, layer)?;
        }
        rest = below;
    }
    for ((name, look), k) in names.iter().zip(0..) {
        let y = (HEAD + k * LIST_STEP + LIST_STEP / 2) as i32;
        let x = (WIDTH - LIST) as i32 + 16;
        line(layer, *look, &[(x, y), (x + 48, y)]);
        mark(layer, *look, (x + 24, y));
        write_text(layer, &clean(name, 24), (x + 60, y), look.colour);
    }
    root.present()?;
    Ok(())
}

fn draw_panel(area: &Area<'_>, panel: &Panel, layer: &mut String) -> Result<(), Failure> {
    let (wide, high) = area.dim_in_pixel();
    let (x, y) = (&panel.x, &panel.y);
    let letters = |share: f64| (share * f64::from(wide) / ADVANCE) as usize;
    let most = letters(0.4);
    let longest = y.names.iter().map(|name| name.chars().count().min(most)).max().unwrap_or(6);
    let room = (longest as f64 * ADVANCE) as u32 + if y.title.is_empty() { 12 } else { 48 };
    let mut builder = ChartBuilder::on(area);
    builder.margin(14).margin_right(28).y_label_area_size(room);
    if is_drawn(x) {
        builder.x_label_area_size(64);
    }
    if !panel.heading.is_empty() {
        builder.caption(clean(&panel.heading, letters(0.85)), font(25, &BLACK));
    }
    let mut chart = builder.build_cartesian_2d(x.axis.range(), y.axis.range())?;
    let x_label = |at: &f64| label(x, *at, most);
    let y_label = |at: &f64| label(y, from_top(y, *at), most);
    let mut mesh = chart.configure_mesh();
    mesh.max_light_lines(1)
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(BLACK)
        .label_style(font(TEXT_SIZE, &BLACK))
        .x_labels(labels(x, wide / 130))
        .y_labels(labels(y, high / 70))
        // Farther off than usual: the lowest of both axes would meet in the corner.
        .set_tick_mark_size(LabelAreaPosition::Bottom, 9)
        .x_label_formatter(&x_label)
        .y_label_formatter(&y_label);
    if !is_drawn(x) {
        mesh.disable_x_axis().disable_mesh();
    }
    mesh.x_desc(&x.title).y_desc(&y.title).draw()?;
    let at =
        |x_value: f64, y_value: f64| chart.backend_coord(&(x.axis.place(x_value), from_top(y, y.axis.place(y_value))));
    for series in &panel.series {
        let _ = write!(layer, "\n<g class=\"series\"><title>{}</title>", escaped(&series.name));
        if series.kind == Kind::Bars {
            series.points.iter().for_each(|point| bar(layer, point, at));
        } else {
            draw_series(layer, series, &series.points.iter().map(|point| at(point.x, point.y)).collect::<Vec<_>>());
        }
        layer.push_str("</g>");
    }
    Ok(())
}

fn is_drawn(scale: &Scale) -> bool {
    !(scale.title.is_empty() && scale.names.is_empty())
}

/// Names stand from top to bottom, numbers from bottom to top.
fn from_top(scale: &Scale, at: f64) -> f64 {
    if scale.names.is_empty() { at } else { scale.names.len() as f64 - 1.0 - at }
}

fn labels(scale: &Scale, most: u32) -> usize {
    if scale.names.is_empty() { scale.axis.labels(most as usize) } else { scale.names.len() + 1 }
}

fn label(scale: &Scale, at: f64, most: usize) -> String {
    if scale.names.is_empty() {
        let is_plain = scale.log || at == 0.0 || (1e-6..1e7).contains(&at.abs());
        return if is_plain { scale.axis.label(at) } else { format!("{at:.2e}") };
    }
    let name = if (at - at.round()).abs() < 1e-6 { scale.names.get(at.round() as usize) } else { None };
    name.map_or_else(String::new, |name| clean(name, most))
}

fn draw_series(out: &mut String, series: &Series, points: &[(i32, i32)]) {
    if series.kind == Kind::Line && points.len() > 1 {
        line(out, series.look, points);
    }
    let every = if series.kind == Kind::Points || points.len() <= 30 { 1 } else { points.len().div_ceil(9) };
    for (_, &at) in points.iter().enumerate().filter(|(k, _)| k % every == 0 || k + 1 == points.len()) {
        mark(out, series.look, at);
    }
}

fn line(out: &mut String, look: Look, points: &[(i32, i32)]) {
    let points: Vec<String> = points.iter().map(|(x, y)| format!("{x},{y}")).collect();
    let dashes: Vec<String> = look.dashes.iter().map(ToString::to_string).collect();
    let _ = write!(
        out,
        r#"<polyline fill="none" stroke="{}" stroke-width="2.5" stroke-linejoin="round" stroke-dasharray="{}" points="{}"/>"#,
        look.colour,
        if dashes.is_empty() { "none".to_owned() } else { dashes.join(" ") },
        points.join(" ")
    );
}

fn mark(out: &mut String, look: Look, (x, y): (i32, i32)) {
    let Look { colour, mark, hollow, .. } = look;
    if mark.is_empty() {
        return;
    }
    let fill = if hollow { "#ffffff" } else { colour };
    let _ = write!(
        out,
        r#"<path transform="translate({x} {y})" d="{mark}" fill="{fill}" stroke="{colour}" stroke-width="2"/>"#
    );
}

/// From the left edge to the point, with its text beside.
fn bar(out: &mut String, point: &Point, at: impl Fn(f64, f64) -> (i32, i32)) {
    let ((x, top), (end, bottom)) = (at(0.0, point.y - 0.3), at(point.x, point.y + 0.3));
    let (wide, high) = ((end - x).max(1), bottom - top);
    let _ = write!(out, r##"<rect x="{x}" y="{top}" width="{wide}" height="{high}" fill="#464646"/>"##);
    write_text(out, &point.text, (x + wide + 8, top + high / 2), "#505050");
}

/// Text to the right of the point, in the middle of its height.
fn write_text(out: &mut String, text: &str, (x, y): (i32, i32), colour: &str) {
    let _ = write!(
        out,
        "\n<text x=\"{x}\" y=\"{:.1}\" font-family=\"sans-serif\" font-size=\"{TEXT_PIXELS:.1}\" fill=\"{colour}\">{}</text>",
        f64::from(y) + 0.35 * TEXT_PIXELS,
        escaped(text)
    );
}

fn font(size: i32, ink: &RGBColor) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(ink)
}

/// Below and to the right of the point that it is drawn at.
fn left(size: i32, ink: &RGBColor) -> TextStyle<'static> {
    font(size, ink).pos(Pos::new(HPos::Left, VPos::Top))
}

/// Text of at most so many characters without those that XML does not allow, such as a file's name may have.
fn clean(text: &str, most: usize) -> String {
    let allowed = |c: char| if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') { '\u{fffd}' } else { c };
    format::shortened(text, most).chars().map(allowed).collect()
}

/// For between tags and in attributes.
fn escaped(text: &str) -> String {
    clean(text, usize::MAX).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::super::figure::Fit;
    use super::*;

    fn drawn(panel: Panel) -> String {
        let subject = "a <b> & \"c\"\u{1}".to_owned();
        let figure = Figure { title: "T".to_owned(), subject, panels: vec![panel], ..Figure::default() };
        svg(&figure.finished().unwrap()).unwrap()
    }

    fn texts(svg: &str) -> Vec<String> {
        let document = roxmltree::Document::parse(svg).unwrap();
        let texts = document.descendants().filter(|node| node.has_tag_name("text"));
        texts.map(|node| node.text().unwrap_or_default().trim().to_owned()).collect()
    }

    fn series(kind: Kind, points: impl IntoIterator<Item = (f64, f64)>) -> Vec<Series> {
        vec![Series::new("s", kind, points.into_iter().map(|(x, y)| Point::new(x, y, [])))]
    }

    #[test]
    fn every_point_is_marked_and_of_long_lines_some() {
        let marks = |kind, count: u32| {
            let points = (0..count).map(|k| (f64::from(k), f64::from(k * k % 17)));
            let panel = Panel::new("", ("x", Fit::FromZero), ("y", Fit::Around), series(kind, points));
            // One more in the list of names.
            drawn(panel).matches("<path ").count() - 1
        };
        assert_eq!([marks(Kind::Points, 40), marks(Kind::Line, 20), marks(Kind::Line, 1)], [40, 20, 1]);
        assert!((9..=12).contains(&marks(Kind::Line, 40)));
    }

    #[test]
    fn names_stand_from_top_to_bottom_beside_their_bars() {
        let names = ["first", "second", "third"].map(str::to_owned);
        let bar =
            |(k, name): (usize, &String)| Point { text: format!("{name}'s"), ..Point::new(k as f64, k as f64, []) };
        let bars = vec![Series::new("s", Kind::Bars, names.iter().enumerate().map(bar))];
        let svg = drawn(Panel::new("h", ("", Fit::Between(0.0, 4.0)), ("", Fit::Names(names.to_vec())), bars));
        let document = roxmltree::Document::parse(&svg).unwrap();
        let height = |text: &str| -> f64 {
            let is =
                |node: &roxmltree::Node<'_, '_>| node.has_tag_name("text") && node.text().map(str::trim) == Some(text);
            document.descendants().find(is).unwrap().attribute("y").unwrap().parse().unwrap()
        };
        for name in &names {
            assert!((height(name) - height(&format!("{name}'s"))).abs() < 12.0, "{svg}");
        }
        assert!(height("first") < height("second") && height("second") < height("third"));
        // No numbers: they are in the texts.
        assert_eq!(texts(&svg).iter().filter(|text| !text.is_empty()).count(), 2 + 1 + 3 + 3, "{svg}");
    }

    #[test]
    fn every_range_has_some_numbers_and_not_too_many() {
        for low in [1e-30f64, 1e-6, 0.4, 7.0, 1e12] {
            for factor in [1.0, 1.0001, 1.7, 30.0, 1e9] {
                for fit in [|| Fit::Around, || Fit::FromZero, || Fit::Decades] {
                    let panel = Panel::new(
                        "",
                        ("", Fit::FromZero),
                        ("y", fit()),
                        series(Kind::Line, [(1.0, low), (2.0, low * factor)]),
                    );
                    // Less title, subject, name of the axis, name of the series.
                    let numbers = texts(&drawn(panel)).iter().filter(|text| !text.is_empty()).count() - 4;
                    assert!((1..=14).contains(&numbers), "{low} × {factor}: {numbers}");
                }
            }
        }
    }

    #[test]
    fn texts_stay_texts() {
        let panel = Panel::new("", ("x", Fit::FromZero), ("y", Fit::FromZero), series(Kind::Line, [(1.0, 1.0)]));
        assert!(texts(&drawn(panel)).contains(&"a <b> & \"c\"\u{fffd}".to_owned()));
    }
}
