use std::collections::HashMap;

/// Number of usual intervals after which a series starts again.
pub const GAP: f64 = 50.0;
/// Steps back in time are restarts of a clock up to one in this many rows; more of them are rows that are out of order.
const ROWS_PER_RESTART: usize = 50;

/// Rows that continue each other: those of one group, read from one row-wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Series {
    /// Group, 0 if there are none.
    pub group: u64,
    /// Row-wire, 0 if it is not known.
    pub row_wire: usize,
}

/// Decides which state a row continues.
///
/// Each [`Series`] has a state of its own. It restarts where the time steps back, or jumps by more than fifty usual
/// intervals. A row without a time comes one usual interval after the row before.
#[derive(Clone, Debug)]
pub(super) struct Continuation<S> {
    interval_s: Option<f64>,
    /// Maximum number of states; beyond that the half that was used longest ago is dropped.
    limit: usize,
    rows: u64,
    states: HashMap<Series, Continued<S>>,
}

#[derive(Clone, Debug)]
struct Continued<S> {
    state: S,
    time_s: Option<f64>,
    last_row: u64,
}

/// Where a row comes in its series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// First row of the series.
    First,
    /// Seconds after the row before; `None` is one usual interval.
    After(Option<f64>),
    /// First row after a pause, in seconds.
    AfterPause(f64),
    /// First row after the time stepped back, by how many seconds.
    AfterStepBack(f64),
}

impl<S> Continuation<S> {
    /// Creates no states yet, for rows with this usual interval and at most `limit` series at a time.
    pub fn new(interval_s: Option<f64>, limit: usize) -> Self {
        Self {
            interval_s,
            limit: limit.max(1),
            rows: 0,
            states: HashMap::new(),
        }
    }

    /// Returns the state that the next row of `series` continues, and where the row comes. The state of a first row is made
    /// by `new`; at other restarts the caller resets it.
    pub fn next(&mut self, series: Series, time_s: Option<f64>, new: impl FnOnce() -> S) -> (&mut S, Place) {
        self.rows += 1;
        if self.states.len() >= self.limit && !self.states.contains_key(&series) {
            self.drop_oldest();
        }
        let mut place = Place::First;
        let continued = self.states.entry(series).and_modify(|before| {
            let elapsed_s = time_s.zip(before.time_s).map(|(now_s, before_s)| now_s - before_s);
            place = match (elapsed_s, self.interval_s) {
                (Some(elapsed_s), _) if elapsed_s < 0.0 => Place::AfterStepBack(-elapsed_s),
                (Some(elapsed_s), Some(interval_s)) if elapsed_s > GAP * interval_s => Place::AfterPause(elapsed_s),
                (elapsed_s, _) => Place::After(elapsed_s),
            };
        });
        let continued = continued.or_insert_with(|| Continued {
            state: new(),
            time_s: None,
            last_row: 0,
        });
        continued.time_s = time_s.or(continued.time_s);
        continued.last_row = self.rows;
        (&mut continued.state, place)
    }

    fn drop_oldest(&mut self) {
        let mut last_rows = Vec::from_iter(self.states.values().map(|state| state.last_row));
        let middle = last_rows.len() / 2;
        let oldest = *last_rows.select_nth_unstable(middle).1;
        self.states.retain(|_, state| state.last_row > oldest);
    }
}

/// Order of the rows of a file by the times of each series.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RowOrder {
    /// The time of no series steps back.
    ByTime,
    /// The time steps back in at most one of fifty rows: the clock of the device was restarted there, and the rows are
    /// taken as they are.
    Restarts {
        /// Number of steps back.
        count: usize,
        /// First row after a step back.
        first_row: usize,
    },
    /// The time steps back more often: the rows are out of order, and are sorted by time.
    Shuffled {
        /// Number of steps back.
        count: usize,
        /// First row after a step back.
        first_row: usize,
    },
}

impl RowOrder {
    /// Finds the order of rows with this series and time each, in their order in the file.
    pub fn of(rows: impl IntoIterator<Item = (Series, f64)>) -> Self {
        let mut times_s = HashMap::new();
        let (mut count, mut first_row, mut total) = (0, None, 0);
        for (row, (series, time_s)) in rows.into_iter().enumerate() {
            total += 1;
            let before_s = times_s.insert(series, time_s);
            if before_s.is_some_and(|before_s| time_s < before_s) {
                count += 1;
                first_row.get_or_insert(row);
            }
        }
        match first_row {
            None => Self::ByTime,
            Some(first_row) if count * ROWS_PER_RESTART <= total => Self::Restarts { count, first_row },
            Some(first_row) => Self::Shuffled { count, first_row },
        }
    }
}

/// Median of the positive intervals between successive rows of the same series, in seconds; `None` without any.
pub(super) fn usual_interval_s(rows: impl IntoIterator<Item = (Series, f64)>) -> Option<f64> {
    let mut latest = HashMap::new();
    let intervals = rows.into_iter().filter_map(|(series, time_s)| {
        let before_s = latest.insert(series, time_s)?;
        Some(time_s - before_s).filter(|interval_s| *interval_s > 0.0)
    });
    let mut intervals = Vec::from_iter(intervals);
    let middle = intervals.len() / 2;
    (!intervals.is_empty()).then(|| *intervals.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: Series = Series { group: 7, row_wire: 0 };
    const B: Series = Series { group: 7, row_wire: 1 };

    #[test]
    fn a_series_continues_until_a_pause_or_a_step_back() {
        let mut rows = Continuation::new(Some(0.1), 10);
        let mut next = |series, time_s| rows.next(series, time_s, || ()).1;
        for (series, time_s, expected, why) in [
            (A, Some(0.0), Place::First, "nothing before"),
            (B, Some(0.0), Place::First, "another row-wire"),
            (A, Some(0.25), Place::After(Some(0.25)), "whatever comes between"),
            (A, Some(0.25), Place::After(Some(0.0)), "the same time"),
            (A, None, Place::After(None), "no time"),
            (A, Some(5.25), Place::After(Some(5.0)), "fifty intervals"),
            (A, Some(10.75), Place::AfterPause(5.5), "more than fifty"),
            (A, Some(10.5), Place::AfterStepBack(0.25), "a step back"),
            (B, Some(0.5), Place::After(Some(0.5)), "its own clock"),
        ] {
            assert_eq!(next(series, time_s), expected, "{why}");
        }
    }

    #[test]
    fn the_states_used_longest_ago_are_dropped_beyond_the_limit() {
        let mut rows = Continuation::new(None, 4);
        let of = |group| Series { group, row_wire: 0 };
        for group in [0, 1, 2, 3, 0, 4] {
            rows.next(of(group), None, || ());
        }
        assert_eq!(rows.next(of(0), None, || ()).1, Place::After(None));
        assert_eq!(rows.next(of(1), None, || ()).1, Place::First);
    }

    #[test]
    fn few_steps_back_are_restarts_and_many_are_rows_out_of_order() {
        let two_sessions = (0..100).map(|row| (A, f64::from(row % 50)));
        let restart = RowOrder::Restarts {
            count: 1,
            first_row: 50,
        };
        assert_eq!(RowOrder::of(two_sessions), restart);
        let interleaved = (0..100).map(|row| ([A, B][row % 2], [0.0, 1000.0][row % 2] + row as f64));
        assert_eq!(RowOrder::of(interleaved), RowOrder::ByTime);
        let swapped = [0.0, 2.0, 1.0, 3.0].map(|time_s| (A, time_s));
        assert_eq!(RowOrder::of(swapped), RowOrder::Shuffled { count: 1, first_row: 2 });
    }
}
