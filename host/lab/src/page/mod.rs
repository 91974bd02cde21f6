//! `index.html`: a comparison as one page that needs nothing beside it, and its figures and pictures as files.
//!
//! `page.html` is the page with places for what `view` says, `page.css` its look. `page.js` only adds sorting and `charts.js` the charts
//! of a library in place of the figures: everything is there without them.

mod columns;
mod data;
mod errors;
pub mod figures;
mod names;
mod plan;
mod view;

use crate::compare::Comparison;
use crate::report::plot::PlotError;
use askama::Template;
use figures::Figure;
use prbvh::write::{WriteError, write_atomically};
use std::io;
use std::path::{Path, PathBuf};

/// A figure as a file.
struct DrawnFigure {
    file: String,
    figure: Figure,
    svg: String,
}

/// A scene with its drawn figures, and the names of its files.
struct Drawn {
    figures: Vec<DrawnFigure>,
    pictures: Vec<String>,
}

/// Writes `index.html`, every figure as `.svg` and every picture as `.png` into `folder`, each whole or not at all. Returns their paths,
/// that of the page first. The page is written last: where it is, all that it names is.
///
/// # Errors
/// At the first file that cannot be drawn or written.
pub fn write(comparison: &Comparison, folder: &Path) -> Result<Vec<PathBuf>, WriteError> {
    let page = folder.join("index.html");
    let failed = |error: PlotError| WriteError {
        path: page.clone(),
        doing: "drawing its figures",
        source: io::Error::other(error),
    };
    let overview = figures::overview(comparison);
    let overview = overview.map(|figure| drawn(names::OVERVIEW.to_owned(), figure)).transpose().map_err(failed)?;
    let scenes = draw(comparison).map_err(failed)?;

    let mut paths = vec![page.clone()];
    let mut file = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        write_atomically(&path, |out| out.write_all(bytes))?;
        paths.push(path);
        Ok(())
    };
    if let Some(figure) = &overview {
        file(&figure.file, figure.svg.as_bytes())?;
    }
    for (scene, drawn) in comparison.scenes.iter().zip(&scenes) {
        for figure in &drawn.figures {
            file(&figure.file, figure.svg.as_bytes())?;
        }
        for (name, picture) in drawn.pictures.iter().zip(view::pictures(scene)) {
            file(name, &picture.png)?;
        }
    }
    let html = view::Page::new(comparison, overview.as_ref(), &scenes);
    write_atomically(&page, |out| {
        let text = html.and_then(|html| html.render().map_err(io::Error::other))?;
        out.write_all(text.as_bytes())
    })?;
    Ok(paths)
}

fn drawn(file: String, figure: Figure) -> Result<DrawnFigure, PlotError> {
    Ok(DrawnFigure { file, svg: figures::svg(&figure)?, figure })
}

fn draw(comparison: &Comparison) -> Result<Vec<Drawn>, PlotError> {
    let scene = |(k, scene): (usize, &crate::compare::SceneComparison)| {
        let stem = names::stem(k, &scene.name);
        let figures = figures::scene_figures(scene).into_iter();
        let pictures = view::pictures(scene).enumerate();
        Ok(Drawn {
            figures: figures
                .map(|figure| drawn(format!("{stem}-{}.svg", figure.name), figure))
                .collect::<Result<_, _>>()?,
            pictures: pictures.map(|(n, picture)| names::picture(&stem, n, &picture.title)).collect(),
        })
    };
    comparison.scenes.iter().enumerate().map(scene).collect()
}
