//! Float64 numbers as float32 on one side of them.

/// The largest float32 that is not above `x`.
pub(crate) fn at_most(x: f64) -> f32 {
    let rounded = x as f32;
    if f64::from(rounded) > x { rounded.next_down() } else { rounded }
}

/// The smallest float32 that is not below `x`.
pub(crate) fn at_least(x: f64) -> f32 {
    -at_most(-x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_rounded_stays_on_its_side() {
        for x in [0.0, 1.0, 0.1, -0.1, 1e-50, -1e-50, 3.4e38, 1.000_000_01, -7.3e20] {
            let (low, high) = (at_most(x), at_least(x));
            assert!(f64::from(low) <= x && f64::from(high) >= x, "{x}");
            let exact = f64::from(x as f32) == x;
            assert_eq!(low == high, exact, "{x}");
            assert!(exact || low.next_up() == high, "{x}");
        }
    }
}
