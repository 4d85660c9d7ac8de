//! Time stamps in ISO 8601, such as `2026-11-24T12:00:00.5+01:00` or `2026-11-24 12:00:00`.

/// Moment of a time stamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TimeStamp {
    /// Nanoseconds since 1970, in UTC if the zone is given.
    pub(super) nanoseconds: i128,
    /// `true` if the stamp has a zone.
    pub(super) has_zone: bool,
}

const SECOND: i128 = 1_000_000_000;

impl TimeStamp {
    /// Parses a date and a time with T or a space between them, and optionally seconds, a fraction and a zone; `None` for
    /// anything else.
    pub(super) fn parse(cell: &[u8]) -> Option<Self> {
        // Most cells are numbers: this is fast for those.
        if !(16..=40).contains(&cell.len()) || cell[4] != b'-' || cell[7] != b'-' || !b"Tt ".contains(&cell[10]) {
            return None;
        }
        let digits = |from: usize, count: usize| -> Option<i128> {
            let digits = cell.get(from..from + count)?;
            let is_number = digits.iter().all(u8::is_ascii_digit);
            is_number.then(|| {
                digits
                    .iter()
                    .fold(0, |number, digit| 10 * number + i128::from(digit - b'0'))
            })
        };
        let [year, month, day] = [digits(0, 4)?, digits(5, 2)?, digits(8, 2)?];
        let [hour, minute] = [digits(11, 2)?, digits(14, 2)?];
        let is_leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
        let last = match month {
            2 => 28 + i128::from(is_leap),
            4 | 6 | 9 | 11 => 30,
            1..=12 => 31,
            _ => return None,
        };
        // 24:00 is the end of a day.
        let is_time = hour < 24 || (hour == 24 && minute == 0);
        if !(1..=last).contains(&day) || !is_time || minute > 59 || cell[13] != b':' {
            return None;
        }
        let mut rest = &cell[16..];
        let mut nanoseconds = 0;
        if let [b':', tens @ b'0'..=b'6', units @ b'0'..=b'9', after @ ..] = rest {
            let seconds = 10 * (tens - b'0') + units - b'0';
            // Second 60 is a leap second.
            if seconds > 60 {
                return None;
            }
            nanoseconds = SECOND * i128::from(seconds);
            rest = after;
            if let [b'.' | b',', fraction @ ..] = rest {
                let count = fraction.iter().take_while(|byte| byte.is_ascii_digit()).count();
                let mut unit = SECOND;
                for digit in &fraction[..count] {
                    unit /= 10;
                    nanoseconds += unit * i128::from(digit - b'0');
                }
                rest = &fraction[count..];
            }
        }
        let east_minutes = zone_minutes(rest.trim_ascii_start())?;
        let minutes = 60 * (24 * days_since_1970(year, month, day) + hour) + minute - east_minutes.unwrap_or(0);
        Some(Self {
            nanoseconds: 60 * SECOND * minutes + nanoseconds,
            has_zone: east_minutes.is_some(),
        })
    }

    /// Seconds since another stamp.
    pub(super) fn seconds_since(self, other: Self) -> f64 {
        let nanoseconds = self.nanoseconds - other.nanoseconds;
        // As one number, the nanoseconds of decades would be rounded first.
        (nanoseconds / SECOND) as f64 + (nanoseconds % SECOND) as f64 / SECOND as f64
    }
}

/// Parses a zone: nothing, Z, +hh, +hhmm or +hh:mm. Returns the minutes east of Greenwich.
fn zone_minutes(text: &[u8]) -> Option<Option<i128>> {
    let number = |tens: u8, units: u8| {
        let is_number = tens.is_ascii_digit() && units.is_ascii_digit();
        is_number.then(|| i128::from(10 * tens.wrapping_sub(b'0') + units.wrapping_sub(b'0')))
    };
    let (sign, hours, minutes) = match *text {
        [] => return Some(None),
        [b'Z' | b'z'] => return Some(Some(0)),
        [sign, a, b] => (sign, number(a, b)?, 0),
        [sign, a, b, c, d] | [sign, a, b, b':', c, d] => (sign, number(a, b)?, number(c, d)?),
        _ => return None,
    };
    if hours > 23 || minutes > 59 {
        return None;
    }
    match sign {
        b'+' => Some(Some(60 * hours + minutes)),
        b'-' => Some(Some(-60 * hours - minutes)),
        _ => None,
    }
}

/// Days from 1970-01-01 to a date of the Gregorian calendar (Howard Hinnant, "chrono-compatible low-level date algorithms").
fn days_since_1970(year: i128, month: i128, day: i128) -> i128 {
    // The year starts in March, so that a leap day is its last day.
    let year = if month <= 2 { year - 1 } else { year };
    let (era, year_of_era) = (year.div_euclid(400), year.rem_euclid(400));
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    146_097 * era + 365 * year_of_era + year_of_era / 4 - year_of_era / 100 + day_of_year - 719_468
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_are_read_as_by_python() {
        // datetime.fromisoformat(text).timestamp(), in UTC without a zone.
        let cases = [
            ("1970-01-01T00:00:00Z", 0.0),
            ("2000-02-29 12:30:15", 951_827_415.0),
            ("2026-11-24T22:53:23.250", 1_795_560_803.25),
            ("2026-11-24T22:53:23,25+01:00", 1_795_557_203.25),
            ("2026-11-24 22:53 -0530", 1_795_580_580.0),
            ("1969-12-31T23:59:59.5Z", -0.5),
            ("2100-03-01T00:00:00+00", 4_107_542_400.0),
        ];
        let zero = TimeStamp {
            nanoseconds: 0,
            has_zone: true,
        };
        for (text, expected) in cases {
            let found = TimeStamp::parse(text.as_bytes()).expect(text);
            assert_eq!(found.seconds_since(zero), expected, "{text}");
        }
    }

    #[test]
    fn other_texts_are_no_stamps() {
        for text in [
            "2026-11-24",
            "2026-02-29T00:00:00",
            "2026-13-01T00:00:00",
            "2026-11-24T25:00:00",
            "2026-11-24T24:30:00",
            "2026-11-24T22:53:69",
            "2026-11-24T22:53:23+99:99",
            "2026-11-24T22:53:23+01:60",
            "2026-11-24T22:53:23 CET",
            "24.11.2026 22:53:23",
            "1234567890123456789",
            "",
        ] {
            assert_eq!(TimeStamp::parse(text.as_bytes()), None, "{text}");
        }
    }
}
