//! Methods that a program may lack.

/// A method that this program was built without.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{method} is not in this program: it was built without the cargo feature `{feature}`")]
pub struct FeatureOff {
    /// The method.
    pub method: &'static str,
    /// The cargo feature that has it.
    pub feature: &'static str,
}

#[cfg(test)]
mod tests {
    use super::super::Initial;
    use super::*;
    use crate::build::TreeletSize;

    #[test]
    fn a_method_that_is_left_out_says_so() {
        let initial = Initial::Atrbvh { treelet: TreeletSize::default() };
        assert_eq!(initial.to_string(), "atrbvh");
        assert_eq!(initial.check().is_ok(), cfg!(feature = "atrbvh"));
        let error = FeatureOff { method: "atrbvh", feature: "atrbvh" }.to_string();
        assert!(error.contains("without the cargo feature `atrbvh`"), "{error}");
    }
}
