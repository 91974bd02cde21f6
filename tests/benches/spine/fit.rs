//! Growth of time with the number of triangles.

/// Exponent of `time = c · triangles^exponent`, by least squares of the logarithms; NaN for fewer than two sizes.
pub(crate) fn exponent(points: &[(f64, f64)]) -> f64 {
    let logs: Vec<(f64, f64)> = points.iter().map(|(n, t)| (n.ln(), t.ln())).collect();
    let count = logs.len() as f64;
    let mean = |pick: fn(&(f64, f64)) -> f64| logs.iter().map(pick).sum::<f64>() / count;
    let (mean_n, mean_t) = (mean(|p| p.0), mean(|p| p.1));
    let covariance: f64 = logs.iter().map(|(n, t)| (n - mean_n) * (t - mean_t)).sum();
    let variance: f64 = logs.iter().map(|(n, _)| (n - mean_n).powi(2)).sum();
    covariance / variance
}
