//! EXT_mesh_gpu_instancing: a node that shows its mesh many times.

use super::accessor::Accessors;
use super::document::{Instancing, Whole};
use super::extensions::INSTANCING;
use super::transform::Transform;
use crate::scene::error::SceneError;

/// Where the copies of a mesh stand, in the space of its node.
pub(super) struct Instances {
    pub(super) count: usize,
    translation: Option<Vec<[f32; 3]>>,
    rotation: Option<Vec<[f32; 4]>>,
    scale: Option<Vec<[f32; 3]>>,
    /// An accessor of theirs where none has data: then nothing in the file stands for an instance.
    implied: Option<Whole>,
}

impl Instances {
    /// None where nothing tells how many there are.
    pub(super) fn read(accessors: &Accessors<'_>, instancing: &Instancing) -> Result<Option<Self>, SceneError> {
        let attribute = |name: &str| instancing.attributes.get(name).copied();
        let [translation, rotation, scale] = ["TRANSLATION", "ROTATION", "SCALE"].map(attribute);
        // One that moves nothing, such as an identifier, tells the number too.
        let Some(any) = instancing.attributes.values().next() else { return Ok(None) };
        let count = accessors.get(*any)?.count.0;
        let mut has_data = false;
        for index in instancing.attributes.values() {
            let accessor = accessors.get(*index)?;
            has_data |= accessor.buffer_view.is_some();
            if accessor.count.0 != count {
                let message = format!("{} elements for {count} instances of {INSTANCING}", accessor.count.0);
                return Err(accessors.fault(*index, message));
            }
        }
        let vectors =
            |index: Option<Whole>| index.map(|index| accessors.floats(index, "VEC3", "three numbers")).transpose();
        Ok(Some(Self {
            count,
            translation: vectors(translation)?,
            rotation: rotation.map(|index| accessors.floats(index, "VEC4", "four numbers")).transpose()?,
            scale: vectors(scale)?,
            implied: (!has_data).then_some(*any),
        }))
    }

    /// Counts `each` elements for every instance that nothing in the file stands for.
    pub(super) fn imply(&self, accessors: &Accessors<'_>, each: usize) -> Result<(), SceneError> {
        match self.implied {
            Some(accessor) => accessors.imply(accessor, self.count.saturating_mul(each)),
            None => Ok(()),
        }
    }

    pub(super) fn transform(&self, index: usize) -> Transform {
        Transform::decomposed(
            self.translation.as_ref().map_or([0.0; 3], |all| all[index].map(f64::from)),
            self.rotation.as_ref().map_or([0.0, 0.0, 0.0, 1.0], |all| all[index].map(f64::from)),
            self.scale.as_ref().map_or([1.0; 3], |all| all[index].map(f64::from)),
        )
    }
}
