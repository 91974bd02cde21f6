//! Numbers for people.

/// With a comma between thousands: `1,442,014`.
pub fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (k, digit) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// With the unit that leaves one to three digits before the point: `12.3 ms`.
pub fn seconds(value: f64) -> String {
    let (scaled, unit) = match value {
        v if v >= 1.0 || v == 0.0 => (v, "s"),
        v if v >= 1e-3 => (v * 1e3, "ms"),
        v => (v * 1e6, "µs"),
    };
    format!("{} {unit}", significant(scaled))
}

/// In KiB, MiB or GiB: `12.3 MiB`.
pub fn bytes(value: u64) -> String {
    const UNITS: [&str; 4] = ["KiB", "MiB", "GiB", "TiB"];
    if value < 1024 {
        return format!("{value} B");
    }
    let mut scaled = value as f64 / 1024.0;
    let mut unit = 0;
    while scaled >= 1024.0 && unit + 1 < UNITS.len() {
        scaled /= 1024.0;
        unit += 1;
    }
    format!("{} {}", significant(scaled), UNITS[unit])
}

/// Three digits, more before the point where it takes them: `1.23`, `12.3`, `123`, `1234`.
pub fn significant(value: f64) -> String {
    let magnitude = value.abs();
    let places = match magnitude {
        m if m >= 99.95 => 0,
        m if m >= 9.995 => 1,
        _ => 2,
    };
    format!("{value:.places$}")
}

/// The text, or its start and an ellipsis if it has more than `most` characters.
pub fn shortened(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_owned();
    }
    let start: String = text.chars().take(most.saturating_sub(1)).collect();
    format!("{}…", start.trim_end())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands() {
        assert_eq!([0, 999, 1000, 1_442_014].map(count), ["0", "999", "1,000", "1,442,014"]);
    }

    #[test]
    fn units_of_time_and_memory() {
        assert_eq!(
            [0.0, 2.5e-6, 0.0123, 1.234, 123.4, 9999.0].map(seconds),
            ["0.00 s", "2.50 µs", "12.3 ms", "1.23 s", "123 s", "9999 s"]
        );
        assert_eq!([0, 1023, 1024, 1 << 20, 3 << 29].map(bytes), ["0 B", "1023 B", "1.00 KiB", "1.00 MiB", "1.50 GiB"]);
    }

    #[test]
    fn rounding_does_not_add_a_digit() {
        assert_eq!([9.994, 9.996, 99.94, 99.96].map(significant), ["9.99", "10.0", "99.9", "100"]);
    }

    #[test]
    fn long_names_end_with_an_ellipsis() {
        assert_eq!(shortened("Größe", 5), "Größe");
        assert_eq!(shortened("Größe der Szene", 7), "Größe…");
    }
}
