use std::collections::HashMap;

use ndarray::{ArcArray2, Array2, ArrayView1, Axis};

use super::{
    DatasetError, Memory, Span,
    continuation::{Continuation, Place, RowOrder, Series, usual_interval_s},
    memory::{MAX_STATE, MemoryState},
};

/// Everything that a sensor has read, including rows that are not samples because a target is missing: the past, from
/// which the features of a [`Memory`] are computed. Rows continue each other as those of a [`MemoryStream`] do.
#[derive(Clone, Debug, PartialEq)]
pub struct History {
    /// Rows × channels, shared with the samples.
    readings: ArcArray2<f64>,
    series: Vec<Series>,
    /// Above all groups: the first of an appended history.
    next_group: u64,
    times_s: Option<Vec<f64>>,
    /// Row of each sample.
    samples: Vec<usize>,
    interval_s: Option<f64>,
}

impl History {
    /// Creates a history of `readings` (rows × channels) with the group, row-wire and time of each row, where known;
    /// `samples` are the rows that are samples.
    ///
    /// # Panics
    /// If a part does not have one entry per row, or a sample is not a row.
    pub fn new(
        readings: Array2<f64>,
        groups: Option<&[u64]>,
        row_wires: Option<&[usize]>,
        times_s: Option<Vec<f64>>,
        samples: Vec<usize>,
    ) -> Self {
        let rows = readings.nrows();
        let lengths = [
            groups.map(<[_]>::len),
            row_wires.map(<[_]>::len),
            times_s.as_ref().map(Vec::len),
        ];
        let mut lengths = lengths.into_iter().flatten();
        assert!(lengths.all(|length| length == rows), "one entry per row");
        assert!(samples.iter().all(|&row| row < rows), "samples are rows");
        let series = (0..rows).map(|row| Series {
            group: groups.map_or(0, |groups| groups[row]),
            row_wire: row_wires.map_or(0, |row_wires| row_wires[row]),
        });
        let last_group = groups.and_then(|groups| groups.iter().max()).copied().unwrap_or(0);
        let mut history = Self {
            series: series.collect(),
            next_group: last_group.saturating_add(1),
            readings: readings.into_shared(),
            times_s,
            samples,
            interval_s: None,
        };
        let rows = history.sequence().into_iter();
        let timed = rows.filter_map(|row| Some((history.series[row], history.time_s(row)?)));
        history.interval_s = usual_interval_s(timed);
        history
    }

    /// Appends the rows of another history of the same channels, which do not continue those before. The usual interval
    /// stays; times are known if both histories know them.
    ///
    /// # Panics
    /// If the numbers of channels differ.
    pub fn append(&mut self, other: &Self) {
        let rows = self.readings.nrows();
        let mut readings = std::mem::take(&mut self.readings).into_owned();
        let appended = readings.append(Axis(0), other.readings.view());
        appended.expect("histories of the same channels");
        self.readings = readings.into_shared();
        let (next, mut groups) = (self.next_group, HashMap::new());
        for &Series { group, row_wire } in &other.series {
            let known = next + groups.len() as u64;
            let group = *groups.entry(group).or_insert(known);
            self.series.push(Series { group, row_wire });
        }
        self.next_group += groups.len() as u64;
        self.samples.extend(other.samples.iter().map(|row| rows + row));
        let times_s = self.times_s.take().zip(other.times_s.as_deref());
        self.times_s = times_s.map(|(times_s, more)| [&times_s, more].concat());
    }

    /// Time of each row in seconds, if known.
    pub fn times_s(&self) -> Option<&[f64]> {
        self.times_s.as_deref()
    }

    /// Row of each sample.
    pub fn samples(&self) -> &[usize] {
        &self.samples
    }

    /// Median interval between successive rows of a series, in seconds; `None` without times.
    pub fn interval_s(&self) -> Option<f64> {
        self.interval_s
    }

    /// Order of the rows by their times; [`RowOrder::ByTime`] without times.
    pub fn order(&self) -> RowOrder {
        match &self.times_s {
            None => RowOrder::ByTime,
            Some(times_s) => RowOrder::of(self.series.iter().copied().zip(times_s.iter().copied())),
        }
    }

    /// Rows in the order in which they are taken.
    fn sequence(&self) -> Vec<usize> {
        let mut sequence = Vec::from_iter(0..self.series.len());
        if let (RowOrder::Shuffled { .. }, Some(times_s)) = (self.order(), &self.times_s) {
            sequence.sort_by(|&one, &other| times_s[one].total_cmp(&times_s[other]));
        }
        sequence
    }

    fn time_s(&self, row: usize) -> Option<f64> {
        self.times_s.as_ref().map(|times_s| times_s[row])
    }

    /// Returns `memory` with the usual interval of this history, unless it has one.
    #[must_use]
    pub fn resolved(&self, memory: &Memory) -> Memory {
        Memory {
            interval_s: memory.interval_s.or(self.interval_s),
            ..memory.clone()
        }
    }

    /// As [`Self::resolved`], for a memory that is about to be trained with.
    ///
    /// # Errors
    /// If a span is in seconds and the interval is not known, or a time constant is shorter than the interval.
    pub fn checked(&self, memory: &Memory) -> Result<Memory, DatasetError> {
        let resolved = self.resolved(memory);
        let interval_s = resolved.interval_s;
        if let Some(span) = resolved.spans().find(|span| span.samples(interval_s).is_none()) {
            return Err(match self.times_s {
                Some(_) => DatasetError::NoInterval(span),
                None => DatasetError::NoClock(span),
            });
        }
        let is_too_short = |span: &&Span| span.samples(interval_s).is_some_and(|samples| samples < 1.0);
        match resolved.averages.iter().find(is_too_short) {
            Some(&span) => Err(DatasetError::TooShort { span, interval_s }),
            None => Ok(resolved),
        }
    }

    /// Returns the features of the samples: samples × features.
    ///
    /// # Errors
    /// If the memory is invalid for these channels: see [`Memory::check`].
    pub fn features(&self, memory: &Memory) -> Result<ArcArray2<f64>, DatasetError> {
        let memory = self.resolved(memory);
        if memory.is_empty() {
            return Ok(self.of_samples(self.readings.clone()));
        }
        let (rows, channels) = self.readings.dim();
        // One series after the other, so that one state is enough.
        let mut stream = MemoryStream {
            states: Continuation::new(memory.interval_s, 1),
            ..MemoryStream::new(&memory, channels)?
        };
        let mut all = Array2::zeros((rows, stream.features.len()));
        let mut sequence = self.sequence();
        sequence.sort_by_key(|&row| self.series[row]);
        for row in sequence {
            let readings = self.readings.row(row).to_vec();
            let (features, _) = stream.step(self.series[row], &readings, self.time_s(row));
            all.row_mut(row).assign(&ArrayView1::from(features));
        }
        Ok(self.of_samples(all.into_shared()))
    }

    fn of_samples(&self, rows: ArcArray2<f64>) -> ArcArray2<f64> {
        if self.samples.iter().copied().eq(0..rows.nrows()) {
            return rows;
        }
        rows.select(Axis(0), &self.samples).into_shared()
    }
}

/// Features of rows of readings as they come, with one state of a [`Memory`] for each [`Series`].
#[derive(Clone, Debug)]
pub struct MemoryStream {
    start: MemoryState,
    states: Continuation<MemoryState>,
    features: Vec<f64>,
}

impl MemoryStream {
    /// Creates the state before the first row of `channels` readings. Series beyond the number whose states fit into 80 MB
    /// take the place of those that ended longest ago.
    ///
    /// # Errors
    /// See [`Memory::check`].
    pub fn new(memory: &Memory, channels: usize) -> Result<Self, DatasetError> {
        let start = MemoryState::new(memory, channels)?;
        Ok(Self {
            features: vec![0.0; start.features()],
            states: Continuation::new(memory.interval_s, MAX_STATE / start.constants.state().max(1)),
            start,
        })
    }

    /// Takes in the readings of a row, at `time_s` if known. Returns its features, and where it comes in its series.
    ///
    /// # Panics
    /// If the number of readings is wrong.
    pub fn step(&mut self, series: Series, readings: &[f64], time_s: Option<f64>) -> (&[f64], Place) {
        let (state, place) = self.states.next(series, time_s, || self.start.clone());
        let elapsed_s = state.elapsed_s(place);
        state.step(readings, elapsed_s, &mut self.features);
        (&self.features, place)
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::dataset::memory::tests::{of_averages_s, of_lags};

    fn counting(rows: usize) -> Array2<f64> {
        Array2::from_shape_fn((rows, 1), |(row, _)| row as f64)
    }

    /// Number of the stretch of each row, in which rows follow each other without a restart.
    fn stretches(history: &History) -> Vec<usize> {
        let mut rows = Continuation::new(history.interval_s, usize::MAX);
        let (mut stretches, mut count) = (vec![0; history.series.len()], 0);
        for row in history.sequence() {
            let (stretch, place) = rows.next(history.series[row], history.time_s(row), || 0);
            if !matches!(place, Place::After(_)) {
                *stretch = count;
                count += 1;
            }
            stretches[row] = *stretch;
        }
        stretches
    }

    #[test]
    fn a_stretch_ends_with_its_group_and_at_a_gap_in_time() {
        let times_s = vec![0.0, 0.1, 0.2, 0.3, 0.7, 6.3, 6.4, 6.5];
        let history = History::new(counting(8), None, None, Some(times_s), vec![0, 1, 4, 5, 6]);
        assert_eq!(stretches(&history), [0, 0, 0, 0, 0, 1, 1, 1]);
        assert!((history.interval_s().unwrap() - 0.1).abs() < 1e-12);
        let features = history.features(&of_lags(&[1])).unwrap();
        assert_eq!(
            features.column(1).to_vec(),
            [0.0, 0.0, 3.0, 5.0, 5.0],
            "also from rows that are no samples"
        );
        let groups = [4, 4, 7, 7, 4, 4];
        let history = History::new(counting(6), Some(&groups), None, None, vec![0, 1, 2, 3, 4, 5]);
        assert_eq!(
            stretches(&history),
            [0, 0, 1, 1, 0, 0],
            "a group continues after another"
        );
        // Two sessions whose clocks both start at 0, sorted by time.
        let times_s = vec![0.0, 0.0, 0.1, 0.1, 0.2, 0.2];
        let history = History::new(counting(6), Some(&[0, 1, 0, 1, 0, 1]), None, Some(times_s), vec![5]);
        assert_eq!(stretches(&history), [0, 1, 0, 1, 0, 1]);
        assert_eq!(history.features(&of_lags(&[1])).unwrap()[[0, 1]], 3.0);
    }

    #[test]
    fn a_memory_that_would_do_nothing_is_refused() {
        let of_times = |times_s: &[f64]| {
            let rows = times_s.len();
            History::new(counting(rows), None, None, Some(times_s.to_vec()), (0..rows).collect())
        };
        let refused = |history: History, memory: Memory| history.checked(&memory).unwrap_err().to_string();
        let in_milliseconds = of_times(&[0.0, 10.0, 20.0, 30.0]);
        let text = refused(in_milliseconds, of_averages_s(&[0.5]));
        assert!(
            text.contains("shorter than the usual interval") && text.contains("10.0 s"),
            "{text}"
        );
        let text = refused(of_times(&[4.0, 4.0]), of_averages_s(&[3.0]));
        assert!(
            text.contains("no time is later") && !text.contains("name the time column"),
            "{text}"
        );
        let untimed = History::new(counting(2), None, None, None, vec![0]);
        assert!(refused(untimed, of_averages_s(&[3.0])).contains("name the time column"));
    }

    #[test]
    fn the_past_of_one_file_is_not_that_of_the_next() {
        let times_s = |from: f64| Some(Vec::from_iter((0..4).map(|row| from + 0.1 * f64::from(row))));
        let mut history = History::new(counting(4), None, None, times_s(0.0), vec![1, 3]);
        // The second file continues where the first ended, with the same clock.
        history.append(&History::new(counting(4), None, None, times_s(0.4), vec![0, 2]));
        assert_eq!(stretches(&history), [0, 0, 0, 0, 1, 1, 1, 1]);
        assert_eq!(history.samples(), [1, 3, 4, 6]);
        let features = history.features(&of_lags(&[1])).unwrap();
        assert_eq!(features.column(1).to_vec(), [0.0, 2.0, 0.0, 1.0]);
    }

    #[test]
    fn rows_out_of_order_are_taken_in_order_of_time_and_clocks_that_restart_as_they_are() {
        let times_s = vec![0.3, 0.1, 0.2, 0.0];
        let shuffled = History::new(counting(4), None, None, Some(times_s), vec![0, 1, 2, 3]);
        assert!(matches!(
            shuffled.order(),
            RowOrder::Shuffled { count: 2, first_row: 1 }
        ));
        assert!((shuffled.interval_s().unwrap() - 0.1).abs() < 1e-12);
        let features = shuffled.features(&of_lags(&[1])).unwrap();
        assert_eq!(features.column(1).to_vec(), [2.0, 3.0, 1.0, 3.0]);
        let twice = Vec::from_iter((0..120).map(|row| f64::from(row % 60)));
        let restarted = History::new(counting(120), None, None, Some(twice), vec![59, 60, 61]);
        let features = restarted.features(&of_lags(&[1])).unwrap();
        assert_eq!(features.column(1).to_vec(), [58.0, 60.0, 60.0]);
    }

    #[test]
    fn row_wires_remember_apart() {
        let row_wires = [0, 1, 2, 0, 1, 2];
        let history = History::new(counting(6), None, Some(&row_wires), None, vec![3, 4, 5]);
        let features = history.features(&of_lags(&[1])).unwrap();
        assert_eq!(features.column(1).to_vec(), [0.0, 1.0, 2.0]);
        let mut stream = MemoryStream::new(&of_lags(&[1]), 1).unwrap();
        let series = |row: usize| Series {
            group: 0,
            row_wire: row_wires[row],
        };
        let found = Vec::from_iter((0..6).map(|row| stream.step(series(row), &[row as f64], None).0[1]));
        assert_eq!(found, [0.0, 1.0, 2.0, 0.0, 1.0, 2.0]);
    }

    #[test]
    fn a_stream_gives_the_features_of_the_import_and_starts_again_at_gaps() {
        let times_s = vec![0.0, 0.1, 0.25, 0.3, 0.4, 9.0, 9.1, 9.15];
        let readings = counting(8).mapv(|row| f64::sin(3.0 * row));
        let history = History::new(
            readings.clone(),
            None,
            None,
            Some(times_s.clone()),
            Vec::from_iter(0..8),
        );
        let memory = history.resolved(&of_averages_s(&[0.2, 3.0]));
        let expected = history.features(&memory).unwrap();
        let mut stream = MemoryStream::new(&memory, 1).unwrap();
        let only = Series::default();
        for (row, &time_s) in times_s.iter().enumerate() {
            assert_eq!(
                stream.step(only, &[readings[[row, 0]]], Some(time_s)).0,
                expected.row(row).to_vec()
            );
        }
        assert_eq!(expected[[5, 1]], expected[[5, 0]], "it starts again after the gap");
        assert_ne!(expected[[6, 1]], expected[[6, 0]]);
        let mut stream = MemoryStream::new(&memory, 1).unwrap();
        assert_eq!(stream.step(only, &[5.0], None).0, [5.0; 3]);
    }
}
