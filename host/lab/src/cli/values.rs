//! Values that several commands take.

/// The scene that needs no file.
pub(super) const BUILT_IN: &str = "built-in";

pub(super) fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value >= 0.0 && value.is_finite() => Ok(value),
        _ => Err("not a finite number of at least 0".to_owned()),
    }
}

pub(super) fn threads(text: &str) -> Result<usize, String> {
    const MOST: usize = 1024;
    match text.parse::<usize>() {
        Ok(threads) if threads <= MOST => Ok(threads),
        _ => Err(format!("not a number from 0 to {MOST}")),
    }
}
