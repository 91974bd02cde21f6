//! Wide costs and sizes, which no machine changes.

use super::{peer, sweep, tree};
use prbvh::bvh::{Bvh, SahModel, quality};
use prbvh::pipeline::Settings;
use prbvh::scene::Scene;
use prbvh::wide::{self, CollapseMethod, Layout, PackedTree, WideSettings, Width, collapse};
use prbvh_tests::bench::markdown::{Markdown, number};

const FORMS: [(Width, Layout); 3] =
    [(Width::Four, Layout::Soa), (Width::Eight, Layout::Soa), (Width::Eight, Layout::Cwbvh)];

/// A row for each scene and tree.
pub(crate) fn table(scenes: impl Iterator<Item = Scene>) -> String {
    let mut table = Markdown::new(&[
        "<scene",
        "<tree",
        "SAH",
        "bvh4",
        "÷ greedy",
        "bvh8",
        "÷ greedy",
        "cwbvh",
        "÷ greedy",
        "B / triangle: bvh4",
        "bvh8",
        "cwbvh",
    ]);
    for scene in scenes {
        eprintln!("{} ({} triangles)", scene.name, scene.triangles.len());
        let trees =
            [("prbvh", tree(&scene, &Settings::default())), ("sweep", sweep(&scene)), ("obvhs", peer::best(&scene))];
        for (name, tree) in &trees {
            table.row(&row(&scene, name, tree));
        }
    }
    table.finish()
}

fn row(scene: &Scene, name: &str, tree: &Bvh) -> Vec<String> {
    let binary = quality(tree, &SahModel::default()).sah_cost;
    let mut cells = vec![scene.name.clone(), name.to_owned(), number(binary, 2)];
    let mut sizes = Vec::new();
    for (width, layout) in FORMS {
        let settings = |method| {
            WideSettings::default().with(|s| {
                s.width = width;
                s.layout = layout;
                s.method = method;
            })
        };
        let [best, greedy] = [CollapseMethod::Optimal, CollapseMethod::Greedy].map(|method| {
            let made = collapse(tree, &settings(method)).expect("the settings are good");
            let cost = wide::quality(&made, &width.sah()).sah_cost;
            (made, cost)
        });
        assert!(best.1 <= greedy.1, "{}, {name}: {} and {}", scene.name, best.1, greedy.1);
        cells.extend([number(best.1, 2), number(best.1 / greedy.1, 3)]);
        let packed = PackedTree::new(&best.0, layout).expect("leaves were made for the layout");
        sizes.push(number(packed.bytes_per_triangle(), 1));
    }
    cells.extend(sizes);
    cells
}
