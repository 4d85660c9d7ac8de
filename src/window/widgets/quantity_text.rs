//! Parser of typed numbers with units: "0.5 mm", "20%", "120 kohm".

use std::ops::RangeInclusive;

use super::fields::input_text;

/// Returns the units accepted by a field of this unit, with their conversion factors to it.
fn units_of(unit: &str) -> &'static [(&'static str, f64)] {
    match unit {
        "mm" => &[("mm", 1.0), ("µm", 1e-3), ("cm", 10.0), ("m", 1e3), ("in", 25.4)],
        "Ω" => &[("Ω", 1.0), ("mΩ", 1e-3), ("kΩ", 1e3), ("MΩ", 1e6)],
        "Ω/mm" => &[("Ω/mm", 1.0), ("kΩ/mm", 1e3), ("Ω/cm", 0.1), ("Ω/m", 1e-3)],
        "°" => &[("°", 1.0), ("rad", 180.0 / std::f64::consts::PI)],
        "%" => &[("%", 1.0), ("‰", 0.1)],
        "µs" => &[("µs", 1.0), ("ms", 1e3), ("s", 1e6)],
        "Hz" => &[("Hz", 1.0), ("kHz", 1e3)],
        // A fraction of one.
        "" => &[("%", 0.01), ("‰", 1e-3)],
        _ => &[],
    }
}

/// Parses `text` for a field of this unit and returns the number in this unit.
///
/// # Errors
/// If it is not a number, has an incompatible unit, is not whole although `is_whole`, or is out of range.
pub(super) fn parse(text: &str, unit: &str, range: &RangeInclusive<f64>, is_whole: bool) -> Result<f64, String> {
    let typed = text.trim().replace('−', "-");
    let (number, rest) = split_number(&typed).ok_or_else(|| not_a_number(&typed, unit))?;
    let factor = match rest {
        "" => 1.0,
        _ if is_whole && unit.is_empty() => return Err(format!("“{typed}” is not a number: type digits only.")),
        _ => factor_of(rest, unit)?,
    };
    // Numbers in the unit itself are not changed; converted ones are rounded: 0.07 · 100 is 7.
    let value = if factor == 1.0 {
        number
    } else {
        format!("{:.14e}", number * factor).parse().unwrap_or(number * factor)
    };
    if !value.is_finite() {
        return Err(format!("“{typed}” is too large to be stored."));
    }
    if is_whole && value.fract() != 0.0 {
        return Err(format!("“{typed}” is not a whole number."));
    }
    let with_unit = |value: f64| {
        let space = if unit.is_empty() { "" } else { " " };
        let number = if is_whole { value.to_string() } else { input_text(value) };
        format!("{number}{space}{unit}").replace('-', "−")
    };
    if value < *range.start() {
        return Err(format!(
            "{} is too small: at least {}.",
            with_unit(value),
            with_unit(*range.start())
        ));
    }
    if value > *range.end() {
        return Err(format!(
            "{} is too large: at most {}.",
            with_unit(value),
            with_unit(*range.end())
        ));
    }
    Ok(value)
}

/// Returns the longest prefix that is a number, and the rest.
fn split_number(text: &str) -> Option<(f64, &str)> {
    let is_of_number = |c: char| c.is_ascii_digit() || "+-.eE".contains(c);
    let longest = text.find(|c| !is_of_number(c)).unwrap_or(text.len());
    (1..=longest).rev().find_map(|end| {
        let number = text[..end].parse().ok()?;
        Some((number, text[end..].trim()))
    })
}

fn not_a_number(typed: &str, unit: &str) -> String {
    let example = match units_of(unit) {
        [(own, _), ..] if !unit.is_empty() => format!("0.5 {own}"),
        _ => "0.5 or 5e-1".to_owned(),
    };
    if typed.is_empty() {
        format!("The field is empty: type a number, for example {example}.")
    } else {
        format!("“{typed}” is not a number: type, for example, {example}.")
    }
}

/// Returns the conversion factor from the unit `named` to the unit of the field.
fn factor_of(named: &str, unit: &str) -> Result<f64, String> {
    // As it is typed without Greek letters; the signs of ohm and micro are not those letters.
    let spelled = named.replace("ohm", "Ω").replace('\u{2126}', "Ω").replace('μ', "µ");
    let spelled = match spelled.strip_prefix('u') {
        Some(rest) => format!("µ{rest}"),
        None => spelled,
    };
    if spelled == unit {
        return Ok(1.0);
    }
    let units = units_of(unit);
    if let Some((_, factor)) = units.iter().find(|(name, _)| *name == spelled) {
        return Ok(*factor);
    }
    if named.starts_with(',') {
        return Err("Write the decimals with a point: 0.5, and thousands without a comma: 1000.".to_owned());
    }
    let names = Vec::from_iter(units.iter().map(|(name, _)| *name)).join(", ");
    Err(match (units, unit) {
        ([], "") => format!("“{named}” is not a unit of this field: it has no unit."),
        ([], _) => format!("“{named}” is not a unit of this field: it is in {unit}."),
        _ => format!("“{named}” is not a unit of this field: type {names} or none."),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: RangeInclusive<f64> = f64::MIN..=f64::MAX;

    #[test]
    fn typed_numbers_and_units_are_parsed() {
        let cases = [
            ("0.5 mm", "mm", 0.5),
            ("0.5", "mm", 0.5),
            (" 500um ", "mm", 0.5),
            ("500 µm", "mm", 0.5),
            ("500 μm", "mm", 0.5),
            ("20 us", "µs", 20.0),
            ("0.02 m", "mm", 20.0),
            ("2e-2m", "mm", 20.0),
            ("1 in", "mm", 25.4),
            ("−3.25 mm", "mm", -3.25),
            ("20%", "%", 20.0),
            ("20 %", "%", 20.0),
            ("5‰", "%", 0.5),
            ("20%", "", 0.2),
            ("1e-3", "", 1e-3),
            ("120 kohm", "Ω", 120_000.0),
            ("120 kΩ", "Ω", 120_000.0),
            ("1 Mohm", "Ω", 1e6),
            ("1 mohm", "Ω", 1e-3),
            ("3 ohm", "Ω", 3.0),
            ("3 \u{2126}", "Ω", 3.0),
            ("45°", "°", 45.0),
            ("1e10", "Ω/mm", 1e10),
            ("7 kohm/mm", "Ω/mm", 7000.0),
            ("+.5", "mm", 0.5),
            ("5.", "mm", 5.0),
            ("0.07 m", "mm", 70.0),
        ];
        for (typed, unit, expected) in cases {
            assert_eq!(parse(typed, unit, &ALL, false), Ok(expected), "{typed} in {unit}");
        }
    }

    #[test]
    fn refused_input_has_a_reason_and_a_cure() {
        let cases = [
            (
                "",
                "mm",
                false,
                "The field is empty: type a number, for example 0.5 mm.",
            ),
            (
                "thick",
                "mm",
                false,
                "“thick” is not a number: type, for example, 0.5 mm.",
            ),
            ("nan", "mm", false, "“nan” is not a number"),
            ("inf", "", false, "“inf” is not a number"),
            ("1e999", "mm", false, "is too large to be stored"),
            (
                "5 kg",
                "mm",
                false,
                "“kg” is not a unit of this field: type mm, µm, cm, m, in or none.",
            ),
            (
                "5 mm",
                "%",
                false,
                "“mm” is not a unit of this field: type %, ‰ or none.",
            ),
            ("5 MOHM", "Ω", false, "“MOHM” is not a unit of this field"),
            ("0,5 mm", "mm", false, "Write the decimals with a point"),
            ("1,000", "", true, "“1,000” is not a number: type digits only."),
            ("2.5", "", true, "“2.5” is not a whole number."),
            ("0.5 mm", "mm", false, "0.5 mm is too small: at least 1 mm."),
            ("1 m", "mm", false, "1000 mm is too large: at most 500 mm."),
            ("-4", "", true, "−4 is too small: at least 1."),
            ("1e6", "", true, "1000000 is too large: at most 500."),
        ];
        for (typed, unit, is_whole, expected) in cases {
            let reason = parse(typed, unit, &(1.0..=500.0), is_whole).unwrap_err();
            assert!(reason.contains(expected), "{typed} in {unit}: {reason}");
        }
    }
}
