//! An axis of a plot: from numbers to the linear coordinate that is drawn, and back to labels.

use std::ops::Range;

/// Smallest range of a linear axis, as a share of its values: below it labels would differ in digits that nobody reads.
const SMALLEST_SPAN: f64 = 1e-3;
/// Decades of a logarithmic axis without values.
const NO_VALUES: Range<f64> = -6.0..0.0;
/// Most decades of a logarithmic axis: what lies deeper would squeeze what matters.
const MOST_DECADES: f64 = 7.0;

/// Linear or logarithmic, with a range that holds its values.
#[derive(Clone, Debug)]
pub(crate) struct Axis {
    range: Range<f64>,
    log: bool,
}

impl Axis {
    /// From 0 to a little more than the largest value.
    pub(crate) fn from_zero(values: impl Iterator<Item = f64>) -> Self {
        let highest = values.filter(|v| v.is_finite()).fold(0.0, f64::max);
        Self { range: 0.0..if highest > 0.0 { highest * 1.04 } else { 1.0 }, log: false }
    }

    /// The range as it is.
    pub(crate) fn between(low: f64, high: f64) -> Self {
        Self { range: low..high, log: false }
    }

    /// Around the values.
    pub(crate) fn around(values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = extremes(values).unwrap_or((0.0, 1.0));
        let span = (high - low).max(high.abs() * SMALLEST_SPAN).max(f64::MIN_POSITIVE);
        // More room below, where the last label stands.
        Self { range: low - 0.16 * span..high + 0.1 * span, log: false }
    }

    /// Whole decades around the positive values; where a value is clipped one more below, so that it stands apart.
    pub(crate) fn log(values: impl Iterator<Item = f64>) -> Self {
        let (positive, others): (Vec<f64>, Vec<f64>) = values.filter(|v| v.is_finite()).partition(|&v| v > 0.0);
        let range = extremes(positive.into_iter()).map_or(NO_VALUES, |(low, high)| {
            let high = (high.log10() + 0.05).ceil();
            let (lowest, most) = (low.log10().floor(), high - MOST_DECADES);
            let room = if others.is_empty() && lowest >= most { 0.0 } else { 1.0 };
            lowest.max(most) - room..high
        });
        Self { range, log: true }
    }

    /// A little more than the positive values take, with room on the left for what is clipped there.
    pub(crate) fn log_time(values: impl Iterator<Item = f64>) -> Self {
        let range = extremes(values.filter(|&v| v > 0.0)).map_or(NO_VALUES, |(low, high)| {
            let high = high.log10();
            let low = low.log10().max(high - MOST_DECADES);
            low - 0.12 * (high - low).max(1.0)..high + 0.04 * (high - low).max(1.0)
        });
        Self { range, log: true }
    }

    /// Where the value is drawn. What a logarithm cannot show, 0 above all, is drawn at the low end.
    pub(crate) fn place(&self, value: f64) -> f64 {
        let at = if !self.log {
            value
        } else if value > 0.0 {
            value.log10()
        } else {
            self.range.start
        };
        at.clamp(self.range.start, self.range.end)
    }

    /// Whether the value lies below the low end, so that [`Axis::place`] moves it.
    pub(crate) fn clips(&self, value: f64) -> bool {
        self.log && (value <= 0.0 || value.log10() < self.range.start)
    }

    pub(crate) fn is_log(&self) -> bool {
        self.log
    }

    pub(crate) fn range(&self) -> Range<f64> {
        self.range.clone()
    }

    /// Labels that there is room for, of at most `most`.
    pub(crate) fn labels(&self, most: usize) -> usize {
        if self.log { most.min((self.range.end - self.range.start) as usize + 1) } else { most }
    }

    /// Text at a drawn coordinate; empty between decades.
    pub(crate) fn label(&self, at: f64) -> String {
        if !self.log {
            let span = (self.range.end - self.range.start).log10().floor();
            return fixed(at, (2.0 - span).clamp(0.0, 12.0) as usize);
        }
        if (at - at.round()).abs() > 1e-9 {
            return String::new();
        }
        match at.round() as i32 {
            decade @ -2..=3 => fixed(10f64.powi(decade), 2),
            decade => format!("10{}", superscript(decade)),
        }
    }
}

fn extremes(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.filter(|v| v.is_finite()).fold(None, |extremes, v| {
        let (low, high) = extremes.unwrap_or((v, v));
        Some((low.min(v), high.max(v)))
    })
}

/// At most so many places, without zeros at the end.
pub(crate) fn fixed(value: f64, places: usize) -> String {
    let text = format!("{value:.places$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

pub(crate) fn superscript(value: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let digit = |c: char| c.to_digit(10).map_or('⁻', |digit| DIGITS[digit as usize]);
    value.to_string().chars().map(digit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithms_span_whole_decades_and_clip_zero() {
        let axis = Axis::log([0.5, 3e-4, 0.0].into_iter());
        assert_eq!(axis.range(), -5.0..0.0);
        assert!(axis.clips(0.0) && axis.clips(1e-9) && !axis.clips(3e-4));
        assert_eq!((axis.place(0.0), axis.place(0.01)), (-5.0, -2.0));
        assert_eq!(Axis::log([0.5, 3e-4].into_iter()).range(), -4.0..0.0, "nothing to stand apart");
        assert_eq!(Axis::log([0.5, 3e-9].into_iter()).range(), -8.0..0.0, "the lowest is clipped");
        assert_eq!(
            (axis.label(-4.0), axis.label(-1.0), axis.label(-0.5)),
            ("10⁻⁴".into(), "0.1".into(), String::new())
        );
    }

    #[test]
    fn equal_no_or_no_finite_values_make_a_range() {
        for axis in [
            Axis::around([7.0, 7.0].into_iter()),
            Axis::around([0.0].into_iter()),
            Axis::around([f64::NAN, f64::INFINITY].into_iter()),
            Axis::around([1e30, 1e30].into_iter()),
            Axis::log([0.0].into_iter()),
            Axis::log([1.0].into_iter()),
            Axis::log([1e-300, 1e300].into_iter()),
            Axis::from_zero([0.0].into_iter()),
            Axis::from_zero([].into_iter()),
        ] {
            let range = axis.range();
            assert!(range.start < range.end && range.start.is_finite() && range.end.is_finite(), "{axis:?}");
        }
    }

    #[test]
    fn labels_have_the_digits_that_matter() {
        assert_eq!(Axis::around([190.0, 310.0].into_iter()).label(220.0), "220");
        assert_eq!(Axis::around([0.1, 0.2].into_iter()).label(0.125), "0.125");
        assert_eq!(Axis::from_zero([2.5].into_iter()).label(-0.0), "0");
    }
}
