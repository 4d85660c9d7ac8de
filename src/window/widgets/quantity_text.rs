//! Numbers with units as one types them: "0.5 mm", "20%", "120 kohm".

use std::ops::RangeInclusive;

use super::fields::input_text;

/// Units of a field and how many of its own each is. The first is its own.
fn units_of(unit: &str) -> &'static [(&'static str, f64)] {
    match unit {
        "mm" => &[
            ("mm", 1.0),
            ("µm", 1e-3),
            ("μm", 1e-3),
            ("um", 1e-3),
            ("nm", 1e-6),
            ("cm", 10.0),
            ("m", 1e3),
            ("in", 25.4),
        ],
        "Ω" => &[
            ("Ω", 1.0),
            ("Ω", 1.0),
            ("ohm", 1.0),
            ("ohms", 1.0),
            ("mΩ", 1e-3),
            ("mohm", 1e-3),
            ("kΩ", 1e3),
            ("kohm", 1e3),
            ("MΩ", 1e6),
            ("Mohm", 1e6),
        ],
        "Ω/mm" => &[
            ("Ω/mm", 1.0),
            ("Ω/mm", 1.0),
            ("ohm/mm", 1.0),
            ("kΩ/mm", 1e3),
            ("kohm/mm", 1e3),
            ("Ω/cm", 0.1),
            ("ohm/cm", 0.1),
            ("Ω/m", 1e-3),
            ("ohm/m", 1e-3),
        ],
        "°" => &[("°", 1.0), ("deg", 1.0), ("rad", 180.0 / std::f64::consts::PI)],
        "%" => &[("%", 1.0), ("percent", 1.0), ("‰", 0.1)],
        "µs" => &[
            ("µs", 1.0),
            ("μs", 1.0),
            ("us", 1.0),
            ("ns", 1e-3),
            ("ms", 1e3),
            ("s", 1e6),
        ],
        "Hz" => &[("Hz", 1.0), ("kHz", 1e3)],
        // A share of one.
        "" => &[("%", 0.01), ("‰", 1e-3)],
        _ => &[],
    }
}

/// Returns the number that `text` gives a field of this unit.
///
/// # Errors
/// The reason why it gives none: no number, another unit, not whole where it `is_whole`, or out of the range.
pub(super) fn parse(text: &str, unit: &str, range: &RangeInclusive<f64>, is_whole: bool) -> Result<f64, String> {
    let typed = text.trim().replace('−', "-");
    let (number, rest) = split_number(&typed).ok_or_else(|| no_number(&typed, unit))?;
    let factor = match rest {
        "" => 1.0,
        _ if is_whole && unit.is_empty() => return Err(format!("“{typed}” is not a number: type digits only.")),
        _ => factor_of(rest, unit)?,
    };
    // The unit's own numbers are taken as they are, and rounding is not shown: 0.07 · 100 is 7.
    let value = if factor == 1.0 {
        number
    } else {
        format!("{:.14e}", number * factor).parse().unwrap_or(number * factor)
    };
    if !value.is_finite() {
        return Err(format!("“{typed}” is larger than any number that can be kept."));
    }
    if is_whole && value.fract() != 0.0 {
        return Err(format!("“{typed}” is not a whole number."));
    }
    let with_unit = |value: f64| {
        let space = if unit.is_empty() { "" } else { " " };
        format!("{}{space}{unit}", input_text(value)).replace('-', "−")
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

/// The longest beginning that is a number, and what follows it.
fn split_number(text: &str) -> Option<(f64, &str)> {
    let is_of_number = |c: char| c.is_ascii_digit() || "+-.eE".contains(c);
    let longest = text.find(|c| !is_of_number(c)).unwrap_or(text.len());
    (1..=longest).rev().find_map(|end| {
        let number = text[..end].parse().ok()?;
        Some((number, text[end..].trim()))
    })
}

fn no_number(typed: &str, unit: &str) -> String {
    let example = match units_of(unit) {
        [(own, _), ..] if !unit.is_empty() => format!("0.5 {own}"),
        _ => "0.5 or 5e-1".to_owned(),
    };
    if typed.is_empty() {
        format!("Nothing was typed: a number is needed, for instance {example}.")
    } else {
        format!("“{typed}” is not a number: type for instance {example}.")
    }
}

/// Returns how many of the field's own unit one of `named` is.
fn factor_of(named: &str, unit: &str) -> Result<f64, String> {
    if named == unit && !unit.is_empty() {
        return Ok(1.0);
    }
    let units = units_of(unit);
    let exact = units.iter().find(|(name, _)| *name == named);
    if let Some((_, factor)) = exact {
        return Ok(*factor);
    }
    // In other capitals, where all that it could be are the same.
    let alike: Vec<f64> = units
        .iter()
        .filter(|(name, _)| name.to_lowercase() == named.to_lowercase())
        .map(|(_, factor)| *factor)
        .collect();
    if let [factor, others @ ..] = &alike[..]
        && others.iter().all(|other| other == factor)
    {
        return Ok(*factor);
    }
    if named.starts_with(',') {
        return Err("Write the decimals with a point: 0.5, and thousands without a comma: 1000.".to_owned());
    }
    let mut names: Vec<&str> = Vec::new();
    for (name, factor) in units {
        // Of spellings of one unit, the first.
        let is_new = !units
            .iter()
            .take_while(|(other, _)| other != name)
            .any(|(_, other)| other == factor);
        if is_new {
            names.push(name);
        }
    }
    Err(match &names[..] {
        [] if unit.is_empty() => format!("“{named}” is no unit of this field: it has none."),
        [] => format!("“{named}” is no unit of this field: it is in {unit}."),
        [only] => format!("“{named}” is no unit of this field: type {only} or none."),
        names => format!("“{named}” is no unit of this field: type {} or none.", names.join(", ")),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: RangeInclusive<f64> = f64::MIN..=f64::MAX;

    #[test]
    fn numbers_are_taken_in_the_units_that_people_type() {
        let cases = [
            ("0.5 mm", "mm", 0.5),
            ("0.5", "mm", 0.5),
            (" 500um ", "mm", 0.5),
            ("500 µm", "mm", 0.5),
            ("500 μm", "mm", 0.5),
            ("0.02 m", "mm", 20.0),
            ("2e-2m", "mm", 20.0),
            ("1 in", "mm", 25.4),
            ("−3.25 MM", "mm", -3.25),
            ("20%", "%", 20.0),
            ("20 %", "%", 20.0),
            ("5‰", "%", 0.5),
            ("20%", "", 0.2),
            ("1e-3", "", 1e-3),
            ("120 kohm", "Ω", 120_000.0),
            ("120 kΩ", "Ω", 120_000.0),
            ("1 Mohm", "Ω", 1e6),
            ("1 mohm", "Ω", 1e-3),
            ("3 Ohm", "Ω", 3.0),
            ("3 \u{2126}", "Ω", 3.0),
            ("45deg", "°", 45.0),
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
    fn what_cannot_be_taken_has_a_reason_and_a_cure() {
        let cases = [
            (
                "",
                "mm",
                false,
                "Nothing was typed: a number is needed, for instance 0.5 mm.",
            ),
            (
                "thick",
                "mm",
                false,
                "“thick” is not a number: type for instance 0.5 mm.",
            ),
            ("nan", "mm", false, "“nan” is not a number"),
            ("inf", "", false, "“inf” is not a number"),
            ("1e999", "mm", false, "larger than any number"),
            (
                "5 kg",
                "mm",
                false,
                "“kg” is no unit of this field: type mm, µm, nm, cm, m, in or none.",
            ),
            ("5 mm", "%", false, "“mm” is no unit of this field: type %, ‰ or none."),
            // Milli or mega: which is meant cannot be told.
            ("5 MOHM", "Ω", false, "“MOHM” is no unit of this field"),
            ("0,5 mm", "mm", false, "Write the decimals with a point"),
            ("1,000", "", true, "“1,000” is not a number: type digits only."),
            ("2.5", "", true, "“2.5” is not a whole number."),
            ("0.5 mm", "mm", false, "0.5 mm is too small: at least 1 mm."),
            ("1 m", "mm", false, "1000 mm is too large: at most 500 mm."),
            ("-4", "", true, "−4 is too small: at least 1."),
            ("1e6", "", true, "1e6 is too large: at most 500."),
        ];
        for (typed, unit, is_whole, expected) in cases {
            let reason = parse(typed, unit, &(1.0..=500.0), is_whole).unwrap_err();
            assert!(reason.contains(expected), "{typed} in {unit}: {reason}");
        }
    }
}
