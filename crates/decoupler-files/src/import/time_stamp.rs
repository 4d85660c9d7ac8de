//! Time stamps in ISO 8601, such as `2026-11-24T12:00:00.5+01:00` or `2026-11-24 12:00:00`.

use jiff::Timestamp;

/// Moment of a time stamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TimeStamp {
    /// Nanoseconds since 1970, in UTC if the zone is given.
    pub(super) nanoseconds: i128,
    /// `true` if the stamp has a zone.
    pub(super) has_zone: bool,
}

const SECOND: i128 = 1_000_000_000;
const DAY_S: i128 = 86_400;

impl TimeStamp {
    /// Parses a date and a time with T or a space between them, and optionally seconds, a fraction and a zone; `None` for
    /// anything else.
    pub(super) fn parse(cell: &[u8]) -> Option<Self> {
        // Most cells are numbers: this is fast for those.
        if !(16..=40).contains(&cell.len()) || [cell[4], cell[7], cell[13]] != *b"--:" || !b"Tt ".contains(&cell[10]) {
            return None;
        }
        let text = std::str::from_utf8(cell).ok()?;
        let (moment, zone) = text.split_at(
            text.get(16..)?
                .find(['+', '-', 'Z', 'z'])
                .map_or(text.len(), |at| 16 + at),
        );
        // Zones are numbers of hours and minutes, less than a day.
        if zone.len() > "+01:00".len() || zone.get(1..3).is_some_and(|hours| hours > "23") {
            return None;
        }
        // 24:00 is the end of a day, and second 60 a leap second, which the calendar takes for second 59.
        let (is_end_of_day, is_leap) = (moment.get(11..16)? == "24:00", moment.get(16..19) == Some(":60"));
        let start_of_day = if is_end_of_day {
            moment.replacen("24:00", "00:00", 1)
        } else {
            moment.to_owned()
        };
        let has_zone = !zone.is_empty();
        let whole = format!("{}{}", start_of_day.trim_end(), if has_zone { zone } else { "Z" });
        let stamp: Timestamp = whole.parse().ok()?;
        let later_s = i128::from(is_end_of_day) * DAY_S + i128::from(is_leap);
        Some(Self {
            nanoseconds: stamp.as_nanosecond() + SECOND * later_s,
            has_zone,
        })
    }

    /// Seconds since another stamp.
    pub(super) fn seconds_since(self, other: Self) -> f64 {
        let nanoseconds = self.nanoseconds - other.nanoseconds;
        // As one number, the nanoseconds of decades would be rounded first.
        (nanoseconds / SECOND) as f64 + (nanoseconds % SECOND) as f64 / SECOND as f64
    }
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
            // Not read by Python: the end of a day and a leap second are the start of the next.
            ("2026-11-24T24:00", 1_795_564_800.0),
            ("2016-12-31T23:59:60Z", 1_483_228_800.0),
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
            "2026-11-24T22:53:23Z[Europe/Paris]",
            "2026-11-24T22:53:23[Europe/Paris]",
            "2026-11-24T22:53:23+24:00",
            "2026-11-24T22:53:23+01:00:30",
            "2026-11-24T225323.123456",
            "24.11.2026 22:53:23",
            "1234567890123456789",
            "",
        ] {
            assert_eq!(TimeStamp::parse(text.as_bytes()), None, "{text}");
        }
    }
}
