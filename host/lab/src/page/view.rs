//! What `page.html` shows, as text.

use super::columns::{Better, COLUMNS, Cell, Column};
use super::errors::ErrorsView;
use super::plan::{PlanLine, plan_lines};
use super::{Drawn, DrawnFigure, data, names};
use crate::compare::{Comparison, MethodRow, Picture, SceneComparison};
use crate::page::figures::{Figure, Overview, relative_costs};
use askama::Template;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use prbvh::device::{DeviceInfo, DeviceKind};
use prbvh::format;
use std::io;

/// The page.
#[derive(Template)]
#[template(path = "page.html")]
pub(super) struct Page<'a> {
    css: &'static str,
    library: &'static str,
    js: [&'static str; 2],
    json: String,
    title: String,
    comparison: &'a Comparison,
    memory: String,
    command: String,
    devices: Vec<[String; 4]>,
    overview: Overview,
    overview_figure: Option<FigureView<'a>>,
    columns: &'static [Column],
    scenes: Vec<SceneView<'a>>,
}

/// A scene's part of the page.
struct SceneView<'a> {
    anchor: String,
    scene: &'a SceneComparison,
    triangles: String,
    columns: Vec<&'static Column>,
    rows: Vec<RowView<'a>>,
    errors: Option<ErrorsView>,
    plan: Vec<PlanLine>,
    figures: Vec<FigureView<'a>>,
    pictures: Vec<PictureView<'a>>,
}

struct RowView<'a> {
    method: &'a str,
    /// What went wrong.
    failed: Option<&'a str>,
    cells: Vec<CellView>,
}

struct CellView {
    text: String,
    /// By which numbers are sorted; empty where there is none.
    key: String,
    number: bool,
    best: bool,
}

struct FigureView<'a> {
    file: &'a str,
    figure: &'a Figure,
    /// The SVG for a place inside a page.
    svg: &'a str,
}

struct PictureView<'a> {
    file: &'a str,
    picture: &'a Picture,
    base64: String,
}

/// The pictures that there are; one without a file has nothing to show.
pub(super) fn pictures(scene: &SceneComparison) -> impl Iterator<Item = &Picture> {
    scene.pictures.iter().filter(|picture| !picture.png.is_empty())
}

impl<'a> Page<'a> {
    pub(super) fn new(
        comparison: &'a Comparison,
        overview: Option<&'a DrawnFigure>,
        drawn: &'a [Drawn],
    ) -> io::Result<Self> {
        let scenes = comparison.scenes.iter().zip(drawn).enumerate();
        Ok(Self {
            css: include_str!("page.css"),
            library: include_str!("../../vendor/echarts/echarts.common.min.js"),
            js: [include_str!("charts.js"), include_str!("page.js")],
            json: data::json(comparison, overview, drawn)?,
            title: title(comparison),
            comparison,
            memory: format::bytes(comparison.machine.memory_bytes),
            command: command(&comparison.program.command_line),
            devices: comparison.devices.iter().map(device).collect(),
            overview: relative_costs(comparison),
            overview_figure: overview.map(figure_view),
            columns: &COLUMNS,
            scenes: scenes.map(|(k, (scene, drawn))| scene_view(k, scene, drawn)).collect(),
        })
    }

    /// Name of a scene of the overview.
    fn scene_name(&self, scene: &usize) -> &str {
        self.comparison.scenes.get(*scene).map_or("", |scene| &scene.name)
    }

    fn scene_anchor(&self, scene: &usize) -> String {
        names::anchor(*scene)
    }

    fn ratio(&self, ratio: &Option<f64>) -> String {
        ratio.map_or_else(String::new, |ratio| format!("{ratio:.3}"))
    }

    fn key(&self, ratio: &Option<f64>) -> String {
        ratio.map_or_else(String::new, |ratio| ratio.to_string())
    }
}

fn title(comparison: &Comparison) -> String {
    match &comparison.scenes[..] {
        [scene] => format!("Bounding volume hierarchies of {}", format::shortened(&scene.name, 60)),
        scenes => format!("Bounding volume hierarchies of {} scenes", scenes.len()),
    }
}

/// The command for a POSIX shell. What cannot be passed to a program, and so never was, is left out.
fn command(arguments: &[String]) -> String {
    let quoted = arguments.iter().map(|argument| {
        let argument = argument.replace('\0', "");
        shlex::try_quote(&argument).map_or_else(|_| argument.clone(), std::borrow::Cow::into_owned)
    });
    quoted.collect::<Vec<_>>().join(" ")
}

fn device(device: &DeviceInfo) -> [String; 4] {
    let kind = match device.kind {
        DeviceKind::Cpu => "kernels compiled for the processor",
        DeviceKind::VulkanGpu => "GPU through Vulkan",
        DeviceKind::VulkanCpu => "Vulkan on the processor",
    };
    let memory = if device.memory_bytes == 0 { "unknown".to_owned() } else { format::bytes(device.memory_bytes) };
    [device.name.clone(), kind.to_owned(), device.driver.clone(), memory]
}

fn figure_view(drawn: &DrawnFigure) -> FigureView<'_> {
    FigureView {
        file: &drawn.file,
        figure: &drawn.figure,
        svg: drawn.svg.find("<svg").map_or("", |start| &drawn.svg[start..]),
    }
}

fn scene_view<'a>(k: usize, scene: &'a SceneComparison, drawn: &'a Drawn) -> SceneView<'a> {
    let lbvh = scene.rows.iter().filter(|row| row.method == "lbvh").find_map(|row| row.cost);
    // A column in which nothing stands, such as rays where none were traced, is left out.
    let filled = |column: &&Column| scene.rows.iter().any(|row| !cell(column, row, lbvh).text.is_empty());
    let columns: Vec<&'static Column> = COLUMNS.iter().filter(filled).collect();
    let mut rows: Vec<RowView<'a>> = scene.rows.iter().map(|row| row_view(row, &columns, lbvh)).collect();
    for (at, column) in columns.iter().enumerate() {
        mark_best(at, column.better, &mut rows);
    }
    let pictures = pictures(scene).zip(&drawn.pictures).map(|(picture, file)| PictureView {
        file,
        picture,
        base64: STANDARD.encode(&picture.png),
    });
    SceneView {
        anchor: names::anchor(k),
        scene,
        triangles: format::count(scene.triangles.into()),
        columns,
        rows,
        errors: ErrorsView::of(scene),
        plan: plan_lines(scene),
        figures: drawn.figures.iter().map(figure_view).collect(),
        pictures: pictures.collect(),
    }
}

fn row_view<'a>(row: &'a MethodRow, columns: &[&Column], lbvh: Option<f64>) -> RowView<'a> {
    RowView {
        method: &row.method,
        failed: (row.status != "ok").then_some(if row.status.is_empty() { "no status" } else { &row.status }),
        cells: columns.iter().map(|column| cell(column, row, lbvh)).collect(),
    }
}

fn cell(column: &Column, row: &MethodRow, lbvh: Option<f64>) -> CellView {
    match column.cell {
        Cell::Text(text) => CellView { text: text(row), key: String::new(), number: false, best: false },
        Cell::Number(value, text) => {
            let value = value(row, lbvh).filter(|value| value.is_finite());
            CellView {
                text: value.map_or_else(String::new, text),
                key: value.map_or_else(String::new, |value| value.to_string()),
                number: true,
                best: false,
            }
        }
    }
}

/// Marks the best of a column, all of them if they are equal; none where all are.
fn mark_best(at: usize, better: Better, rows: &mut [RowView<'_>]) {
    let value = |row: &RowView<'_>| row.cells[at].key.parse::<f64>().ok();
    let values: Vec<f64> = rows.iter().filter(|row| row.failed.is_none()).filter_map(value).collect();
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let best = match better {
        Better::Less => least,
        Better::More => most,
        Better::Neither => return,
    };
    if values.len() < 2 || least == most {
        return;
    }
    for row in rows.iter_mut().filter(|row| row.failed.is_none()) {
        if row.cells[at].key.parse() == Ok(best) {
            row.cells[at].best = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_can_be_pasted() {
        let command = |words: &[&str]| command(&words.iter().map(|&word| word.to_owned()).collect::<Vec<_>>());
        assert_eq!(command(&["prbvh", "compare", "a b.obj", "--mu", "1,4"]), "prbvh compare 'a b.obj' --mu '1,4'");
        let hostile = ["it's", "$(rm x)", "", "a\nb", "ü", "`x`", "!!"];
        assert_eq!(shlex::split(&command(&hostile)).unwrap(), hostile);
    }

    #[test]
    fn the_best_is_marked_and_failed_rows_never() {
        let row = |cost, status: &str| MethodRow { cost: Some(cost), status: status.to_owned(), ..Default::default() };
        let best = |rows: &[MethodRow]| -> Vec<bool> {
            let scene = SceneComparison {
                name: String::new(),
                hash: String::new(),
                triangles: 0,
                notes: Vec::new(),
                rows: rows.to_vec(),
                runs: Vec::new(),
                errors: None,
                pictures: Vec::new(),
            };
            let drawn = Drawn { figures: Vec::new(), pictures: Vec::new() };
            let view = scene_view(0, &scene, &drawn);
            let at = view.columns.iter().position(|column| column.name == "SAH cost").unwrap();
            view.rows.iter().map(|row| row.cells[at].best).collect()
        };
        assert_eq!(best(&[row(3.0, "ok"), row(2.0, "ok"), row(1.0, "panicked")]), [false, true, false]);
        assert_eq!(best(&[row(2.0, "ok"), row(2.0, "ok"), row(3.0, "ok")]), [true, true, false]);
        assert_eq!(best(&[row(2.0, "ok"), row(2.0, "ok")]), [false, false]);
        assert_eq!(best(&[row(2.0, "ok")]), [false]);
    }

    #[test]
    fn columns_are_explained() {
        for column in &COLUMNS {
            assert!(column.meaning.len() > 20 && column.meaning.ends_with('.'), "{}", column.name);
        }
    }
}
