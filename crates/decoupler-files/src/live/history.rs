use std::{
    collections::VecDeque,
    ops::Range,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

/// Decoded values with their times in seconds, in ascending order: all of a recording, or the latest of a stream.
///
/// Clones share the values, so that they can be read and exported while decoding continues, and after its end.
#[derive(Clone, Debug, Default)]
pub struct History {
    entries: Arc<Mutex<VecDeque<Entry>>>,
}

type Entry = (f64, Arc<[f64]>);

/// Length of the history of a stream, and of what is displayed, in seconds.
const LENGTH_S: f64 = 20.0;
/// Maximum number of values in the history of a stream, over all targets, and displayed.
const MAX_VALUES: usize = 20_000;

impl History {
    fn lock(&self) -> MutexGuard<'_, VecDeque<Entry>> {
        // Nothing panics while the lock is held.
        self.entries.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds values; of a stream, old ones are removed.
    pub(super) fn push(&self, time_s: f64, values: &[f64], is_stream: bool) {
        let mut entries = self.lock();
        entries.push_back((time_s, values.into()));
        if is_stream {
            let begin = shown(&entries, time_s).start;
            entries.drain(..begin);
        }
    }

    /// Returns the values up to a time that are displayed together, the latest last.
    pub fn until(&self, time_s: f64) -> Vec<(f64, Arc<[f64]>)> {
        let entries = self.lock();
        entries.range(shown(&entries, time_s)).cloned().collect()
    }

    /// Returns all values.
    pub fn all(&self) -> Vec<(f64, Arc<[f64]>)> {
        self.lock().iter().cloned().collect()
    }
}

/// Places of the entries that are displayed together: the last at or before `time_s`, and those of the seconds before.
fn shown(entries: &VecDeque<Entry>, time_s: f64) -> Range<usize> {
    let end = entries.partition_point(|(other_s, _)| *other_s <= time_s);
    let targets = entries.front().map_or(1, |(_, values)| values.len().max(1));
    let few = end.saturating_sub((MAX_VALUES / targets).max(2));
    few.max(entries.partition_point(|(other_s, _)| *other_s < time_s - LENGTH_S))..end
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_keeps_its_latest_values_and_a_recording_all() {
        let (stream, recording) = (History::default(), History::default());
        for k in 0..3000 {
            let time_s = 0.1 * f64::from(k);
            stream.push(time_s, &[f64::from(k)], true);
            recording.push(time_s, &[f64::from(k)], false);
        }
        let times = |entries: Vec<(f64, Arc<[f64]>)>| (entries[0].1[0], entries.last().unwrap().1[0], entries.len());
        assert_eq!(times(stream.all()), (2799.0, 2999.0, 201));
        assert_eq!(times(recording.all()), (0.0, 2999.0, 3000));
        // 20 s up to a moment in the middle.
        assert_eq!(times(recording.until(100.05)), (801.0, 1000.0, 200));
        assert!(recording.until(-1.0).is_empty());
    }

    #[test]
    fn many_targets_have_a_shorter_history() {
        let history = History::default();
        for k in 0..30 {
            history.push(0.01 * f64::from(k), &[0.0; 2000], true);
        }
        assert_eq!(history.all().len(), 10);
    }
}
