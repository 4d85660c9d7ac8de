/// A number of any size in a few characters, for messages: `0.5`, `-5`, `1e300`.
pub fn short(value: f64) -> String {
    if value == 0.0 || (1e-4..1e6).contains(&value.abs()) {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_number_takes_three_hundred_digits() {
        let cases = [
            (0.0, "0"),
            (-5.0, "-5"),
            (0.25, "0.25"),
            (1e6, "1e6"),
            (-1e300, "-1e300"),
            (2.5e-300, "2.5e-300"),
            (f64::NAN, "NaN"),
            (f64::INFINITY, "inf"),
        ];
        for (value, text) in cases {
            assert_eq!(short(value), text);
        }
        assert!(short(f64::MAX).len() < 25 && short(-f64::MIN_POSITIVE).len() < 25);
    }
}
