//! What a figure shows, apart from how it is drawn: the charts of the page and the files beside it are made of the same description.

use super::style::Look;
use super::thin::thinned;
use crate::report::axis::Axis;
use serde::{Serialize, Serializer};

/// Pixels. Coordinates of the drawing library are whole, so the picture is large; it is scaled where it is shown.
pub(super) const WIDTH: u32 = 1600;
/// From an entry of the list of names to the next, pixels.
pub(super) const LIST_STEP: u32 = 30;
/// Pixels of a panel, about: points that would fall on one another there are left out.
const PANEL: (f64, f64) = (1200.0, 700.0);

/// Panels of bars beside one another; of others all are.
const BARS_ACROSS: usize = 3;

/// A figure.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Figure {
    /// Short name in lower case with hyphens, for a file.
    #[serde(skip)]
    pub name: &'static str,
    /// What it shows.
    pub title: String,
    /// Of what: scene and triangles, for one.
    pub subject: String,
    /// How to read it, a sentence or two.
    #[serde(skip)]
    pub caption: String,
    /// Where points stand that have no place on a logarithm; empty: there are none.
    pub note: String,
    /// What the values of a point are, with units.
    pub columns: Vec<&'static str>,
    /// Panels beside one another.
    pub across: usize,
    /// Row by row.
    pub panels: Vec<Panel>,
    /// Heights of the rows, in pixels where a figure is 1600 pixels wide.
    pub rows: Vec<u32>,
}

/// Axes and what is on them.
#[derive(Clone, Debug, Serialize)]
pub struct Panel {
    /// What tells it from the others; may be empty.
    pub heading: String,
    /// To the right.
    pub x: Scale,
    /// Upward; names stand from top to bottom.
    pub y: Scale,
    /// In the order in which they are drawn.
    pub series: Vec<Series>,
}

/// An axis.
#[derive(Clone, Debug, Serialize)]
pub struct Scale {
    /// Quantity and unit. An axis of numbers without a title is not drawn: the numbers stand beside the bars.
    pub title: String,
    /// What stands at 0, 1, …; empty: numbers do.
    pub names: Vec<String>,
    /// Whether it is logarithmic.
    pub log: bool,
    /// Low end of a range that holds the points.
    pub min: f64,
    /// High end.
    pub max: f64,
    #[serde(skip)]
    pub(super) axis: Axis,
    /// Whether a value has no place and stands at the low end.
    #[serde(skip)]
    clips: bool,
}

/// How an axis finds its range.
pub(super) enum Fit {
    FromZero,
    Around,
    /// Logarithmic, in whole decades.
    Decades,
    Between(f64, f64),
    /// A place for each of the names.
    Names(Vec<String>),
}

/// What a series is drawn as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// A line with marks.
    Line,
    /// Marks alone.
    Points,
    /// Bars from the left, each with its text.
    Bars,
}

/// Named points.
#[derive(Clone, Debug, Serialize)]
pub struct Series {
    /// Series of one name look alike and are one entry of the legend.
    pub name: String,
    /// What it is drawn as.
    pub kind: Kind,
    /// Look of all series of the name.
    pub look: Look,
    /// In the order of the line.
    pub points: Vec<Point>,
}

/// A point. As JSON it is one array: x, y, the values, the text.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// In the unit of the axis.
    pub x: f64,
    /// In the unit of the axis.
    pub y: f64,
    /// Values in the order of [`Figure::columns`].
    pub values: Vec<Value>,
    /// What stands beside a bar.
    pub text: String,
}

/// What is said of a point.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// A count.
    Count(u64),
    /// Any other number.
    Number(f64),
    /// A name.
    Text(String),
}

impl Figure {
    /// With looks and notes. None if there is no point.
    pub(super) fn finished(mut self) -> Option<Self> {
        self.panels.retain(|panel| !panel.series.is_empty());
        let clipped = |at: fn(&Panel) -> bool| self.panels.iter().any(at);
        let notes = [
            (clipped(|panel| panel.y.clips), "Points at 0 are drawn on the lower edge."),
            (clipped(|panel| panel.x.clips), "Points at time 0 are drawn on the left edge."),
        ];
        self.note = notes.iter().filter(|(is_said, _)| *is_said).map(|(_, note)| *note).collect::<Vec<_>>().join(" ");
        let has_bars = self.panels.iter().flat_map(|panel| &panel.series).any(|series| series.kind == Kind::Bars);
        self.across = self.panels.len().min(if has_bars { BARS_ACROSS } else { usize::MAX });
        let mut names: Vec<String> = Vec::new();
        let all = self.panels.iter_mut().flat_map(|panel| &mut panel.series);
        for series in all.filter(|series| series.look == Look::default()) {
            let known = names.iter().position(|name| *name == series.name);
            series.look = Look::nth(known.unwrap_or(names.len()));
            if known.is_none() {
                names.push(series.name.clone());
            }
        }
        let height = |row: &[Panel]| row.iter().map(|panel| panel.height(row.len())).max().unwrap_or(0);
        self.rows = self.panels.chunks(self.across.max(1)).map(height).collect();
        let drawn = self.rows.iter().sum();
        let list = LIST_STEP * self.listed().len() as u32;
        if let Some(last) = self.rows.last_mut() {
            *last += list.saturating_sub(drawn);
        }
        (!self.panels.is_empty()).then_some(self)
    }

    /// Series that need a name beside the panels, each once. That of bars stands above them.
    pub(super) fn listed(&self) -> Vec<(&str, Look)> {
        let mut names: Vec<(&str, Look)> = Vec::new();
        for series in self.panels.iter().flat_map(|panel| &panel.series).filter(|series| series.kind != Kind::Bars) {
            if names.iter().all(|(name, _)| *name != series.name) {
                names.push((&series.name, series.look));
            }
        }
        names
    }
}

impl Panel {
    fn height(&self, across: usize) -> u32 {
        match (self.y.names.len() as u32, across) {
            (0, 1) => 720,
            (0, _) => 560,
            (names, _) => 120 + 34 * names,
        }
    }

    /// Titles and ranges of the axes are those of x and y. Points that are no numbers have no place and are left out.
    pub(super) fn new(heading: &str, x: (&str, Fit), y: (&str, Fit), mut series: Vec<Series>) -> Self {
        for series in &mut series {
            series.points.retain(|point| point.x.is_finite() && point.y.is_finite());
        }
        series.retain(|series| !series.points.is_empty());
        let values = |of: fn(&Point) -> f64| series.iter().flat_map(|s| &s.points).map(of).collect::<Vec<_>>();
        let (x, y) = (Scale::new(x, &values(|point| point.x)), Scale::new(y, &values(|point| point.y)));
        for series in series.iter_mut().filter(|series| series.kind == Kind::Line) {
            let place = |point: &Point| (x.share(point.x) * PANEL.0, (1.0 - y.share(point.y)) * PANEL.1);
            let kept = thinned(&series.points.iter().map(place).collect::<Vec<_>>());
            series.points = kept.into_iter().map(|k| series.points[k].clone()).collect();
        }
        for point in series.iter_mut().flat_map(|series| &mut series.points) {
            (point.x, point.y) = (x.clipped(point.x), y.clipped(point.y));
        }
        Self { heading: heading.to_owned(), x, y, series }
    }
}

impl Scale {
    fn new((title, fit): (&str, Fit), values: &[f64]) -> Self {
        let all = values.iter().copied();
        let mut names = Vec::new();
        let axis = match fit {
            Fit::FromZero => Axis::from_zero(all),
            Fit::Around => Axis::around(all),
            Fit::Decades => Axis::log(all),
            Fit::Between(low, high) => Axis::between(low, high),
            Fit::Names(all) => {
                names = all;
                Axis::between(-0.5, names.len() as f64 - 0.5)
            }
        };
        let log = axis.is_log();
        let clips = values.iter().any(|&value| axis.clips(value));
        let end = |at: f64| if log { 10f64.powf(at) } else { at };
        let (min, max) = (end(axis.range().start), end(axis.range().end));
        Self { title: title.to_owned(), names, log, min, max, axis, clips }
    }

    /// Where the value stands, as a share of the axis.
    pub(super) fn share(&self, value: f64) -> f64 {
        let range = self.axis.range();
        (self.axis.place(value) - range.start) / (range.end - range.start)
    }

    fn clipped(&self, value: f64) -> f64 {
        if self.axis.clips(value) { self.min } else { value }
    }
}

impl Series {
    pub(super) fn new(name: impl Into<String>, kind: Kind, points: impl IntoIterator<Item = Point>) -> Self {
        Self { name: name.into(), kind, look: Look::default(), points: points.into_iter().collect() }
    }

    /// With a look that does not follow from its name.
    pub(super) fn looking(self, look: Look) -> Self {
        Self { look, ..self }
    }
}

impl Point {
    pub(super) fn new(x: f64, y: f64, values: impl Into<Vec<Value>>) -> Self {
        Self { x, y, values: values.into(), text: String::new() }
    }
}

impl Serialize for Point {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let numbers = [self.x, self.y].map(Value::Number);
        let text = (!self.text.is_empty()).then(|| Value::Text(self.text.clone()));
        serializer.collect_seq(numbers.iter().chain(&self.values).chain(&text).map(Value::short))
    }
}

impl Value {
    /// Seven digits are enough.
    fn short(&self) -> Self {
        match self {
            Self::Number(number) => Self::Number(format!("{number:.6e}").parse().unwrap_or(*number)),
            other => other.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(panels: Vec<Panel>) -> Option<Figure> {
        Figure { panels, ..Figure::default() }.finished()
    }

    fn series(name: &str, points: &[(f64, f64)]) -> Series {
        Series::new(name, Kind::Line, points.iter().map(|&(x, y)| Point::new(x, y, [])))
    }

    fn logarithmic(all: Vec<Series>) -> Panel {
        Panel::new("", ("x", Fit::Decades), ("y", Fit::Decades), all)
    }

    #[test]
    fn what_has_no_place_is_left_out_or_said() {
        let nothing = series("nothing", &[(f64::NAN, 1.0), (1.0, f64::INFINITY)]);
        assert!(figure(vec![logarithmic(vec![nothing.clone()])]).is_none());
        let some = figure(vec![logarithmic(vec![nothing, series("some", &[(1.0, 0.0), (0.02, 3.0)])])]).unwrap();
        assert_eq!(some.note, "Points at 0 are drawn on the lower edge.");
        let panel = &some.panels[0];
        assert_eq!(panel.series.len(), 1);
        // A decade below the lowest that has a place.
        assert_eq!((panel.y.min, panel.y.max, panel.x.min), (0.1, 10.0, 0.01));
        assert_eq!(serde_json::to_string(&panel.series[0].points).unwrap(), "[[1.0,0.1],[0.02,3.0]]");
        assert_eq!(figure(vec![logarithmic(vec![series("a", &[(1.0, 2.0)])])]).unwrap().note, "");
    }

    #[test]
    fn series_of_one_name_look_alike_and_others_do_not() {
        let one = |name: &str| series(name, &[(1.0, 1.0)]);
        let front = one("front").looking(Look::LINE);
        let all =
            figure(vec![logarithmic(vec![one("a"), one("b")]), logarithmic(vec![front, one("c"), one("b")])]).unwrap();
        let names: Vec<&str> = all.listed().iter().map(|(name, _)| *name).collect();
        assert_eq!(names, ["a", "b", "front", "c"]);
        let [left, right] = [0, 1].map(|k| all.panels[k].series.iter().map(|series| series.look).collect::<Vec<_>>());
        assert_eq!([left[0], left[1], right[1]], [0, 1, 2].map(Look::nth));
        assert_eq!([right[0], right[2]], [Look::LINE, left[1]]);
    }

    #[test]
    fn there_is_room_for_all_names() {
        let many = (0..100).map(|k| series(&k.to_string(), &[(1.0, 1.0)])).collect();
        assert_eq!(figure(vec![logarithmic(many)]).unwrap().rows, [100 * LIST_STEP]);
        let few = || logarithmic(vec![series("a", &[(1.0, 1.0)])]);
        assert_eq!(figure(vec![few(), few(), few()]).unwrap().rows, [560]);
        let names = || Fit::Names(vec!["a".to_owned(); 5]);
        let bars = || {
            let series = Series::new("s", Kind::Bars, [Point::new(1.0, 0.0, [])]);
            Panel::new("", ("", Fit::Between(0.0, 2.0)), ("", names()), vec![series])
        };
        let two_rows = figure(vec![bars(), bars(), bars(), bars()]).unwrap();
        assert_eq!((two_rows.across, two_rows.rows), (BARS_ACROSS, vec![120 + 34 * 5; 2]));
    }

    #[test]
    fn a_point_is_one_row_of_numbers_and_texts() {
        let values = [Value::Text("<a>".to_owned()), Value::Number(1.0 / 3.0), Value::Count(7)];
        let point = Point { text: "beside".to_owned(), ..Point::new(0.5, 2.0, values) };
        assert_eq!(serde_json::to_string(&point).unwrap(), r#"[0.5,2.0,"<a>",0.3333333,7,"beside"]"#);
    }
}
