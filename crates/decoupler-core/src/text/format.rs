use std::{fmt, time::Duration};

/// Text in place of a missing number.
const NO_NUMBER: &str = "–";

/// Formats a number with three significant digits: `0.217`, `12.3`, `1234`; `6.13e-5` below 0.001 and from
/// 100000; a dash for none, NaN and infinity.
pub fn format_number(value: impl Into<Option<f64>>) -> String {
    let Some(value) = value.into().filter(|value| value.is_finite()) else {
        return NO_NUMBER.to_owned();
    };
    if value == 0.0 {
        return "0".to_owned();
    }
    let scientific = format!("{value:.2e}");
    if !(1e-3..99_999.5).contains(&value.abs()) {
        return scientific;
    }
    // The exponent after rounding: 9.999 is 10.0.
    let exponent = scientific
        .split_once('e')
        .and_then(|(_, exponent)| exponent.parse().ok());
    let decimals = 2_i32.saturating_sub(exponent.unwrap_or(0));
    format!("{value:.*}", usize::try_from(decimals).unwrap_or(0))
}

/// Formats a number with `decimals` decimals, for figures whose distance from a round value matters, as of R² from 1:
/// `0.9987`. As [`format_number`] does where it is 10000 or more in magnitude, or none.
pub fn format_decimals(value: impl Into<Option<f64>>, decimals: usize) -> String {
    match value.into() {
        Some(value) if value.abs() < 1e4 => {
            let text = format!("{value:.decimals$}");
            // No -0.0000.
            match text.strip_prefix('-') {
                Some(zero) if zero.chars().all(|digit| "0.".contains(digit)) => zero.to_owned(),
                _ => text,
            }
        }
        value => format_number(value),
    }
}

/// Formats R², the coefficient of determination, with four decimals.
pub fn format_r2(value: impl Into<Option<f64>>) -> String {
    format_decimals(value, 4)
}

/// Formats a number as [`format_number`] does, with a percent sign.
pub fn format_percent(value: impl Into<Option<f64>>) -> String {
    match format_number(value) {
        text if text == NO_NUMBER => text,
        text => format!("{text} %"),
    }
}

/// Formats a duration: `0.23 ms`, `340 ms`, `12.3 s`, `4 min 5 s`, `1 h 2 min`.
pub fn format_duration(duration: Duration) -> String {
    let seconds = duration.as_secs_f64();
    let whole = seconds.round() as u64;
    match whole {
        _ if seconds < 0.9995 => format!("{} ms", format_number(1e3 * seconds)),
        0..60 => format!("{} s", format_number(seconds)),
        60..3600 => format!("{} min {} s", whole / 60, whole % 60),
        _ => format!("{} h {} min", whole / 3600, whole % 3600 / 60),
    }
}

/// Returns the text with its first letter as a capital.
pub fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    first.chain(letters).collect()
}

/// `1 sample`, `2 samples`.
pub fn counted<N: fmt::Display + PartialEq + From<u8>>(count: N, noun: &str) -> String {
    let is_one = count == N::from(1);
    format!("{count} {noun}{}", if is_one { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_the_same_everywhere() {
        let cases = [
            (0.0, "0"),
            (-0.0, "0"),
            (2.2812, "2.28"),
            (0.2171, "0.217"),
            (-12.345, "-12.3"),
            (9.999, "10.0"),
            (1234.4, "1234"),
            (99_999.0, "99999"),
            (100_000.0, "1.00e5"),
            (0.001, "0.00100"),
            (0.000_999, "9.99e-4"),
            (6.13e-5, "6.13e-5"),
            (2.36e-12, "2.36e-12"),
            (f64::MAX, "1.80e308"),
            (f64::from_bits(1), "4.94e-324"),
            (f64::NAN, "–"),
            (f64::INFINITY, "–"),
        ];
        for (value, text) in cases {
            assert_eq!(format_number(value), text, "{value}");
        }
        assert_eq!(format_number(None), "–");
        assert_eq!(format_percent(2.28), "2.28 %");
        assert_eq!(format_percent(Some(f64::NAN)), "–");
    }

    #[test]
    fn decimals_are_kept_where_they_are_asked_for() {
        let cases = [
            (Some(0.998_76), "0.9988"),
            (Some(1.0), "1.0000"),
            (Some(-0.12), "-0.1200"),
            (Some(-1e-7), "0.0000"),
            (Some(-123_456.0), "-1.23e5"),
            (Some(f64::NAN), "–"),
            (Some(f64::NEG_INFINITY), "–"),
            (None, "–"),
        ];
        for (value, text) in cases {
            assert_eq!(format_r2(value), text);
        }
    }

    #[test]
    fn times_take_the_unit_one_would_say() {
        let cases = [
            (0.0, "0 ms"),
            (0.000_23, "0.230 ms"),
            (0.34, "340 ms"),
            (0.9999, "1.00 s"),
            (12.34, "12.3 s"),
            (59.7, "1 min 0 s"),
            (245.0, "4 min 5 s"),
            (3720.0, "1 h 2 min"),
        ];
        for (seconds, text) in cases {
            assert_eq!(format_duration(Duration::from_secs_f64(seconds)), text);
        }
    }
}
