//! A case made ready: its scene, and the scenes and rays it is compared with.

use super::Case;
use super::rays;
use super::scaling::{AXES, exact_exponents, scaled, turned};
use prbvh::scene::{Place, Scene, SceneError};
use prbvh::trace::{Ray, TraceError};
use prbvh_kernel::setup::Triangle;

/// A case made ready.
pub(super) struct Ready<'a> {
    pub(super) case: &'a Case,
    pub(super) scene: Scene,
    pub(super) left_out: u32,
    /// What is wrong with the screening.
    pub(super) screening: Option<String>,
    /// The scene times powers of two.
    pub(super) scaled: Vec<(i32, Scene)>,
    /// The scene with the axes in other places.
    pub(super) turned: Vec<([usize; 3], Scene)>,
    pub(super) rays: Vec<Ray>,
    /// What they hit without a tree.
    pub(super) hits: Vec<(f32, u32)>,
}

/// Why a case cannot be made ready: a mistake in the catalogue or in the screening.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaseError {
    /// No triangle of it is finite.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Its rays are none.
    #[error(transparent)]
    Trace(#[from] TraceError),
}

impl<'a> Ready<'a> {
    /// # Errors
    /// If there is no scene.
    pub(super) fn new(case: &'a Case, full: bool) -> Result<Self, CaseError> {
        let raw = case.triangles(full);
        let (scene, left_out) = Scene::from_finite(case.name, raw.clone())?;
        let screening = screening_fault(case.name, &raw, &left_out);
        let with = |triangles| Scene::from_triangles(case.name, triangles);
        let scaled = exact_exponents(&scene.triangles)
            .into_iter()
            .map(|exponent| Ok((exponent, with(scaled(&scene.triangles, exponent))?)))
            .collect::<Result<_, SceneError>>()?;
        let turned = AXES
            .into_iter()
            .map(|axes| Ok((axes, with(turned(&scene.triangles, axes))?)))
            .collect::<Result<_, SceneError>>()?;
        let rays = rays::rays(&scene.triangles, case.rays);
        let hits = rays::without_tree(&scene.triangles, &rays)?;
        Ok(Self { case, scene, left_out: left_out.len() as u32, screening, scaled, turned, rays, hits })
    }
}

/// A library that takes triangles as they are must refuse the first that is not finite, by its number, and one that leaves such
/// triangles out must leave out these and no others.
fn screening_fault(name: &str, raw: &[Triangle], left_out: &[u32]) -> Option<String> {
    let coordinates: &[f32] = bytemuck::cast_slice(raw);
    let bad: Vec<u32> =
        (0..).zip(coordinates.chunks(9)).filter(|(_, t)| !t.iter().all(|x| x.is_finite())).map(|(k, _)| k).collect();
    if left_out != bad {
        return Some(format!("{} triangles left out, {} are not finite", left_out.len(), bad.len()));
    }
    match (Scene::from_triangles(name, raw.to_vec()), bad.first()) {
        (Ok(_), None) => None,
        (Err(SceneError::NotFinite { place: Place::Element("triangle", index), .. }), Some(&first))
            if index == u64::from(first) =>
        {
            None
        }
        (Ok(_), Some(first)) => Some(format!("triangle {first} is not finite, and was taken")),
        (Err(error), _) => Some(format!("refused for another reason: {error}")),
    }
}

#[cfg(test)]
mod tests {
    use super::super::shapes;
    use super::*;

    #[test]
    fn screening_is_exact() {
        let raw = shapes::not_finite(40, 7.0);
        let (_, left_out) = Scene::from_finite("not finite", raw.clone()).unwrap();
        assert_eq!(left_out, [2, 9, 16, 23, 30, 37]);
        assert_eq!(screening_fault("x", &raw, &left_out), None);
        assert_eq!(screening_fault("x", &raw, &left_out[1..]).unwrap(), "5 triangles left out, 6 are not finite");
        assert_eq!(screening_fault("x", &shapes::uniform(5, 1.0), &[]), None);
    }
}
