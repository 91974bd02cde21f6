//! The search without its relative threshold.

use super::document::Block;
use super::runs::checked;
use super::{case, device, initial_tree, markdown, scene_of, texts};
use crate::other_searches::{with_search, without_threshold};
use prbvh::device::Device;
use prbvh::optimize::{Epsilon, Limits, Order, PrbvhSettings};
use prbvh::pipeline::Settings;
use prbvh::scene::Scene;
use prbvh_kernel::node::{NO_NODE, Node};
use prbvh_kernel::prbvh::Move;
use prbvh_lab::accuracy::area_decrease;
use prbvh_lab::stability::{Library, Subject};

/// Iterations after which a run counts as endless.
const MANY: u32 = 50;

/// What a search offers in a tree.
#[derive(Clone, Debug, PartialEq)]
pub struct Offered {
    /// Moves.
    pub moves: usize,
    /// Those that lower no cost in f64.
    pub raising: usize,
    /// The one of those that raises the area most: f32 decrease and f64 decrease.
    pub worst: Option<(f32, f64)>,
}

impl Offered {
    /// Judges moves by f64.
    #[must_use]
    pub fn of(nodes: &[Node], found: &[Move]) -> Self {
        let moves: Vec<(f32, f64)> = (0..)
            .zip(found)
            .filter(|(_, found)| found.output != NO_NODE)
            .map(|(input, found)| (found.area_decrease, area_decrease(nodes, input, found.output)))
            .collect();
        let raising = || moves.iter().copied().filter(|(_, exact)| *exact <= 0.0);
        let worst = raising().min_by(|a, b| a.1.total_cmp(&b.1));
        Self { moves: moves.len(), raising: raising().count(), worst }
    }
}

/// A row per case: what is offered in the initial tree, and how a run ends, without the threshold and with it.
#[must_use]
pub fn block() -> Block {
    let names = ["ulp-jitter", "coplanar", "needles-1e8", "offset-1e6", "teapot-in-stadium", "scale-1", "grid"];
    let header = ["case", "without: raise the cost", "the worst: f32, f64", "end", "with: raise the cost", "end"];
    let mut rows = vec![texts(&header)];
    for name in names {
        let scene = scene_of(case(name));
        let nodes = initial_tree(&scene);
        let naive = |device| -> Box<dyn Device> { Box::new(with_search(device, without_threshold)) };
        let offered = |device: &mut dyn Device| {
            Offered::of(&nodes, &Library.search(&nodes, Order::Published, device).expect("the CPU searches"))
        };
        let (without, with) = (offered(&mut *naive(device())), offered(&mut *device()));
        let worst = without.worst.map_or_else(|| "-".to_owned(), |(f32, f64)| format!("{f32:+.1e}, {f64:+.1e}"));
        let count = |offered: &Offered| format!("{} of {}", offered.raising, offered.moves);
        let ends = [end(&scene, naive(device())), end(&scene, device())];
        let [end_without, end_with] = ends;
        rows.push(vec![format!("`{name}`"), count(&without), worst, end_without, count(&with), end_with]);
    }
    Block::new("threshold", markdown(&rows))
}

/// How a run ends that is to go on for as long as the cost changes.
fn end(scene: &Scene, mut device: Box<dyn Device>) -> String {
    let epsilon = Epsilon::Absolute(0.0);
    let prbvh = PrbvhSettings::published().with(|s| {
        s.mu = 1;
        s.epsilon = epsilon;
        s.patience = MANY;
        s.limits = Limits::iterations(MANY);
    });
    let report =
        checked(scene, &mut *device, &Settings::default().with(|s| s.prbvh = prbvh)).expect("the CPU optimises");
    let rises = report.rows.iter().filter(|row| row.measured_decrease < 0.0).count();
    let lowest = report.rows.iter().map(|row| row.exact_cost).fold(f64::INFINITY, f64::min);
    format!("{lowest:.6}, {} iterations, {rises} rise", report.rows.len() - 1)
}
