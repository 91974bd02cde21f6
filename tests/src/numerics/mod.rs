//! The experiments behind `docs/numerics.md`, and the numbers in it.
//!
//! Each experiment makes one block of the document. Nothing is timed, and every result is the same on every machine, so a block is either as
//! it was or something changed.

pub mod catalogue;
pub mod document;
pub mod f32_sum;
pub mod fresh_sum;
pub mod runs;
pub mod safe_range;
pub mod threshold;

use prbvh::device::Device;
use prbvh::device::cpu::CpuDevice;
use prbvh::scene::{SafeRange, Scene};
use prbvh_kernel::node::Node;
use prbvh_lab::stability::{self, CATALOGUE, Case, Lane, Method, Row, Subject};
use std::ops::ControlFlow;

/// A device of the experiments: all give the same numbers.
fn device() -> Box<dyn Device> {
    Box::new(CpuDevice::new(0).expect("the system gives threads"))
}

/// A case of the catalogue.
fn case(name: &str) -> &'static Case {
    CATALOGUE.iter().find(|case| case.name == name).unwrap_or_else(|| panic!("no case {name}"))
}

/// A method of the stability table.
fn method(name: &str) -> Method {
    let methods = stability::methods().into_iter();
    methods.into_iter().find(|method| method.name == name).unwrap_or_else(|| panic!("no method {name}"))
}

/// The scene of a case.
fn scene_of(case: &Case) -> Scene {
    Scene::from_finite(case.name, case.triangles(false)).expect("a case has finite triangles").0
}

/// The LBVH of a scene in working coordinates.
fn initial_tree(scene: &Scene) -> Vec<Node> {
    let mut device = device();
    let working = SafeRange::of(&scene.triangles).apply(&scene.triangles);
    let (tree, _) =
        prbvh::build::lbvh(&mut *device, &working, prbvh::build::MortonBits::Sixty).expect("the CPU builds a tree");
    tree.download(&mut *device).expect("the CPU copies a tree")
}

/// Rows of the stability table of one device.
fn stability_rows(cases: &[Case], methods: &[Method], device: Box<dyn Device>, subject: &dyn Subject) -> Vec<Row> {
    let mut lanes = [Lane::new("cpu", device)];
    let go_on = &mut |_: &[Row]| ControlFlow::Continue(());
    stability::run(cases, methods, &mut lanes, false, subject, go_on).expect("the cases have scenes")
}

/// A table in Markdown; the first row is its header.
fn markdown(rows: &[Vec<String>]) -> String {
    let line = |row: &Vec<String>| format!("| {} |\n", row.join(" | "));
    let mut text = String::new();
    for (k, row) in rows.iter().enumerate() {
        text += &line(row);
        if k == 0 {
            text += &format!("|{}\n", "---|".repeat(row.len()));
        }
    }
    text
}

fn texts(texts: &[&str]) -> Vec<String> {
    texts.iter().map(|text| (*text).to_owned()).collect()
}

/// A part, with two digits: `1.2e-7`, and `0` where it is 0.
fn part(value: f64) -> String {
    if value == 0.0 { "0".to_owned() } else { format!("{value:.1e}") }
}
