//! Medians, means and growth.

/// The median; NaN of none.
#[must_use]
pub fn median(values: &[f64]) -> f64 {
    prbvh_lab::compare::median(values).unwrap_or(f64::NAN)
}

/// The geometric mean; NaN of none.
#[must_use]
pub fn geometric_mean(values: &[f64]) -> f64 {
    (values.iter().map(|value| value.ln()).sum::<f64>() / values.len() as f64).exp()
}

/// The largest value; NaN of none, and where one is NaN.
#[must_use]
pub fn worst(values: &[f64]) -> f64 {
    values.iter().copied().reduce(|a, b| if a.is_nan() || a > b { a } else { b }).unwrap_or(f64::NAN)
}

/// Exponent of `y = c · x^exponent`, by least squares of the logarithms; none for fewer than two different `x`, or a value that is not
/// positive.
#[must_use]
pub fn exponent(points: &[(f64, f64)]) -> Option<f64> {
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let count = logs.len() as f64;
    let mean = |pick: fn(&(f64, f64)) -> f64| logs.iter().map(pick).sum::<f64>() / count;
    let (mean_x, mean_y) = (mean(|p| p.0), mean(|p| p.1));
    let covariance: f64 = logs.iter().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum();
    let variance: f64 = logs.iter().map(|(x, _)| (x - mean_x).powi(2)).sum();
    Some(covariance / variance).filter(|fitted| fitted.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_and_means_by_hand() {
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0]), 2.5);
        assert!(median(&[]).is_nan() && geometric_mean(&[]).is_nan() && worst(&[]).is_nan());
        assert!((geometric_mean(&[0.5, 2.0, 8.0]) - 2.0).abs() < 1e-15);
        assert_eq!(worst(&[0.5, 2.0, 1.0]), 2.0);
        assert!(worst(&[3.0, f64::NAN, 1.0]).is_nan() && worst(&[f64::NAN, 1.0]).is_nan());
    }

    #[test]
    fn the_exponent_is_that_of_the_power() {
        for power in [0.0, 1.0, 1.15, 2.0] {
            let points: Vec<(f64, f64)> =
                (14..24).map(|k| f64::from(1 << k)).map(|n| (n, 3e-9 * n.powf(power))).collect();
            assert!((exponent(&points).unwrap() - power).abs() < 1e-12);
        }
    }

    #[test]
    fn a_fit_of_too_little_is_none() {
        assert_eq!(exponent(&[]), None);
        assert_eq!(exponent(&[(4.0, 1.0)]), None);
        assert_eq!(exponent(&[(4.0, 1.0), (4.0, 2.0)]), None);
        assert_eq!(exponent(&[(4.0, 1.0), (8.0, 0.0)]), None);
    }
}
