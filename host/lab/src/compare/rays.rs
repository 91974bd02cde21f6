//! The trees of a scene under the same rays.

use super::{MethodError, Picture, RaySettings};
use crate::render::{
    Camera, RayCost, RenderError, RenderSettings, Rendering, TracedTree, clear_view, encode_png, heat_map, heat_map_in,
    render, shaded,
};
use prbvh::device::Device;
use prbvh::scene::Scene;

/// Kinds of rays, in the order of all arrays here.
const KINDS: [&str; 3] = ["primary", "shadow", "secondary"];

impl RaySettings {
    fn render_settings(&self) -> RenderSettings {
        let Self { width, height, samples, bounces, light_samples, .. } = *self;
        RenderSettings { width, height, samples, bounces, light_samples }
    }
}

/// What the rays of all views hit: the same for every tree over a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Hits {
    views: Vec<ViewHits>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct ViewHits {
    /// Rays of each kind, and those that hit something.
    counts: [[u64; 2]; 3],
    /// Hash of the picture's bits.
    picture: blake3::Hash,
}

impl Hits {
    /// The first difference, if there is one.
    pub(super) fn difference(&self, expected: &Self) -> Option<String> {
        for (view, (own, other)) in self.views.iter().zip(&expected.views).enumerate() {
            for (kind, (own, other)) in KINDS.iter().zip(own.counts.iter().zip(&other.counts)) {
                if own != other {
                    let [[rays, hits], [other_rays, other_hits]] = [own, other];
                    return Some(format!(
                        "view {view}: {hits} of {rays} {kind} rays hit, not {other_hits} of {other_rays}"
                    ));
                }
            }
            if own.picture != other.picture {
                return Some(format!("view {view}: another picture"));
            }
        }
        (self.views.len() != expected.views.len()).then(|| "another number of views".to_owned())
    }
}

/// Rays through one tree.
#[derive(Clone, Debug)]
pub(super) struct Traced {
    /// Rays of each kind.
    pub(super) rays: [u64; 3],
    /// Time of the tracing kernels for each kind, seconds.
    pub(super) seconds: [f64; 3],
    /// Tests per ray of any kind: boxes, triangles.
    pub(super) tests: [f64; 2],
    /// What they hit.
    pub(super) hits: Hits,
}

/// Cameras of a scene, and the pictures of it.
#[derive(Debug, Default)]
pub(super) struct Views {
    cameras: Vec<Camera>,
    shaded: Vec<Picture>,
    heat: Vec<(String, Rendering)>,
}

impl Views {
    /// Traces `tree` on all views. Keeps pictures: shaded ones of the first tree, and the tests per pixel under `heat_of`.
    pub(super) fn trace(
        &mut self,
        device: &mut dyn Device,
        scene: &Scene,
        tree: TracedTree<'_>,
        settings: (&RaySettings, usize),
        heat_of: Option<&str>,
    ) -> Result<Traced, MethodError> {
        let (settings, up) = settings;
        if self.cameras.is_empty() {
            let views = (0..settings.views).map(|view| clear_view(view, device, scene, tree, up));
            self.cameras = views.collect::<Result<_, RenderError>>()?;
        }
        let mut traced = Traced { rays: [0; 3], seconds: [0.0; 3], tests: [0.0; 2], hits: Hits { views: Vec::new() } };
        let is_first = self.shaded.is_empty();
        for (view, camera) in self.cameras.iter().enumerate() {
            let rendering = render(device, scene, tree, camera, &settings.render_settings())?;
            traced.add(&rendering);
            if let Some(method) = heat_of {
                if is_first {
                    self.shaded.push(picture(format!("view {view}, shaded"), &rendering, &shaded(&rendering)));
                }
                // The view from inside, where there is one.
                if view == 1.min(self.cameras.len() - 1) {
                    self.heat.push((format!("view {view}, tests per pixel, {method}"), rendering));
                }
            }
        }
        let all = traced.rays.iter().sum::<u64>();
        traced.tests = traced.tests.map(|tests| if all > 0 { tests / all as f64 } else { 0.0 });
        Ok(traced)
    }

    /// The pictures; those of the tests per pixel have one scale.
    pub(super) fn into_pictures(self) -> Vec<Picture> {
        let scales = self.heat.iter().map(|(_, rendering)| heat_map(rendering).1);
        let scale = scales.max_by(|a, b| a.most.total_cmp(&b.most));
        let mut pictures = self.shaded;
        if let Some(scale) = scale {
            let heat = self.heat.iter().map(|(title, rendering)| {
                let title = format!("{title} (white: {:.0} and more)", scale.most);
                picture(title, rendering, &heat_map_in(rendering, scale))
            });
            pictures.extend(heat);
        }
        pictures
    }
}

impl Traced {
    fn add(&mut self, rendering: &Rendering) {
        let kinds = [&rendering.primary, &rendering.shadow, &rendering.secondary];
        for (k, cost) in kinds.into_iter().enumerate() {
            self.rays[k] += cost.rays;
            self.seconds[k] += cost.seconds;
            self.tests[0] += cost.box_tests_per_ray * cost.rays as f64;
            self.tests[1] += cost.triangle_tests_per_ray * cost.rays as f64;
        }
        let mut hasher = blake3::Hasher::new();
        for radiance in &rendering.radiance {
            hasher.update(bytemuck::cast_slice(&radiance.map(f32::to_bits)));
        }
        let counts = kinds.map(|&RayCost { rays, hits, .. }| [rays, hits]);
        self.hits.views.push(ViewHits { counts, picture: hasher.finalize() });
    }
}

fn picture(title: String, rendering: &Rendering, pixels: &[u8]) -> Picture {
    let Rendering { width, height, .. } = *rendering;
    let mut png = Vec::new();
    if let Err(error) = encode_png(&mut png, width, height, pixels) {
        tracing::warn!("no picture \"{title}\": {error}");
    }
    Picture { title, width, height, png }
}

/// Whether no ray from an eye hit anything.
pub(super) fn sees_nothing(traced: &Traced) -> bool {
    traced.hits.views.iter().all(|view| view.counts[0][1] == 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use prbvh::device::cpu::CpuDevice;
    use prbvh::pipeline::{Initial, Optimizer, Settings, optimize};
    use prbvh::scene::built_in;
    use std::ops::ControlFlow;

    const SMALL: RaySettings = RaySettings { width: 16, height: 8, samples: 1, bounces: 1, light_samples: 1, views: 3 };

    fn traced(initial: Initial, views: &mut Views) -> Traced {
        let scene = built_in(500);
        let mut device = CpuDevice::new(1).unwrap();
        let settings = Settings::default().with(|s| {
            s.initial = initial;
            s.optimizer = Optimizer::None;
        });
        let tree = optimize(&scene, &mut device, &settings, &mut |_| ControlFlow::Continue(())).unwrap().tree;
        views.trace(&mut device, &scene, (&tree).into(), (&SMALL, 1), Some("any")).unwrap()
    }

    #[test]
    fn two_trees_hit_the_same_and_a_planted_fault_is_found() {
        let mut views = Views::default();
        let one = traced(Initial::Lbvh, &mut views);
        let other = traced(Initial::SahSweep, &mut views);
        assert_eq!(one.hits.difference(&other.hits), None);
        assert_ne!(one.tests, other.tests);
        assert!(!sees_nothing(&one) && one.rays[0] == 3 * 16 * 8);

        let mut hits = one.hits.clone();
        hits.views[1].counts[1][1] += 1;
        let text = hits.difference(&one.hits).unwrap();
        assert!(text.contains("view 1") && text.contains("shadow"), "{text}");
        let mut hits = one.hits.clone();
        hits.views[2].picture = blake3::hash(b"another");
        assert!(hits.difference(&one.hits).unwrap().contains("view 2"));
        let mut hits = one.hits.clone();
        hits.views.pop();
        assert!(hits.difference(&one.hits).is_some());

        let pictures = views.into_pictures();
        let titles: Vec<&str> = pictures.iter().map(|picture| picture.title.as_str()).collect();
        assert_eq!(titles[..3], ["view 0, shaded", "view 1, shaded", "view 2, shaded"]);
        assert!(titles.len() == 5 && titles[3].starts_with("view 1, tests per pixel, any"), "{titles:?}");
        assert!(pictures.iter().all(|picture| picture.png.starts_with(b"\x89PNG")));
    }
}
