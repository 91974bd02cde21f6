use super::emit::{Fate, emit};
use super::*;
use crate::bvh::testing::{chain, tree};
use crate::bvh::{BvhNode, Content, ROOT, SahModel};
use crate::device::cpu::CpuDevice;
use proptest::prelude::*;

fn settings(width: Width, layout: Layout, method: CollapseMethod, max_leaf: Option<u32>) -> WideSettings {
    WideSettings { width, layout, method, reach: 0, sah: None, max_leaf }
}

fn of(width: Width) -> WideSettings {
    settings(width, Layout::Soa, CollapseMethod::Optimal, None)
}

fn greedy(settings: WideSettings) -> WideSettings {
    WideSettings { method: CollapseMethod::Greedy, ..settings }
}

fn cost(tree: &WideBvh, settings: &WideSettings) -> f64 {
    quality(tree, &settings.costs()).sah_cost
}

/// Costs that decide are float32: where two trees cost nearly the same either may be taken.
const NEARLY: f64 = 1e-6;

const WIDTHS: [Width; 2] = [Width::Four, Width::Eight];

/// The ways in which the nodes from `v` down can fare, without regard to the width.
fn all_fates(tree: &Bvh, v: u32) -> Vec<Vec<(u32, Fate)>> {
    let mut ways = vec![vec![(v, Fate::Leaf)]];
    if let Content::Internal { left, right } = tree.nodes[v as usize].content {
        let (left, right) = (all_fates(tree, left), all_fates(tree, right));
        for fate in [Fate::Node, Fate::Gone] {
            for l in &left {
                for r in &right {
                    ways.push([(v, fate)].iter().chain(l).chain(r).copied().collect());
                }
            }
        }
    }
    ways
}

/// The least cost over every collapse there is.
fn least_cost(tree: &Bvh, settings: &WideSettings) -> f64 {
    let mut least = f64::INFINITY;
    for way in all_fates(tree, ROOT) {
        let mut fates = vec![Fate::Gone; tree.nodes.len()];
        way.iter().for_each(|&(v, fate)| fates[v as usize] = fate);
        if fates[ROOT as usize] == Fate::Gone || most_children(tree, &fates) > settings.width.get() {
            continue;
        }
        let wide = emit(tree, settings.width, &fates);
        let leaf = |child: &WideChild| matches!(child.content, WideContent::Leaf { count, .. } if count > settings.most_of_a_leaf());
        if !wide.nodes.iter().flat_map(WideNode::children).any(leaf) {
            least = least.min(cost(&wide, settings));
        }
    }
    least
}

/// Children of the node that has most of them.
fn most_children(tree: &Bvh, fates: &[Fate]) -> usize {
    fn roots(tree: &Bvh, fates: &[Fate], v: u32, most: &mut usize) -> usize {
        let Content::Internal { left, right } = tree.nodes[v as usize].content else { return 1 };
        if fates[v as usize] == Fate::Leaf {
            return 1;
        }
        let below = roots(tree, fates, left, most) + roots(tree, fates, right, most);
        if fates[v as usize] == Fate::Gone {
            return below;
        }
        *most = below.max(*most);
        1
    }
    let mut most = 0;
    roots(tree, fates, ROOT, &mut most);
    most
}

#[test]
fn the_optimal_collapse_is_the_best_of_all() {
    let mut device = CpuDevice::new(2).unwrap();
    for seed in 0..24 {
        let (triangles, tree) = tree(1 + seed as usize % 8, seed);
        for width in WIDTHS {
            for (max_leaf, c_intersect) in [(None, 2.0), (Some(1), 2.0), (Some(3), 0.5)] {
                let mut settings = of(width);
                settings.max_leaf = max_leaf;
                settings.sah = Some(SahModel { c_intersect, ..width.sah() });
                let (wide, _) = collapse_on(&mut device, &tree, &settings).unwrap();
                validate(&wide, Some(&triangles)).unwrap();
                let (found, least) = (cost(&wide, &settings), least_cost(&tree, &settings));
                assert!((found - least).abs() <= NEARLY * least, "{found} is not {least} for {tree:?}");
                assert_eq!(collapse(&tree, &settings).unwrap(), wide);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn every_collapse_is_a_tree_and_greedy_is_no_better(n in 1usize..200, seed: u64, max_leaf in 0u32..5) {
        let (triangles, tree) = tree(n, seed);
        for width in WIDTHS {
            let settings = WideSettings { max_leaf: (max_leaf > 0).then_some(max_leaf), ..of(width) };
            let [best, other] = [settings, greedy(settings)].map(|settings| collapse(&tree, &settings).unwrap());
            for wide in [&best, &other] {
                prop_assert_eq!(validate(wide, Some(&triangles)), Ok(()));
                prop_assert_eq!(&wide.clone().with_boxes_of(&triangles), wide);
            }
            prop_assert!(cost(&best, &settings) <= cost(&other, &settings) * (1.0 + NEARLY));
        }
    }

    #[test]
    fn every_layout_gives_the_tree_back(n in 1usize..200, seed: u64) {
        let (triangles, tree) = tree(n, seed);
        for width in WIDTHS {
            let wide = collapse(&tree, &of(width)).unwrap();
            let packed = PackedTree::new(&wide, Layout::Soa).unwrap();
            let back = packed.unpack().unwrap();
            prop_assert_eq!(validate(&back, Some(&triangles)), Ok(()));
            prop_assert_eq!(quality(&back, &width.sah()), quality(&wide, &width.sah()));
            prop_assert_eq!(&PackedTree::new(&back, Layout::Soa).unwrap(), &packed);
        }
        let settings = WideSettings { layout: Layout::Cwbvh, ..of(Width::Eight) };
        let wide = collapse(&tree, &settings).unwrap();
        let packed = PackedTree::new(&wide, Layout::Cwbvh).unwrap();
        let back = packed.unpack().unwrap();
        // Larger boxes hold the same triangles; with their own boxes it is the same tree, bit for bit.
        prop_assert_eq!(validate(&back, Some(&triangles)), Ok(()));
        let exact = back.clone().with_boxes_of(&triangles);
        let [a, b] = [&exact, &wide].map(|tree| quality(tree, &settings.costs()));
        prop_assert!((a.sah_cost - b.sah_cost).abs() <= 1e-12 * b.sah_cost);
        prop_assert_eq!((a.nodes, a.leaves, a.triangles, a.levels), (b.nodes, b.leaves, b.triangles, b.levels));
        prop_assert_eq!(&PackedTree::new(&exact, Layout::Cwbvh).unwrap(), &packed);
        for (node, exact) in back.nodes.iter().zip(&exact.nodes) {
            for (child, exact) in node.slots.iter().zip(&exact.slots) {
                prop_assert!(child.zip(*exact).is_none_or(|(child, exact)| child.aabb.contains(exact.aabb)));
            }
        }
    }
}

#[test]
fn a_chain_does_not_overflow_the_stack() {
    let (triangles, nodes) = chain(50_000);
    let tree = Bvh::from_device(&nodes).unwrap();
    for method in [CollapseMethod::Optimal, CollapseMethod::Greedy] {
        let settings = settings(Width::Eight, Layout::Cwbvh, method, Some(1));
        let wide = collapse(&tree, &settings).unwrap();
        validate(&wide, Some(&triangles)).unwrap();
        assert!(quality(&wide, &settings.costs()).levels > 5000);
        assert!(PackedTree::new(&wide, Layout::Cwbvh).unwrap().unpack().is_ok());
    }
}

#[test]
fn a_leaf_that_is_too_large_becomes_several() {
    let aabb = Aabb { min: [0.0; 3], max: [1.0; 3] };
    let leaf = BvhNode { aabb, parent: crate::bvh::NO_NODE, content: Content::Leaf { first: 0, count: 1000 } };
    let tree = Bvh { nodes: vec![leaf], triangle_order: (0..1000).collect() };
    let settings = WideSettings { layout: Layout::Cwbvh, ..of(Width::Eight) };
    let wide = collapse(&tree, &settings).unwrap();
    validate(&wide, None).unwrap();
    assert_eq!(quality(&wide, &settings.costs()).triangles, 1000);
    assert!(PackedTree::new(&wide, Layout::Cwbvh).is_ok());
    // Without a limit it stays what it is.
    let whole = collapse(&tree, &of(Width::Eight)).unwrap();
    assert_eq!((whole.nodes.len(), quality(&whole, &Width::Eight.sah()).leaves), (1, 1));
    let refused = PackedTree::new(&whole, Layout::Cwbvh).unwrap_err();
    assert!(refused.to_string().contains("1000 triangles"), "{refused}");
}

#[test]
fn cost_by_hand() {
    let cube = |min: f32, max: f32| Aabb { min: [min; 3], max: [max; 3] };
    let child = |aabb, content| Some(WideChild { aabb, content });
    let mut nodes = vec![WideNode::default(); 2];
    nodes[0].slots[0] = child(cube(0.0, 2.0), WideContent::Node(1));
    nodes[0].slots[1] = child(cube(3.0, 4.0), WideContent::Leaf { first: 0, count: 3 });
    nodes[1].slots[2] = child(cube(0.0, 1.0), WideContent::Leaf { first: 3, count: 1 });
    nodes[1].slots[3] = child(cube(1.0, 2.0), WideContent::Leaf { first: 4, count: 1 });
    let tree = WideBvh { width: Width::Four, nodes, triangle_order: vec![0, 1, 2, 3, 4] };
    let model = SahModel { c_traversal: 3.0, c_intersect: 2.0 };
    let measured = quality(&tree, &model);
    assert_eq!(measured.sah_cost, 3.0 * (1.0 + 4.0 / 16.0) + 2.0 * (3.0 / 16.0 + 2.0 / 16.0));
    assert_eq!((measured.nodes, measured.leaves, measured.triangles, measured.levels), (2, 3, 5, 2));
    assert_eq!(measured.children_per_node, 2.0);
}

#[test]
fn bad_settings_are_told_with_their_field() {
    let cases = [
        ("wide.width", WideSettings { layout: Layout::Cwbvh, ..of(Width::Four) }),
        ("wide.reach", WideSettings { reach: 5, ..of(Width::Four) }),
        ("wide.reach", greedy(WideSettings { reach: 1, ..of(Width::Four) })),
        ("wide.max_leaf", WideSettings { max_leaf: Some(0), ..of(Width::Four) }),
        ("wide.max_leaf", WideSettings { layout: Layout::Cwbvh, max_leaf: Some(4), ..of(Width::Eight) }),
        (
            "wide.c_traversal",
            WideSettings { sah: Some(SahModel { c_traversal: f64::NAN, c_intersect: 1.0 }), ..of(Width::Four) },
        ),
    ];
    for (name, settings) in cases {
        assert_eq!(settings.check().unwrap_err().name, name);
        assert!(collapse(&tree(3, 1).1, &settings).is_err());
        assert!(collapse_on(&mut CpuDevice::new(1).unwrap(), &tree(3, 1).1, &settings).is_err());
    }
    assert!(Width::try_from(3).is_err() && "bvh".parse::<Layout>().is_err());
}

#[test]
fn planted_faults_are_found() {
    let (triangles, binary) = tree(60, 3);
    let good = collapse(&binary, &WideSettings { max_leaf: Some(1), ..of(Width::Four) }).unwrap();
    validate(&good, Some(&triangles)).unwrap();
    let faults = |change: &dyn Fn(&mut WideBvh)| {
        let mut tree = good.clone();
        change(&mut tree);
        validate(&tree, Some(&triangles)).expect_err("a fault was planted")
    };
    let slot_of = |wanted: fn(&WideContent) -> bool| {
        let found = good.nodes.iter().enumerate().find_map(|(v, node)| {
            let slot = node.slots.iter().position(|child| child.is_some_and(|child| wanted(&child.content)));
            slot.map(|slot| (v, slot))
        });
        found.expect("the tree has one")
    };
    let leaf = slot_of(|content| matches!(content, WideContent::Leaf { .. }));
    let inner = slot_of(|content| matches!(content, WideContent::Node(_)));
    let set = |tree: &mut WideBvh, (v, slot): (usize, usize), content| {
        tree.nodes[v].slots[slot].as_mut().expect("it is taken").content = content;
    };
    let has = |faults: &[WideFault], wanted: fn(&WideFault) -> bool| assert!(faults.iter().any(wanted), "{faults:?}");

    has(&faults(&|tree| tree.nodes.clear()), |f| matches!(f, WideFault::NodeCount { nodes: 0 }));
    has(&faults(&|tree| tree.nodes.push(WideNode::default())), |f| matches!(f, WideFault::Unreachable { .. }));
    has(&faults(&|tree| tree.nodes[good.nodes.len() - 1] = WideNode::default()), |f| {
        matches!(f, WideFault::EmptyNode { .. })
    });
    has(&faults(&|tree| tree.nodes[leaf.0].slots[7] = tree.nodes[leaf.0].slots[leaf.1].take()), |f| {
        matches!(f, WideFault::BeyondWidth { slot: 7, width: 4, .. })
    });
    has(&faults(&|tree| set(tree, inner, WideContent::Node(9999))), |f| {
        matches!(f, WideFault::LinkOutOfRange { child: 9999, .. })
    });
    has(&faults(&|tree| set(tree, inner, WideContent::Node(0))), |f| matches!(f, WideFault::Shared { child: 0, .. }));
    has(&faults(&|tree| set(tree, leaf, WideContent::Leaf { first: 0, count: 0 })), |f| {
        matches!(f, WideFault::EmptyLeaf { .. })
    });
    has(&faults(&|tree| set(tree, leaf, WideContent::Leaf { first: u32::MAX, count: 2 })), |f| {
        matches!(f, WideFault::LeafRange { count: 2, .. })
    });
    has(&faults(&|tree| set(tree, leaf, WideContent::Leaf { first: 0, count: 60 })), |f| {
        matches!(f, WideFault::PositionShared { .. })
    });
    has(&faults(&|tree| tree.triangle_order.push(0)), |f| matches!(f, WideFault::PositionUnused { position: 60 }));
    has(&faults(&|tree| tree.triangle_order[5] = 60), |f| {
        matches!(f, WideFault::TriangleOutOfRange { triangle: 60, .. })
    });
    let twice = faults(&|tree| tree.triangle_order[5] = tree.triangle_order[6]);
    has(&twice, |f| matches!(f, WideFault::TriangleTwice { .. }));
    has(&twice, |f| matches!(f, WideFault::TriangleMissing { .. }));
    let no_box =
        |aabb: Aabb| faults(&|tree| tree.nodes[leaf.0].slots[leaf.1].as_mut().expect("it is taken").aabb = aabb);
    has(&no_box(Aabb::EMPTY), |f| matches!(f, WideFault::NoBox { .. }));
    has(&no_box(Aabb { min: [f32::NAN; 3], max: [1.0; 3] }), |f| matches!(f, WideFault::NoBox { .. }));
    has(&no_box(Aabb { min: [9.0; 3], max: [9.0; 3] }), |f| matches!(f, WideFault::Outside { .. }));
    let inner_box = faults(&|tree| {
        tree.nodes[inner.0].slots[inner.1].as_mut().expect("it is taken").aabb = Aabb { min: [0.0; 3], max: [0.0; 3] };
    });
    has(&inner_box, |f| matches!(f, WideFault::Outside { .. }));
    assert!(summary(&inner_box).contains("does not hold"));
}

#[test]
fn planted_faults_of_compressed_nodes_are_found() {
    let (_, binary) = tree(60, 4);
    let settings = settings(Width::Eight, Layout::Cwbvh, CollapseMethod::Optimal, None);
    let good = PackedTree::new(&collapse(&binary, &settings).unwrap(), Layout::Cwbvh).unwrap();
    let faults = |change: &dyn Fn(&mut prbvh_kernel::trace::wide::CwbvhNode)| {
        let mut packed = good.clone();
        let PackedNodes::Cwbvh(nodes) = &mut packed.nodes else { unreachable!() };
        change(&mut nodes[0]);
        packed.unpack().expect_err("a fault was planted")
    };
    let meaningless = |faults: &[WideFault], wanted: &str| {
        let found = faults.iter().any(|f| matches!(f, WideFault::Meaningless { what, .. } if what.contains(wanted)));
        assert!(found, "{wanted}: {faults:?}");
    };
    meaningless(&faults(&|node| node.scales_and_inner &= !0xff00), "scale of y");
    meaningless(&faults(&|node| node.scales_and_inner |= 0xff), "scale of x");
    meaningless(&faults(&|node| node.first_node = u32::MAX), "first node");
    meaningless(&faults(&|node| node.meta = [0x1f1f_1f1f; 2]), "a node");
    meaningless(
        &faults(&|node| {
            node.scales_and_inner &= 0x00ff_ffff;
            node.meta = [0xbfbf_bfbf; 2];
        }),
        "a leaf",
    );
    meaningless(
        &faults(&|node| {
            node.scales_and_inner &= 0x00ff_ffff;
            node.meta = [0x2020_2020; 2];
            node.first_triangle = u32::MAX;
        }),
        "first triangle",
    );
    // A face that came inward.
    let narrow = faults(&|node| node.max_x = [0; 2]);
    assert!(narrow.iter().any(|f| matches!(f, WideFault::Outside { .. } | WideFault::NoBox { .. })), "{narrow:?}");
}

#[test]
fn sizes_are_those_of_the_layouts() {
    let (_, binary) = tree(500, 8);
    let packed = |width, layout| {
        let settings = settings(width, layout, CollapseMethod::Optimal, None);
        PackedTree::new(&collapse(&binary, &settings).unwrap(), layout).unwrap()
    };
    let [four, eight, compressed] =
        [(Width::Four, Layout::Soa), (Width::Eight, Layout::Soa), (Width::Eight, Layout::Cwbvh)]
            .map(|(w, l)| packed(w, l));
    for (packed, bytes) in [(&four, 128), (&eight, 256), (&compressed, 80)] {
        assert_eq!(packed.nodes.node_bytes(), bytes);
        assert_eq!(packed.bytes(), bytes * packed.nodes.len() + 4 * 500);
        assert_eq!(packed.bytes_per_triangle(), packed.bytes() as f64 / 500.0);
    }
    assert_ne!(eight.hash(), compressed.hash());
    assert_eq!(eight.hash(), packed(Width::Eight, Layout::Soa).hash());
}
