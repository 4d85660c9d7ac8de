use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use super::DatasetError;

/// Span of time into the past: a number of samples, or seconds.
///
/// Parses and formats as `20` (samples), `2s`, `100ms` or `5min`.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Span {
    /// Number of samples, more than 0.
    Samples(f64),
    /// Seconds, more than 0.
    Seconds(f64),
}

impl Span {
    /// Samples in this span at an interval of `interval_s`; `None` for seconds without an interval.
    pub fn samples(self, interval_s: Option<f64>) -> Option<f64> {
        match self {
            Self::Samples(samples) => Some(samples),
            Self::Seconds(seconds) => interval_s.map(|interval_s| seconds / interval_s),
        }
    }

    pub(super) fn is_valid(self) -> bool {
        let (Self::Samples(length) | Self::Seconds(length)) = self;
        length > 0.0 && length.is_finite()
    }
}

impl FromStr for Span {
    type Err = DatasetError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let trimmed = text.trim();
        let number = trimmed.trim_end_matches(|c: char| c.is_ascii_alphabetic()).trim_end();
        let unit = trimmed[number.len()..].trim();
        let of: fn(f64) -> Self = match unit {
            "" => Self::Samples,
            "s" => Self::Seconds,
            "ms" => |ms| Self::Seconds(ms / 1e3),
            "min" => |minutes| Self::Seconds(60.0 * minutes),
            _ => return Err(DatasetError::SpanText(text.to_owned())),
        };
        let span = number.parse().ok().map(of).filter(|span: &Self| span.is_valid());
        span.ok_or_else(|| DatasetError::SpanText(text.to_owned()))
    }
}

impl TryFrom<String> for Span {
    type Error = DatasetError;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        text.parse()
    }
}

impl From<Span> for String {
    fn from(span: Span) -> Self {
        span.to_string()
    }
}

impl fmt::Display for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Samples(samples) => write!(f, "{samples}"),
            Self::Seconds(seconds) => write!(f, "{seconds}s"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_are_read_and_written_as_users_write_them() {
        for (text, expected, written) in [
            ("20", Span::Samples(20.0), "20"),
            (" 2s", Span::Seconds(2.0), "2s"),
            ("0.1 s", Span::Seconds(0.1), "0.1s"),
            ("100ms", Span::Seconds(0.1), "0.1s"),
            ("5min", Span::Seconds(300.0), "300s"),
        ] {
            let span: Span = text.parse().expect(text);
            assert_eq!(span, expected, "{text}");
            assert_eq!(span.to_string(), written);
            assert_eq!(span.to_string().parse(), Ok(span));
        }
        for text in ["", "s", "-2s", "0", "2h", "inf", "nan", "2 3"] {
            assert!(text.parse::<Span>().is_err(), "{text}");
        }
        assert_eq!(Span::Seconds(2.0).samples(Some(0.01)), Some(200.0));
        assert_eq!(Span::Seconds(2.0).samples(None), None);
    }
}
