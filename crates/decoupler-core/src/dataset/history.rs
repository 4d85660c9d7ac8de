use std::collections::HashMap;

use ndarray::{ArcArray2, Array2, ArrayView2, Axis};

use super::{Memory, MemoryError, MemoryState};

/// Number of usual intervals after which a memory starts again.
const GAP: f64 = 50.0;

/// Everything that a sensor has read in order of time, including rows that are not samples because a target is missing:
/// the past, from which the features of a [`Memory`] are computed.
///
/// Rows are divided into *stretches*, within which they follow each other. A stretch ends with its group, and where two
/// times are more than fifty usual intervals apart. Row-wires have stretches of their own.
#[derive(Clone, Debug, PartialEq)]
pub struct History {
    /// Rows × channels, shared with the samples.
    readings: ArcArray2<f64>,
    stretches: Vec<usize>,
    stretch_count: usize,
    times_s: Option<Vec<f64>>,
    /// Row of each sample.
    samples: Vec<usize>,
    interval_s: Option<f64>,
}

impl History {
    /// Creates a history of `readings` (rows × channels) with the group, row-wire and time of each row, where known. Rows
    /// are in order of time within each group; `samples` are the rows that are samples.
    ///
    /// # Panics
    /// If a part does not have one entry per row, or a sample is not a row.
    pub fn new(
        readings: Array2<f64>,
        groups: Option<&[usize]>,
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
        assert!(
            lengths.into_iter().flatten().all(|length| length == rows),
            "one entry per row"
        );
        assert!(samples.iter().all(|&row| row < rows), "samples are rows");
        let mut run = 0;
        let keys = Vec::from_iter((0..rows).map(|row| {
            let group = groups.map_or(0, |groups| groups[row]);
            let has_changed = row > 0 && groups.is_some_and(|groups| groups[row] != groups[row - 1]);
            run += usize::from(has_changed);
            // Times of several groups may overlap, and sorted rows are then interleaved.
            let stretch = if times_s.is_some() { group } else { run };
            (stretch, row_wires.map_or(0, |row_wires| row_wires[row]))
        }));
        let interval_s = times_s.as_ref().and_then(|times_s| usual_interval(&keys, times_s));
        let mut latest: HashMap<(usize, usize), (usize, f64)> = HashMap::new();
        let mut count = 0;
        let stretches = Vec::from_iter(keys.iter().enumerate().map(|(row, key)| {
            let time_s = times_s.as_ref().map_or(0.0, |times_s| times_s[row]);
            let continued = latest
                .get(key)
                .filter(|(_, before_s)| follows(time_s - before_s, interval_s));
            let stretch = continued.map_or(count, |(stretch, _)| *stretch);
            count = count.max(stretch + 1);
            latest.insert(*key, (stretch, time_s));
            stretch
        }));
        Self {
            stretches,
            stretch_count: count,
            readings: readings.into_shared(),
            times_s,
            samples,
            interval_s,
        }
    }

    /// Appends the rows of another history of the same channels, with stretches of their own. The usual interval stays; times
    /// are known if both histories know them.
    ///
    /// # Panics
    /// If the numbers of channels differ.
    pub fn append(&mut self, other: &Self) {
        let rows = self.readings.nrows();
        let next = self.stretch_count;
        let mut readings = std::mem::take(&mut self.readings).into_owned();
        let appended = readings.append(Axis(0), other.readings.view());
        appended.expect("histories of the same channels");
        self.readings = readings.into_shared();
        self.stretches
            .extend(other.stretches.iter().map(|stretch| next + stretch));
        self.stretch_count += other.stretch_count;
        self.samples.extend(other.samples.iter().map(|row| rows + row));
        self.times_s = self
            .times_s
            .take()
            .zip(other.times_s.as_ref())
            .map(|(mut times_s, more)| {
                times_s.extend(more);
                times_s
            });
    }

    /// Readings of all rows: rows × channels.
    pub fn readings(&self) -> ArrayView2<'_, f64> {
        self.readings.view()
    }

    /// Stretch of each row.
    pub fn stretches(&self) -> &[usize] {
        &self.stretches
    }

    /// Time of each row in seconds, if known.
    pub fn times_s(&self) -> Option<&[f64]> {
        self.times_s.as_deref()
    }

    /// Row of each sample.
    pub fn samples(&self) -> &[usize] {
        &self.samples
    }

    /// Median interval between successive rows of a stretch, in seconds; `None` without times.
    pub fn interval_s(&self) -> Option<f64> {
        self.interval_s
    }

    /// Returns `memory` with the usual interval of this history, unless it has one.
    #[must_use]
    pub fn resolved(&self, memory: &Memory) -> Memory {
        Memory {
            interval_s: memory.interval_s.or(self.interval_s),
            ..memory.clone()
        }
    }

    /// Returns the features of the samples: samples × features.
    ///
    /// # Errors
    /// If the memory is invalid for these channels; see [`Memory::check`].
    pub fn features(&self, memory: &Memory) -> Result<ArcArray2<f64>, MemoryError> {
        let memory = self.resolved(memory);
        let all = if memory.is_empty() {
            self.readings.clone()
        } else {
            memory
                .expand(self.readings(), &self.stretches, self.times_s())?
                .into_shared()
        };
        if self.samples.iter().copied().eq(0..self.readings.nrows()) {
            return Ok(all);
        }
        Ok(all.select(Axis(0), &self.samples).into_shared())
    }
}

/// Median of the positive intervals between rows with the same key.
fn usual_interval(keys: &[(usize, usize)], times_s: &[f64]) -> Option<f64> {
    let mut latest = HashMap::new();
    let intervals = keys.iter().zip(times_s).filter_map(|(key, &time_s)| {
        let before_s = latest.insert(key, time_s)?;
        Some(time_s - before_s).filter(|interval_s| *interval_s > 0.0)
    });
    let mut intervals = Vec::from_iter(intervals);
    let middle = intervals.len() / 2;
    (!intervals.is_empty()).then(|| *intervals.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// `true` if a row continues the stretch of the row `elapsed_s` before.
fn follows(elapsed_s: f64, interval_s: Option<f64>) -> bool {
    elapsed_s >= 0.0 && interval_s.is_none_or(|interval_s| elapsed_s <= GAP * interval_s)
}

/// Features of a stream of readings with a [`Memory`]: one state for each row-wire, which starts again where the time goes
/// backwards or jumps by more than fifty usual intervals.
///
/// A row without a time comes one usual interval after the row before, that of the training.
#[derive(Clone, Debug)]
pub struct MemoryStream {
    states: Vec<(MemoryState, Option<f64>)>,
    interval_s: Option<f64>,
    features: Vec<f64>,
}

impl MemoryStream {
    /// Creates the state before the first row of `channels` readings from each of `row_wires` row-wires.
    ///
    /// # Errors
    /// See [`Memory::check`].
    pub fn new(memory: &Memory, channels: usize, row_wires: usize) -> Result<Self, MemoryError> {
        let state = MemoryState::new(memory, channels)?;
        state.check_streams(row_wires)?;
        Ok(Self {
            features: vec![0.0; state.features()],
            states: vec![(state, None); row_wires],
            interval_s: memory.interval_s,
        })
    }

    /// Takes in the readings of a row-wire, at `time_s` if known, and returns its features.
    ///
    /// # Panics
    /// If there is no such row-wire, or the number of readings is wrong.
    pub fn step(&mut self, row_index: usize, readings: &[f64], time_s: Option<f64>) -> &[f64] {
        let (state, before_s) = &mut self.states[row_index];
        let elapsed_s = time_s.zip(*before_s).map(|(now_s, before_s)| now_s - before_s);
        if elapsed_s.is_some_and(|elapsed_s| !follows(elapsed_s, self.interval_s)) {
            state.restart();
        }
        *before_s = time_s.or(*before_s);
        state.step(readings, elapsed_s, &mut self.features);
        &self.features
    }

    /// Forgets the past of all row-wires.
    pub fn restart(&mut self) {
        for (state, before_s) in &mut self.states {
            state.restart();
            *before_s = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    fn counting(rows: usize) -> Array2<f64> {
        Array2::from_shape_fn((rows, 1), |(row, _)| row as f64)
    }

    #[test]
    fn a_stretch_ends_with_its_group_and_at_a_gap_in_time() {
        let times_s = vec![0.0, 0.1, 0.2, 0.3, 0.7, 6.3, 6.4, 6.5];
        let history = History::new(counting(8), None, None, Some(times_s), vec![0, 1, 4, 5, 6]);
        assert_eq!(history.stretches(), [0, 0, 0, 0, 0, 1, 1, 1]);
        assert!((history.interval_s().unwrap() - 0.1).abs() < 1e-12);
        let features = history.features(&Memory::of_lags(&[1])).unwrap();
        assert_eq!(
            features.column(1).to_vec(),
            [0.0, 0.0, 3.0, 5.0, 5.0],
            "also from rows that are no samples"
        );
        let groups = [4, 4, 7, 7, 4, 4];
        let history = History::new(counting(6), Some(&groups), None, None, vec![0, 1, 2, 3, 4, 5]);
        assert_eq!(history.stretches(), [0, 0, 1, 1, 2, 2]);
        // Two sessions whose clocks both start at 0, sorted by time.
        let times_s = vec![0.0, 0.0, 0.1, 0.1, 0.2, 0.2];
        let history = History::new(counting(6), Some(&[0, 1, 0, 1, 0, 1]), None, Some(times_s), vec![5]);
        assert_eq!(history.stretches(), [0, 1, 0, 1, 0, 1]);
        assert_eq!(history.features(&Memory::of_lags(&[1])).unwrap()[[0, 1]], 3.0);
    }

    #[test]
    fn the_past_of_one_file_is_not_that_of_the_next() {
        let times_s = |from: f64| Some(Vec::from_iter((0..4).map(|row| from + 0.1 * f64::from(row))));
        let mut history = History::new(counting(4), None, None, times_s(0.0), vec![1, 3]);
        // The second file continues where the first ended, with the same clock.
        history.append(&History::new(counting(4), None, None, times_s(0.4), vec![0, 2]));
        assert_eq!(history.stretches(), [0, 0, 0, 0, 1, 1, 1, 1]);
        assert_eq!(history.samples(), [1, 3, 4, 6]);
        let features = history.features(&Memory::of_lags(&[1])).unwrap();
        assert_eq!(features.column(1).to_vec(), [0.0, 2.0, 0.0, 1.0]);
    }

    #[test]
    fn row_wires_remember_apart() {
        let row_wires = [0, 1, 2, 0, 1, 2];
        let history = History::new(counting(6), None, Some(&row_wires), None, vec![3, 4, 5]);
        let features = history.features(&Memory::of_lags(&[1])).unwrap();
        assert_eq!(features.column(1).to_vec(), [0.0, 1.0, 2.0]);
        let mut stream = MemoryStream::new(&Memory::of_lags(&[1]), 1, 3).unwrap();
        let found = Vec::from_iter((0..6).map(|row| stream.step(row_wires[row], &[row as f64], None)[1]));
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
        let memory = history.resolved(&Memory::of_averages_s(&[0.2, 3.0]));
        let expected = history.features(&memory).unwrap();
        let mut stream = MemoryStream::new(&memory, 1, 1).unwrap();
        for (row, &time_s) in times_s.iter().enumerate() {
            assert_eq!(
                stream.step(0, &[readings[[row, 0]]], Some(time_s)),
                expected.row(row).to_vec()
            );
        }
        assert_eq!(expected[[5, 1]], expected[[5, 0]], "it starts again after the gap");
        assert_ne!(expected[[6, 1]], expected[[6, 0]]);
        stream.restart();
        assert_eq!(stream.step(0, &[5.0], None), [5.0; 3]);
    }
}
