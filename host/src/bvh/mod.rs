//! The tree handed out: decoding, validation, quality, file.
/// x
pub struct SahModel {
    /// a
    pub c_traversal: f64,
    /// b
    pub c_intersect: f64,
}
impl Default for SahModel {
    fn default() -> Self {
        Self { c_traversal: 3.0, c_intersect: 2.0 }
    }
}
