//! Round numbers along an axis.

use super::svg;
use crate::report::axis::{Axis, fixed, superscript};
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use prbvh::format;
use std::ops::Range;

/// A labelled place of an axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tick {
    /// Drawn coordinate ([`Axis::place`]).
    pub(super) at: f64,
    /// Its label.
    pub(super) text: String,
}

/// The range of an axis with its ticks, for the drawing library.
pub(super) struct Ticked {
    pub(super) range: Range<f64>,
    pub(super) ticks: Vec<Tick>,
}

impl Ranged for Ticked {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let share = (value - self.range.start) / (self.range.end - self.range.start);
        limit.0 + (share * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks.iter().map(|tick| tick.at).collect()
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

impl ValueFormatter<f64> for Ticked {
    fn format_ext(&self, value: &f64) -> String {
        let tick = self.ticks.iter().find(|tick| tick.at == *value);
        tick.map_or_else(String::new, |tick| svg::clean(&format::shortened(&tick.text, 48)))
    }
}

/// About `most` ticks, never many more: steps of 1, 2 or 5 times a power of ten; on a logarithm decades, and parts of them where there
/// are few.
pub(super) fn ticks(axis: &Axis, most: usize) -> Vec<Tick> {
    let (low, high) = (axis.range().start, axis.range().end);
    let most = most.max(2);
    if !axis.is_log() {
        return linear(low, high, most).into_iter().map(|(at, text)| Tick { at, text }).collect();
    }
    let decades = high - low;
    if decades < 0.8 {
        let values = linear(10f64.powf(low), 10f64.powf(high), most).into_iter().filter(|&(value, _)| value > 0.0);
        return values.map(|(value, text)| Tick { at: value.log10(), text }).collect();
    }
    let mantissas: &[f64] = match most as f64 / decades {
        room if room >= 3.0 => &[1.0, 2.0, 5.0],
        room if room >= 2.0 => &[1.0, 3.0],
        _ => &[1.0],
    };
    let every = (decades / most as f64).ceil().max(1.0) as i32;
    let first = low.floor() as i32;
    (first..=high.ceil() as i32)
        .filter(|decade| decade.rem_euclid(every) == 0)
        .flat_map(|decade| mantissas.iter().map(move |&mantissa| (mantissa, decade)))
        .map(|(mantissa, decade)| Tick { at: mantissa.log10() + f64::from(decade), text: power(mantissa, decade) })
        .filter(|tick| tick.at >= low - 1e-9 && tick.at <= high + 1e-9)
        .collect()
}

fn linear(low: f64, high: f64, most: usize) -> Vec<(f64, String)> {
    let span = high - low;
    if !span.is_finite() || span <= 0.0 {
        return Vec::new();
    }
    let rough = span / most as f64;
    let unit = 10f64.powf(rough.log10().floor());
    let step =
        unit * [1.0, 2.0, 5.0, 10.0].into_iter().find(|step| step * unit >= rough * (1.0 - 1e-9)).unwrap_or(10.0);
    let places = (-(step.log10() + 1e-9).floor()).clamp(0.0, 12.0) as usize;
    let (first, last) = ((low / step).ceil(), (high / step).floor());
    let label = |value: f64| {
        if value.abs() >= 1e7 || step < 1e-6 && value != 0.0 { format!("{value:.2e}") } else { fixed(value, places) }
    };
    (0..=(last - first).max(0.0) as usize)
        .map(|k| (first + k as f64) * step)
        .filter(|&value| value <= high)
        .map(|value| (value, label(value)))
        .collect()
}

fn power(mantissa: f64, decade: i32) -> String {
    match decade {
        -4..=3 => fixed(mantissa * 10f64.powi(decade), 4),
        _ if mantissa == 1.0 => format!("10{}", superscript(decade)),
        _ => format!("{mantissa}·10{}", superscript(decade)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(axis: &Axis, most: usize) -> Vec<String> {
        ticks(axis, most).into_iter().map(|tick| tick.text).collect()
    }

    #[test]
    fn linear_steps_are_round() {
        assert_eq!(texts(&Axis::from_zero([100.0].into_iter()), 6), ["0", "20", "40", "60", "80", "100"]);
        assert_eq!(texts(&Axis::from_zero([0.001].into_iter()), 3), ["0", "0.0005", "0.001"]);
        assert_eq!(texts(&Axis::around([1e9, 2e9].into_iter()), 3), ["1.00e9", "1.50e9", "2.00e9"]);
    }

    #[test]
    fn logarithms_have_ticks_whatever_their_range() {
        assert_eq!(texts(&Axis::log_time([0.03, 0.05].into_iter()), 6), ["0.03", "0.04", "0.05"]);
        let decades = texts(&Axis::log([1.0, 800_000.0].into_iter()), 8);
        assert_eq!(decades, ["0.1", "1", "10", "100", "1000", "10⁴", "10⁵", "10⁶"]);
        let parts = texts(&Axis::log_time([0.01, 1.0].into_iter()), 9);
        assert_eq!(parts, ["0.01", "0.02", "0.05", "0.1", "0.2", "0.5", "1"]);
    }

    #[test]
    fn every_range_has_some_and_not_too_many() {
        for low in [1e-30f64, 1e-6, 0.4, 7.0, 1e12] {
            for factor in [1.0, 1.0001, 1.7, 30.0, 1e9] {
                for most in [2, 5, 12] {
                    let values = [low, low * factor];
                    for axis in [
                        Axis::around(values.into_iter()),
                        Axis::log(values.into_iter()),
                        Axis::log_time(values.into_iter()),
                        Axis::from_zero(values.into_iter()),
                    ] {
                        let ticks = ticks(&axis, most);
                        assert!((1..=2 * most + 2).contains(&ticks.len()), "{axis:?} {most}: {ticks:?}");
                        let range = axis.range();
                        let slack = 1e-6 * (range.end - range.start);
                        for tick in &ticks {
                            assert!(
                                tick.at >= range.start - slack && tick.at <= range.end + slack,
                                "{axis:?} {tick:?}"
                            );
                        }
                    }
                }
            }
        }
    }
}
