//! The curves of a panel and their names, as SVG; and where their points are, for the page.

use super::labels::{Labels, Rect};
use super::panel::{Curve, Names, Panel, Place};
use super::svg::{Font, escaped};
use super::thin::thinned;
use super::{Hover, HoverPoint};
use prbvh::format;
use std::fmt::Write;

/// Room of a list of names, pixels.
pub(super) const LIST: u32 = 300;
/// Longest name, characters.
const NAME: usize = 30;
/// Pixels from a name of the list to the next.
const LIST_STEP: f64 = 30.0;
/// Half a mark, pixels.
const MARK: f64 = 6.0;

/// A curve's drawn points with their indices.
struct Drawn<'a> {
    curve: &'a Curve,
    points: Vec<(f64, f64)>,
    kept: Vec<usize>,
}

/// Writes the layer and returns its points.
pub(super) fn draw(panel: &Panel, place: &Place, out: &mut String) -> Vec<Hover> {
    let drawn: Vec<Drawn<'_>> = panel.curves.iter().map(|curve| drawn(panel, place, curve)).collect();
    for Drawn { curve, points, .. } in &drawn {
        let _ = write!(out, "\n<g class=\"curve\"><title>{}</title>", escaped(&curve.name));
        if curve.joined && points.len() > 1 {
            line(out, curve, points);
        }
        let single = points.len() == 1 || !curve.joined;
        let every = if points.len() <= 30 { 1 } else { points.len().div_ceil(9) };
        for (k, &(x, y)) in points.iter().enumerate() {
            if single || k % every == 0 || k + 1 == points.len() {
                curve.style.mark(out, x, y, if single { 7.0 } else { 5.0 });
            }
        }
        out.push_str("</g>");
    }
    match panel.names {
        Names::Beside => beside(&drawn, place, out),
        Names::Listed => listed(&drawn, place, out),
    }
    drawn.into_iter().map(hover).collect()
}

fn drawn<'a>(panel: &Panel, place: &Place, curve: &'a Curve) -> Drawn<'a> {
    let [left, top, right, bottom] = place.plot;
    let share = |axis: &crate::report::axis::Axis, value: f64| {
        let range = axis.range();
        (axis.place(value) - range.start) / (range.end - range.start)
    };
    let at = |x, y| (left + share(&panel.x, x) * (right - left), bottom - share(&panel.y, y) * (bottom - top));
    let points: Vec<(f64, f64)> = curve.points.iter().map(|point| at(point.x, point.y)).collect();
    let kept = if curve.joined { thinned(&points) } else { (0..points.len()).collect() };
    Drawn { curve, points: kept.iter().map(|&k| points[k]).collect(), kept }
}

fn line(out: &mut String, curve: &Curve, points: &[(f64, f64)]) {
    let (colour, dashes) = (curve.style.colour(), curve.style.dashes());
    let _ = write!(out, r#"<polyline fill="none" stroke="{colour}" stroke-width="2.5" stroke-linejoin="round""#);
    if !dashes.is_empty() {
        let _ = write!(out, r#" stroke-dasharray="{dashes}""#);
    }
    out.push_str(" points=\"");
    for (x, y) in points {
        let _ = write!(out, "{x:.1},{y:.1} ");
    }
    out.push_str("\"/>");
}

fn beside(drawn: &[Drawn<'_>], place: &Place, out: &mut String) {
    let [left, top, _, bottom] = place.plot;
    let mut labels = Labels::new(Rect { x0: left + 2.0, y0: top, x1: place.right, y1: bottom - 2.0 });
    for Drawn { curve, points, .. } in drawn {
        if curve.joined {
            points.windows(2).for_each(|pair| labels.line(pair[0], pair[1]));
        }
        for &(x, y) in points.iter().filter(|_| points.len() <= 30) {
            labels.mark(x, y, 7.0);
        }
        if let Some(&(x, y)) = points.last() {
            labels.mark(x, y, 9.0);
        }
    }
    for Drawn { curve, points, .. } in drawn {
        let Some(&(x, y)) = points.last() else { continue };
        let name = format::shortened(&curve.name, NAME);
        let width = name.chars().count() as f64 * Font::TEXT.advance() + 4.0;
        let height = 1.25 * Font::TEXT.pixels();
        // Without room on the page the name is in the title of the curve alone.
        let Some(placed) = labels.place((x, y), width, height) else { continue };
        if let Some(to) = placed.leader {
            leader(out, (x, y), to, curve.style.colour());
        }
        let middle = 0.5 * (placed.rect.y0 + placed.rect.y1);
        // On the side of the point, where it does not matter that the width was guessed.
        let (anchor, edge) = if placed.rect.x1 <= x { ("end", placed.rect.x1) } else { ("start", placed.rect.x0) };
        text(out, &name, edge, middle, anchor, curve.style.colour());
    }
}

/// A thin line from the edge of the mark at `from`.
fn leader(out: &mut String, from: (f64, f64), to: (f64, f64), colour: &str) {
    let length = (to.0 - from.0).hypot(to.1 - from.1).max(1.0);
    let start = (MARK / length).min(1.0);
    let (x, y) = (from.0 + start * (to.0 - from.0), from.1 + start * (to.1 - from.1));
    let _ = write!(
        out,
        "\n<line x1=\"{x:.1}\" y1=\"{y:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"{colour}\" stroke-width=\"1.5\"/>",
        to.0, to.1
    );
}

fn listed(drawn: &[Drawn<'_>], place: &Place, out: &mut String) {
    let [_, top, right, bottom] = place.plot;
    let room = ((bottom - top) / LIST_STEP).floor().max(1.0) as usize;
    for (k, Drawn { curve, .. }) in drawn.iter().enumerate().take(room) {
        let y = top + LIST_STEP * (k as f64 + 0.5);
        if k + 1 == room && drawn.len() > room {
            text(out, &format!("and {} more", drawn.len() - k), right + 46.0, y, "start", "#000000");
            break;
        }
        curve.style.mark(out, right + 28.0, y, 7.0);
        text(out, &format::shortened(&curve.name, 22), right + 46.0, y, "start", curve.style.colour());
    }
}

/// A name with a white rim, in the middle of its height at `y`.
fn text(out: &mut String, name: &str, x: f64, y: f64, anchor: &str, colour: &str) {
    let size = Font::TEXT.pixels();
    let _ = write!(
        out,
        "\n<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\" font-family=\"sans-serif\" font-size=\"{size:.1}\" fill=\"{colour}\" \
         stroke=\"#ffffff\" stroke-width=\"5\" stroke-linejoin=\"round\" paint-order=\"stroke\">{}</text>",
        y + 0.35 * size,
        escaped(name)
    );
}

fn hover(drawn: Drawn<'_>) -> Hover {
    let Drawn { curve, points, kept } = drawn;
    let points = points.into_iter().zip(kept).map(|((x, y), k)| HoverPoint::new(x, y, &curve.points[k].values));
    Hover { name: curve.name.clone(), points: points.collect() }
}
