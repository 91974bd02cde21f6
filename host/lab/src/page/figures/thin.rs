//! Fewer points where many would fall on one another.

/// Most points of a curve.
const MOST: usize = 240;
/// Points nearer than this to the last one are left out, pixels.
const NEAR: f64 = 3.0;

/// Indices of the points to draw: the first, the last, the lowest on the page and those that stand apart, about [`MOST`] at most.
pub(super) fn thinned(points: &[(f64, f64)]) -> Vec<usize> {
    if points.len() <= 60 {
        return (0..points.len()).collect();
    }
    let lowest = (0..points.len()).fold(0, |lowest, k| if points[k].1 > points[lowest].1 { k } else { lowest });
    let mut near = NEAR;
    loop {
        let mut kept: Vec<usize> = vec![0];
        let mut last = points[0];
        for (k, &(x, y)) in points.iter().enumerate().skip(1) {
            if k == lowest || k + 1 == points.len() || (x - last.0).abs().max((y - last.1).abs()) >= near {
                kept.push(k);
                last = (x, y);
            }
        }
        if kept.len() <= MOST {
            return kept;
        }
        near *= 1.5;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_curves_are_whole() {
        assert_eq!(thinned(&[(1.0, 1.0); 5]), [0, 1, 2, 3, 4]);
        assert!(thinned(&[]).is_empty());
    }

    #[test]
    fn long_ones_keep_their_ends_and_their_lowest() {
        let noisy: Vec<(f64, f64)> = (0..20_000)
            .map(|k| (f64::from(k) * 0.05, if k == 7_003 { 900.0 } else { f64::from(k * 7919 % 400) }))
            .collect();
        let kept = thinned(&noisy);
        assert!(kept.len() <= MOST && kept.len() > 20, "{}", kept.len());
        assert!(kept.contains(&0) && kept.contains(&7_003) && kept.contains(&19_999));
        assert!(kept.windows(2).all(|pair| pair[0] < pair[1]));
        // All in one place.
        assert_eq!(thinned(&[(5.0, 5.0); 4000]), [0, 3999]);
    }
}
