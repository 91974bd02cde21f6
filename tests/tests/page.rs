//! The page of a comparison, in a real browser.

use prbvh_lab::compare::{Comparison, Purpose};
use prbvh_lab::page;
use prbvh_tests::browser::{Browser, View};
use prbvh_tests::made_up::{self, METHODS};
use serde_json::Value;
use std::path::{Path, PathBuf};

const DESK: View = View { width: 1280, height: 900, dark: false };
const FIGURES: usize = 8;
const PICTURES: usize = 3;
const LIBRARY: &str = include_str!("../../host/lab/vendor/echarts/echarts.common.min.js");

/// All is in sight at once. Without a reader the browser draws no frame, and so would see nothing come near.
const ALL_IN_SIGHT: &str = "<script>IntersectionObserver = class {\
    constructor(seen) { this.seen = seen; }\
    observe(target) { this.seen([{ isIntersecting: true, target }]); }\
    unobserve() {}\
};</script>";

/// A page with the self-check in it.
struct Page {
    folder: tempfile::TempDir,
    html: String,
    paths: Vec<PathBuf>,
}

/// What the self-check found, and what the console said.
struct Found {
    result: Value,
    problems: Vec<String>,
}

impl Page {
    fn new(comparison: &Comparison) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let paths = page::write(comparison, folder.path()).unwrap();
        let html = std::fs::read_to_string(&paths[0]).unwrap();
        Self { folder, html, paths }
    }

    /// Opens a copy with something planted before what the page has in its body, and lets the check run.
    fn check(&self, browser: &Browser, view: View, planted: &str) -> Found {
        let copy = self.folder.path().join("copy.html");
        let check = format!("<script>{}</script></body>", include_str!("page/selftest.js"));
        let html = self.html.replacen("<body>", &format!("<body>{ALL_IN_SIGHT}{planted}"), 1);
        let at = html.rfind("</body>").unwrap();
        std::fs::write(&copy, format!("{}{check}{}", &html[..at], &html[at + "</body>".len()..])).unwrap();
        let visited = browser.visit(&copy, view);
        let document = visited.dom.split("data-selftest=\"").nth(1).unwrap_or_default();
        let result =
            document.split('"').next().unwrap().replace("&quot;", "\"").replace("&lt;", "<").replace("&gt;", ">");
        let result: Value = serde_json::from_str(&result.replace("&amp;", "&")).unwrap_or(Value::Null);
        let mut problems = visited.console;
        match result["failures"].as_array() {
            Some(failures) => problems.extend(failures.iter().map(ToString::to_string)),
            None => problems.push("the self-check did not end".to_owned()),
        }
        Found { result, problems }
    }
}

/// What a page would load from elsewhere. Nothing may: there is no link to a site in it either. Of the library of charts the browser tells.
fn requests(html: &str) -> Vec<String> {
    let html = html.replace(LIBRARY, "");
    let attribute = |name: &'static str| html.split(name).skip(1).map(|rest| rest.split('"').next().unwrap());
    let elsewhere = |value: &&str| !value.starts_with("data:image/png;base64,");
    let sources = ["src=\"", "srcset=\"", "url(", "@import"].into_iter().flat_map(attribute).filter(elsewhere);
    let links = attribute("href=\"").filter(|value| value.contains(':') || value.starts_with('/'));
    sources.chain(links).map(str::to_owned).collect()
}

#[test]
fn ten_scenes_by_twelve_methods_work_in_a_browser() {
    let Some(browser) = Browser::find() else { return };
    let page = Page::new(&made_up::comparison(10));
    // For a look at it, in target/tmp.
    page::write(&made_up::comparison(10), &Path::new(env!("CARGO_TARGET_TMPDIR")).join("page")).unwrap();
    assert_eq!(requests(&page.html), [""; 0]);
    assert!(page.html.len() < 5 << 20, "{} bytes", page.html.len());
    let body = page.html.split("<script type").next().unwrap();
    for once_a_scene in
        ["<li>collapse to adaptive leaves: one triangle per leaf", "<li>refits of nodes below which nothing moved"]
    {
        assert_eq!(body.matches(once_a_scene).count(), 10, "{once_a_scene}");
    }
    assert!(body.contains("is &#60;none&#62; &#38; &#34;nothing&#34; <span class=\"unit\">– lbvh"), "text stays text");
    for view in [DESK, View { width: 500, height: 900, dark: true }] {
        let found = page.check(&browser, view, "");
        assert!(found.problems.is_empty(), "{:#?}", found.problems);
        let counts = &found.result["counts"];
        assert_eq!(counts["figures"], 10 * FIGURES + 1);
        assert_eq!(counts["charts"], counts["figures"]);
        assert_eq!(counts["hovered"], counts["figures"]);
        assert_eq!(counts["tools"], FIGURES + 1);
        assert_eq!(counts["pictures"], 10 * PICTURES);
        assert_eq!(counts["tables"], 21);
        // Every column of every table; that of the overview has ten scenes.
        assert!(counts["sorted"].as_u64().unwrap() > 10 * 15 + 11, "{counts}");
        assert!(counts["texts"].as_u64().unwrap() > 1000, "{counts}");
        assert_eq!(found.result["width"], view.width);
    }
}

#[test]
fn hostile_names_are_only_text() {
    let page = Page::new(&made_up::hostile());
    assert_eq!(requests(&page.html), [""; 0]);
    assert!(!page.html.contains("<script>window.planted") && !page.html.contains("<img src=x"));
    // Nor does the library end its own element.
    assert!(page.html.contains(LIBRARY) && !LIBRARY.contains("</script") && !LIBRARY.contains("<!--"));
    for path in &page.paths {
        let name = path.file_name().unwrap().to_str().unwrap();
        assert!(name.bytes().all(|c| c.is_ascii_alphanumeric() || b"-.".contains(&c)), "{name}");
        if name.ends_with(".svg") {
            let svg = std::fs::read_to_string(path).unwrap();
            let document = roxmltree::Document::parse(&svg).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert!(document.descendants().all(|node| !node.has_tag_name("script") && !node.has_tag_name("img")));
        }
    }
    let Some(browser) = Browser::find() else { return };
    let found = page.check(&browser, DESK, "");
    // Names this long leave no room for one another; all else must be right.
    let problems: Vec<_> = found.problems.iter().filter(|problem| !problem.contains("on \\\"")).collect();
    assert!(problems.is_empty(), "{problems:#?}");
    // What stands for the reader, the data, the library, the page's own and the check.
    assert_eq!(found.result["scripts"], 6);
}

/// Each planted fault must be found, and by the part of the check that is for it.
#[test]
fn planted_faults_are_found() {
    let Some(browser) = Browser::find() else { return };
    let page = Page::new(&made_up::comparison(1));
    let plants = [
        ("<script>nothing.here();</script>", "nothing is not defined"),
        ("<script>console.error('quiet');</script>", "quiet"),
        ("<script>window.planted = 1;</script>", "planted code ran"),
        ("<style>.plot > svg { display: none !important; }</style>", "figure overview.svg has no size"),
        ("<style>.chart svg { display: none !important; }</style>", "chart overview.svg has no size"),
        ("<style>.plot > svg { display: block !important; }</style>", "the picture is still there"),
        ("<script>IntersectionObserver = class { observe() {} };</script>", "is not made"),
        ("<style>@media print { .chart { display: block !important; } }</style>", "is not the picture on paper"),
        ("<style>svg text { font-size: 60px !important; }</style>", "\\\" on \\\""),
        ("<script>addEventListener('click', (e) => e.stopImmediatePropagation(), true);</script>", "aria-sort"),
        ("<script>addEventListener('mousemove', (e) => e.stopImmediatePropagation(), true);</script>", "no values"),
        (
            "<script>addEventListener('keydown', (e) => e.stopImmediatePropagation(), true);</script>",
            "not the first point",
        ),
        ("<div style='width: 5000px'>.</div>", "the page is 5"),
        ("<img src='https://example.invalid/x.png' alt='x'>", "Content Security Policy"),
    ];
    for (plant, expected) in plants {
        let found = page.check(&browser, DESK, plant);
        assert!(found.problems.iter().any(|problem| problem.contains(expected)), "{plant}: {:#?}", found.problems);
    }
    assert_eq!(
        requests("<img src=\"https://a.b/c\"><a href=\"http://a.b\"><a href=\"#x\">"),
        ["https://a.b/c", "http://a.b"]
    );
}

#[test]
fn charts_are_made_where_the_reader_is() {
    let Some(browser) = Browser::find() else { return };
    let page = Page::new(&made_up::comparison(3));
    // Time for a few frames.
    let wait = "<script>addEventListener('load', () => setTimeout(() => {}, 3000));</script></body>";
    let at = page.html.rfind("</body>").unwrap();
    let copy = page.folder.path().join("copy.html");
    std::fs::write(&copy, format!("{}{wait}{}", &page.html[..at], &page.html[at + "</body>".len()..])).unwrap();
    let visited = browser.visit(&copy, DESK);
    assert_eq!(visited.console, [""; 0]);
    let made = visited.dom.matches("class=\"plot live\"").count();
    assert!((1..=FIGURES).contains(&made), "{made}");
}

#[test]
fn light_and_dark_are_what_the_reader_prefers() {
    let Some(browser) = Browser::find() else { return };
    let page = Page::new(&made_up::comparison(1));
    let brightness = |dark| {
        let png = browser.screenshot(&page.paths[0], View { width: 1280, height: 1800, dark });
        let mut decoder = png::Decoder::new(std::io::Cursor::new(png));
        decoder.set_transformations(png::Transformations::normalize_to_color8());
        let mut reader = decoder.read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let size = reader.next_frame(&mut pixels).unwrap().buffer_size();
        pixels[..size].iter().map(|&value| f64::from(value)).sum::<f64>() / size as f64
    };
    let [light, dark] = [brightness(false), brightness(true)];
    assert!(light > 200.0 && light < 254.0, "{light}");
    // An opaque picture has a fourth channel that is always 255.
    assert!(dark < 110.0 && dark > 3.0, "{dark}");
}

#[test]
fn everything_is_there_without_scripts() {
    let comparison = made_up::comparison(3);
    let page = Page::new(&comparison);
    let html = page.html.split("<script").next().unwrap();
    assert_eq!(html.matches("<svg ").count(), 3 * FIGURES + 1);
    assert_eq!(html.matches("<img ").count(), 3 * PICTURES);
    for text in [
        "conference room.obj.xz&#39; --mu &#39;1,4,9&#39; --out report",
        "AMD EPYC 7763 64-Core Processor",
        "commit <code>4c56fef</code>",
        "llvmpipe (LLVM 19.1.7, 256 bits)",
        "panicked at",
        "What the columns mean",
        "medians of 5 runs",
        "10,500,551 triangles",
    ] {
        assert!(html.contains(text), "{text}");
    }
    for (method, ..) in METHODS {
        assert!(html.matches(&format!("<th scope=\"row\">{method}<")).count() >= 3, "{method}");
    }
    // Beside the page: every figure and every picture as a file.
    assert_eq!(page.paths.len(), 2 + 3 * (FIGURES + PICTURES));
    for path in &page.paths {
        assert!(path.metadata().unwrap().len() > 500, "{}", path.display());
    }
    let png = page.paths.iter().find(|path| path.extension().is_some_and(|e| e == "png")).unwrap();
    assert_eq!(std::fs::read(png).unwrap(), comparison.scenes[0].pictures[0].png);
}

#[test]
fn figures_without_data_are_left_out() {
    let names = |comparison: &Comparison| -> Vec<String> {
        let page = Page::new(comparison);
        let name = |path: &PathBuf| path.file_name().unwrap().to_str().unwrap().to_owned();
        page.paths.iter().map(name).filter(|name: &String| name.ends_with(".svg")).collect()
    };
    let mut comparison = made_up::comparison(1);
    comparison.scenes[0].pictures.clear();
    comparison.scenes[0].runs.retain(|run| run.purpose == Purpose::Table && run.rows.len() == 1);
    assert_eq!(
        names(&comparison),
        ["overview.svg", "01-conference-cost-time.svg", "01-conference-error-time.svg", "01-conference-kernels.svg"]
    );
    comparison.scenes[0].runs.clear();
    comparison.scenes[0].set_errors(None);
    comparison.scenes[0].rows.remove(0);
    assert_eq!(names(&comparison), [""; 0]);
    comparison.scenes[0].rows.clear();
    assert_eq!(names(&comparison), [""; 0]);
    comparison.scenes.clear();
    assert_eq!(names(&comparison), [""; 0]);
}

#[test]
fn numbers_without_sense_do_no_harm() {
    let mut comparison = made_up::comparison(2);
    for (k, run) in comparison.scenes.iter_mut().flat_map(|scene| &mut scene.runs).enumerate() {
        let value = [f64::NAN, f64::INFINITY, 0.0, -1.0, 1e300, 1e-300][k % 6];
        for row in run.rows.iter_mut().skip(k % 3) {
            row.cost = value;
            row.time_s = value;
        }
    }
    for (k, row) in comparison.scenes.iter_mut().flat_map(|scene| &mut scene.rows).enumerate() {
        row.cost = Some([f64::NAN, f64::INFINITY, 0.0, -1.0, 1e300][k % 5]);
        row.build_s = row.cost;
    }
    let page = Page::new(&comparison);
    for path in page.paths.iter().filter(|path| path.extension().is_some_and(|e| e == "svg")) {
        let svg = std::fs::read_to_string(path).unwrap();
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{}", path.display());
    }
    let Some(browser) = Browser::find() else { return };
    let found = page.check(&browser, DESK, "");
    assert!(found.problems.iter().all(|problem| !problem.contains("CONSOLE")), "{:#?}", found.problems);
}

#[test]
fn what_is_in_the_way_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "mine").unwrap();
    let error = page::write(&made_up::comparison(1), &file).unwrap_err();
    assert!(error.path.starts_with(&file), "{error}");
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine");
    assert!(!Path::new(&file).join("index.html").exists());
}
