use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use super::{DatasetError, Place};

/// Maximum number of samples that a lag reaches back.
pub const LARGEST_LAG: usize = 100_000;
/// Maximum number of features, and of values in a state.
const MAX_FEATURES: usize = 20_000;
pub(super) const MAX_STATE: usize = 10_000_000;

/// Inputs from the past: a network for a sensor with hysteresis, creep or drift sees, next to the current readings,
/// earlier ones.
///
/// With n channels, the *features* of a sample are its n readings, then for each lag the n readings that many samples
/// before, then for each exponential average its n values: (1 + lags + averages)·n in all. An average with the time
/// constant τ follows the reading x by
///
/// ```text
/// m ← m + a·(x − m)        a = 1 − exp(−Δt/τ)
/// ```
///
/// which is exact for a reading that is constant over the interval Δt since the sample before, whatever that interval is.
/// The first sample after a restart sets all lags and averages to its own readings.
///
/// With [`Self::differences`], the past enters as its difference from the current reading: x minus the lagged reading, x minus the
/// average (a high-pass filter). Without lags and averages it is the difference from the sample before.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Memory {
    /// Lags in whole samples. Seconds are rounded to samples at [`Self::interval_s`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lags: Vec<Span>,
    /// Time constants of exponential averages.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub averages: Vec<Span>,
    /// The past as difference from the current reading.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub differences: bool,
    /// Usual interval between samples in seconds, for spans in seconds where a sample has no time of its own. An import
    /// sets it to the median of the time column.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval_s: Option<f64>,
}

impl Memory {
    /// `true` if the features are the readings alone.
    pub fn is_empty(&self) -> bool {
        self.lags.is_empty() && self.averages.is_empty() && !self.differences
    }

    /// `true` if a span is in seconds.
    pub fn needs_clock(&self) -> bool {
        self.spans().any(|span| matches!(span, Span::Seconds(_)))
    }

    /// Number of features of `channels` channels.
    pub fn features(&self, channels: usize) -> usize {
        channels * (1 + self.past().count())
    }

    /// Names of the features, in their order: `c2`, `c2[-5]`, `c2[-0.5s]`, `c2~2s`; differences are `c2-c2~2s`.
    pub fn names<'a>(&self, channels: impl IntoIterator<Item = &'a str>) -> Vec<String> {
        let channels = Vec::from_iter(channels);
        let mut names: Vec<String> = channels.iter().map(|name| (*name).to_owned()).collect();
        for past in self.past() {
            names.extend(channels.iter().map(|name| {
                let prefix = if self.differences {
                    format!("{name}-")
                } else {
                    String::new()
                };
                match past {
                    Past::Lag(span) => format!("{prefix}{name}[-{span}]"),
                    Past::Average(span) => format!("{prefix}{name}~{span}"),
                }
            }));
        }
        names
    }

    /// Checks the memory for this number of channels.
    ///
    /// # Errors
    /// If a span in seconds has no interval, or a lag, a time constant, or the number of features is out of range.
    pub fn check(&self, channels: usize) -> Result<(), DatasetError> {
        MemoryConstants::of(self, channels).map(drop)
    }

    /// Lags and time constants.
    pub(super) fn spans(&self) -> impl Iterator<Item = Span> {
        self.lags.iter().chain(&self.averages).copied()
    }

    /// Parts of the past, in the order of the features.
    fn past(&self) -> impl Iterator<Item = Past> {
        let previous = self.differences && self.lags.is_empty() && self.averages.is_empty();
        let lags = self.lags.iter().copied().chain(previous.then_some(Span::Samples(1.0)));
        lags.map(Past::Lag)
            .chain(self.averages.iter().copied().map(Past::Average))
    }
}

/// In words: `averages over 2 s, 10 s and lags of 5, 10, as differences`.
impl fmt::Display for Memory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        for (what, spans) in [("averages over", &self.averages), ("lags of", &self.lags)] {
            if !spans.is_empty() {
                let spans = Vec::from_iter(spans.iter().map(|span| format!("{span:#}")));
                parts.push(format!("{what} {}", spans.join(", ")));
            }
        }
        match (parts.is_empty(), self.differences) {
            (true, false) => f.write_str("none"),
            (true, true) => f.write_str("differences from the sample before"),
            (false, false) => f.write_str(&parts.join(" and ")),
            (false, true) => write!(f, "{}, as differences", parts.join(" and ")),
        }
    }
}

/// One part of the past.
#[derive(Clone, Copy)]
enum Past {
    Lag(Span),
    Average(Span),
}

/// Checked numbers of a memory, which its state and its exports compute with.
#[derive(Clone, Debug, PartialEq)]
pub struct MemoryConstants {
    /// Number of channels.
    pub channels: usize,
    /// Lags in samples, each at least 1.
    pub lags: Vec<usize>,
    /// Time constants of the averages.
    pub averages: Vec<Span>,
    /// The past enters as difference from the current reading.
    pub differences: bool,
    /// Usual interval in seconds; 1 if no span is in seconds.
    pub interval_s: f64,
}

impl MemoryConstants {
    /// Checks the numbers of `memory` for this number of channels.
    ///
    /// # Errors
    /// See [`Memory::check`].
    pub fn of(memory: &Memory, channels: usize) -> Result<Self, DatasetError> {
        let interval_s = memory.interval_s.unwrap_or(1.0);
        if !(interval_s > 0.0 && interval_s.is_finite()) {
            return Err(DatasetError::MemoryInterval(interval_s));
        }
        let (mut lags, mut averages) = (Vec::new(), Vec::new());
        for past in memory.past() {
            let (Past::Lag(span) | Past::Average(span)) = past;
            let samples = span.samples(memory.interval_s).ok_or(DatasetError::NoClock(span))?;
            match past {
                Past::Lag(lag) => {
                    let rounded = samples.round();
                    if !(1.0..=LARGEST_LAG as f64).contains(&rounded) {
                        return Err(DatasetError::Lag { lag, samples });
                    }
                    lags.push(rounded as usize);
                }
                Past::Average(span) if span.is_valid() => averages.push(span),
                Past::Average(span) => return Err(DatasetError::Average(span)),
            }
        }
        let constants = Self {
            channels,
            lags,
            averages,
            differences: memory.differences,
            interval_s,
        };
        let (features, state) = (constants.features(), constants.state());
        if features > MAX_FEATURES.max(channels) || state > MAX_STATE {
            return Err(DatasetError::MemoryExcess {
                channels,
                features,
                state,
            });
        }
        Ok(constants)
    }

    /// Number of features.
    pub fn features(&self) -> usize {
        self.channels * (1 + self.lags.len() + self.averages.len())
    }

    /// Longest lag in samples; 0 without lags.
    pub fn longest_lag(&self) -> usize {
        self.lags.iter().copied().max().unwrap_or(0)
    }

    /// Number of values in a state: the readings back to the longest lag, and the averages.
    pub fn state(&self) -> usize {
        self.channels.saturating_mul(self.longest_lag() + self.averages.len())
    }

    /// Weight 1 − exp(−Δt/τ) of a reading in the average `average`, `interval_s` seconds after the sample before. Time
    /// that runs backwards counts as none.
    pub fn weight(&self, average: usize, interval_s: f64) -> f64 {
        let exponent = match self.averages[average] {
            Span::Samples(samples) => 1.0 / samples,
            Span::Seconds(seconds) => interval_s.max(0.0) / seconds,
        };
        -(-exponent).exp_m1()
    }
}

/// State of a [`Memory`] in one stream of samples: steps from sample to sample.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MemoryState {
    pub(super) constants: MemoryConstants,
    /// `false` until the first sample.
    has_started: bool,
    /// Readings of the first sample, which are also those before it.
    first: Vec<f64>,
    /// Number of samples in the ring.
    taken: usize,
    /// The last readings, as a ring of `longest lag × channels`.
    readings: Vec<f64>,
    /// Index of the oldest sample in the ring, which the next one replaces.
    oldest: usize,
    /// Averages × channels.
    averages: Vec<f64>,
}

impl MemoryState {
    /// Creates the state before the first sample.
    ///
    /// # Errors
    /// See [`Memory::check`].
    pub fn new(memory: &Memory, channels: usize) -> Result<Self, DatasetError> {
        let constants = MemoryConstants::of(memory, channels)?;
        Ok(Self {
            has_started: false,
            first: vec![0.0; channels],
            taken: 0,
            readings: vec![0.0; constants.longest_lag() * channels],
            oldest: 0,
            averages: vec![0.0; constants.averages.len() * channels],
            constants,
        })
    }

    /// Number of features that a step returns.
    pub fn features(&self) -> usize {
        self.constants.features()
    }

    /// Forgets the past: the next sample is the first.
    pub fn restart(&mut self) {
        self.has_started = false;
    }

    /// Seconds since the row before; forgets the past if the next row does not continue it.
    pub(super) fn elapsed_s(&mut self, place: Place) -> Option<f64> {
        if let Place::After(elapsed_s) = place {
            return elapsed_s;
        }
        self.restart();
        None
    }

    /// Takes in the readings of the next sample, `interval_s` seconds after the one before (the usual interval if `None`),
    /// and writes its features. The interval of the first sample is not used. If a difference overflows, the past is
    /// forgotten: the features of finite readings are finite.
    ///
    /// # Panics
    /// If the number of readings or features is wrong.
    pub fn step(&mut self, readings: &[f64], interval_s: Option<f64>, features: &mut [f64]) {
        self.advance(readings, interval_s, features);
        if !features.iter().all(|feature| feature.is_finite()) {
            self.restart();
            self.advance(readings, None, features);
        }
    }

    fn advance(&mut self, readings: &[f64], interval_s: Option<f64>, features: &mut [f64]) {
        let channels = self.constants.channels;
        assert_eq!(readings.len(), channels, "one reading for each channel");
        assert_eq!(features.len(), self.features(), "room for all features");
        let ring = self.constants.longest_lag();
        if !self.has_started {
            self.has_started = true;
            (self.oldest, self.taken) = (0, 0);
            self.first.copy_from_slice(readings);
            let averages = self.averages.chunks_exact_mut(channels.max(1));
            averages.for_each(|row| row.copy_from_slice(readings));
        }
        let interval_s = interval_s.unwrap_or(self.constants.interval_s);
        let (present, past) = features.split_at_mut(channels);
        present.copy_from_slice(readings);
        let mut rows = past.chunks_exact_mut(channels.max(1));
        for (lag, row) in self.constants.lags.iter().zip(&mut rows) {
            let start = (self.oldest + ring - lag) % ring * channels;
            row.copy_from_slice(if *lag <= self.taken {
                &self.readings[start..start + channels]
            } else {
                &self.first
            });
        }
        let averages = self.averages.chunks_exact_mut(channels.max(1));
        for (index, (average, row)) in averages.zip(&mut rows).enumerate() {
            let weight = self.constants.weight(index, interval_s);
            for ((mean, reading), feature) in average.iter_mut().zip(readings).zip(row) {
                *mean += weight * (reading - *mean);
                *feature = *mean;
            }
        }
        if self.constants.differences {
            for (index, feature) in past.iter_mut().enumerate() {
                *feature = readings[index % channels] - *feature;
            }
        }
        if ring > 0 {
            let start = self.oldest * channels;
            self.readings[start..start + channels].copy_from_slice(readings);
            self.oldest = (self.oldest + 1) % ring;
            self.taken = ring.min(self.taken + 1);
        }
    }
}

/// Span of time into the past: a number of samples, or seconds.
///
/// Parses `20` (samples), `2s`, `100ms` or `5min`; formats as `20` or `2s`, and in sentences (`{:#}`) as `2 s`.
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

    fn is_valid(self) -> bool {
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
            Self::Seconds(seconds) => write!(f, "{seconds}{}s", if f.alternate() { " " } else { "" }),
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use ndarray::{ArcArray2, Array2, ArrayView2, array};
    use rand::RngExt;

    use super::*;
    use crate::dataset::{History, Seed, Stream};

    /// Memory of the readings the given numbers of samples before.
    pub(in crate::dataset) fn of_lags(samples: &[usize]) -> Memory {
        Memory {
            lags: samples.iter().map(|&lag| Span::Samples(lag as f64)).collect(),
            ..Memory::default()
        }
    }

    /// Memory of averages with these time constants in seconds.
    pub(in crate::dataset) fn of_averages_s(time_constants_s: &[f64]) -> Memory {
        Memory {
            averages: time_constants_s.iter().map(|&s| Span::Seconds(s)).collect(),
            ..Memory::default()
        }
    }

    fn all(memory: &Memory, readings: ArrayView2<'_, f64>) -> Array2<f64> {
        of_series(memory, readings, &vec![0; readings.nrows()], None).unwrap()
    }

    fn of_series(
        memory: &Memory,
        readings: ArrayView2<'_, f64>,
        groups: &[u64],
        times_s: Option<&[f64]>,
    ) -> Result<Array2<f64>, DatasetError> {
        let (samples, times_s) = ((0..readings.nrows()).collect(), times_s.map(<[f64]>::to_vec));
        History::new(readings.to_owned(), Some(groups), None, times_s, samples)
            .features(memory)
            .map(ArcArray2::into_owned)
    }

    #[test]
    fn features_are_readings_then_lags_then_averages() {
        let memory = Memory {
            interval_s: Some(0.01),
            lags: vec![Span::Samples(2.0), Span::Seconds(0.01)],
            ..of_averages_s(&[2.0])
        };
        let names = ["a", "b", "a[-2]", "b[-2]", "a[-0.01s]", "b[-0.01s]", "a~2s", "b~2s"];
        assert_eq!(memory.names(["a", "b"]), names);
        assert_eq!(memory.features(2), names.len());
        let memory = Memory {
            differences: true,
            ..of_lags(&[5])
        };
        assert_eq!(memory.names(["a"]), ["a", "a-a[-5]"]);
        let memory = Memory {
            differences: true,
            ..Memory::default()
        };
        assert_eq!(memory.names(["a"]), ["a", "a-a[-1]"]);
        assert!(!memory.is_empty() && Memory::default().is_empty());
    }

    /// One state of ten channels takes 8 MB, those of all groups 800 GB.
    #[test]
    fn many_interleaved_series_take_one_state() {
        let memory = of_lags(&[LARGEST_LAG]);
        let groups = Vec::from_iter(0..100_000);
        let interleaved = [&groups[..], &groups].concat();
        let readings = Array2::from_shape_fn((interleaved.len(), 10), |(row, channel)| (10 * row + channel) as f64);
        let found = of_series(&memory, readings.view(), &interleaved, None).unwrap();
        // Before the first row of a series are its own readings.
        for (row, first) in [(7, 7), (100_007, 7), (199_999, 99_999)] {
            assert_eq!(found.row(row).to_vec()[10..], readings.row(first).to_vec(), "{row}");
        }
    }

    #[test]
    fn differences_that_overflow_are_a_new_start() {
        let memory = Memory {
            lags: vec![Span::Samples(1.0)],
            differences: true,
            interval_s: Some(0.1),
            ..of_averages_s(&[0.3])
        };
        let found = all(&memory, array![[1e308], [-1e308], [-1e308], [2.0]].view());
        assert!(found.iter().all(|feature| feature.is_finite()), "{found}");
        assert_eq!(found.row(1).to_vec(), [-1e308, 0.0, 0.0]);
    }

    #[test]
    fn lags_reach_back_within_the_series_and_begin_with_its_first_sample() {
        let readings = array![[1.0, 10.0], [2.0, 20.0], [3.0, 30.0], [4.0, 40.0], [5.0, 50.0]];
        let found = all(&of_lags(&[1, 3]), readings.view());
        let expected = array![
            [1.0, 10.0, 1.0, 10.0, 1.0, 10.0],
            [2.0, 20.0, 1.0, 10.0, 1.0, 10.0],
            [3.0, 30.0, 2.0, 20.0, 1.0, 10.0],
            [4.0, 40.0, 3.0, 30.0, 1.0, 10.0],
            [5.0, 50.0, 4.0, 40.0, 2.0, 20.0]
        ];
        assert_eq!(found, expected);
        // Two interleaved groups.
        let found = of_series(&of_lags(&[1]), readings.view(), &[7, 3, 7, 3, 7], None).unwrap();
        assert_eq!(found.column(2).to_vec(), [1.0, 2.0, 1.0, 2.0, 3.0]);
    }

    /// Step from 0 to 1: the average is 1 − exp(−t/τ) at the end of any interval, regular or not.
    #[test]
    fn the_step_response_of_an_average_is_exact_on_an_irregular_clock() {
        let times_s = [0.0, 0.1, 0.15, 1.0, 1.0, 3.5, 20.0];
        let mut readings = Array2::ones((times_s.len(), 1));
        readings[[0, 0]] = 0.0;
        let memory = Memory {
            interval_s: Some(0.5),
            ..of_averages_s(&[2.0, 0.5])
        };
        let found = of_series(&memory, readings.view(), &[0; 7], Some(&times_s)).unwrap();
        for (row, time_s) in found.rows().into_iter().zip(times_s) {
            for (average, tau_s) in [(1, 2.0), (2, 0.5)] {
                let expected = 1.0 - f64::exp(-time_s / tau_s);
                assert!((row[average] - expected).abs() < 1e-14, "{time_s} s, {tau_s} s");
            }
        }
    }

    /// Figures of `scipy.signal.lfilter([a], [1, a - 1], x, zi=[x[0]*(1 - a)])` with a = 1 − exp(−1/3).
    #[test]
    fn an_average_is_the_filter_that_scipy_computes() {
        let readings = array![[3.0], [5.0], [4.0], [-1.0], [0.5], [8.0]];
        let expected = [
            3.0,
            3.566_937_378_852_421_7,
            3.689_697_072_508_605,
            2.360_314_789_558_653_4,
            1.832_973_794_242_265,
            3.581_132_630_445_507,
        ];
        let in_samples = Memory {
            averages: vec![Span::Samples(3.0)],
            ..Memory::default()
        };
        let in_seconds = Memory {
            interval_s: Some(0.2),
            ..of_averages_s(&[0.6])
        };
        for memory in [in_samples, in_seconds] {
            let found = all(&memory, readings.view());
            let differences = all(
                &Memory {
                    differences: true,
                    ..memory
                },
                readings.view(),
            );
            for (sample, expected) in expected.into_iter().enumerate() {
                assert!((found[[sample, 1]] - expected).abs() < 1e-14, "sample {sample}");
                assert!((differences[[sample, 1]] - (readings[[sample, 0]] - expected)).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn stepping_gives_the_same_bits_as_a_history_also_after_a_restart() {
        let mut rng = Seed(3).rng(Stream::Training);
        let readings = Array2::from_shape_simple_fn((200, 3), || rng.random_range(-1.0..1.0));
        let mut times_s = Vec::from_iter((0..200).map(|_| rng.random_range(0.0..5.0)));
        times_s.sort_by(f64::total_cmp);
        let groups = Vec::from_iter((0..200).map(|sample| u64::from(sample >= 120)));
        for differences in [false, true] {
            let memory = Memory {
                lags: vec![Span::Samples(7.0), Span::Samples(1.0), Span::Seconds(0.1)],
                averages: vec![Span::Seconds(0.3), Span::Samples(20.0)],
                differences,
                interval_s: Some(0.025),
            };
            let expected = of_series(&memory, readings.view(), &groups, Some(&times_s)).unwrap();
            let mut state = MemoryState::new(&memory, 3).unwrap();
            let mut features = vec![0.0; state.features()];
            for sample in 0..200 {
                if sample == 120 {
                    state.restart();
                }
                let before = if sample == 0 { 0.0 } else { times_s[sample - 1] };
                state.step(
                    &readings.row(sample).to_vec(),
                    Some(times_s[sample] - before),
                    &mut features,
                );
                assert_eq!(features, expected.row(sample).to_vec(), "sample {sample}");
            }
        }
    }

    #[test]
    fn impossible_memories_are_refused() {
        let refused = |memory: Memory| memory.check(3).unwrap_err().to_string();
        assert!(refused(of_averages_s(&[2.0])).contains("needs times"));
        assert!(refused(of_lags(&[0])).contains("from 1"));
        assert!(refused(of_lags(&[LARGEST_LAG + 1])).contains("100000"));
        assert!(
            refused(Memory {
                interval_s: Some(f64::NAN),
                ..Memory::default()
            })
            .contains("NaN")
        );
        assert!(
            refused(Memory {
                interval_s: Some(1.0),
                ..of_averages_s(&[-1.0])
            })
            .contains("more than 0")
        );
        let huge = of_lags(&[LARGEST_LAG]).check(101).unwrap_err();
        assert!(
            matches!(huge, DatasetError::MemoryExcess { state: 10_100_000, .. }),
            "{huge}"
        );
    }

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
