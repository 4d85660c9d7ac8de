use ndarray::Array2;

use super::{Column, JoinReport};

/// Rows of a joined recording that match the rows of the first.
pub(super) struct Partners {
    /// Row of the joined file for each row; `None` if none is within the limit.
    pub(super) rows: Vec<Option<u32>>,
    pub(super) report: JoinReport,
    /// Number of rows of the joined file that match several rows.
    pub(super) shared: usize,
}

/// Finds the nearest of `joined` within `limit` for each of `times`; of two equally near ones, the earlier. Times may be in
/// any order; NaN if missing.
pub(super) fn nearest(times: &[f64], joined: &[f64], limit: f64) -> Partners {
    let has_time = |row: &u32| !joined[*row as usize].is_nan();
    let mut order = Vec::from_iter((0..joined.len() as u32).filter(has_time));
    order.sort_by(|&one, &other| joined[one as usize].total_cmp(&joined[other as usize]));
    let of = |place: usize| joined[order[place] as usize];
    let mut offsets = Vec::new();
    let mut uses = vec![0_usize; joined.len()];
    let partner = |&time: &f64| {
        // Of equal times, the first row is the match.
        let after = order.partition_point(|&row| joined[row as usize] < time);
        let before = after.checked_sub(1);
        let before = before.map(|place| order.partition_point(|&row| joined[row as usize] < of(place)));
        let candidates = [before, (after < order.len()).then_some(after)];
        let gap = |place: &usize| (of(*place) - time).abs();
        let nearest = candidates.into_iter().flatten();
        let nearest = nearest.min_by(|one, other| gap(one).total_cmp(&gap(other)))?;
        // A missing time has no match.
        (gap(&nearest) <= limit).then(|| {
            offsets.push(time - of(nearest));
            uses[order[nearest] as usize] += 1;
            order[nearest]
        })
    };
    let rows = Vec::from_iter(times.iter().map(partner));
    let report = JoinReport {
        limit,
        without_partner: rows.iter().filter(|partner| partner.is_none()).count(),
        unused: uses.iter().filter(|uses| **uses == 0).count(),
        median_offset: median(&mut offsets),
    };
    let shared = uses.iter().filter(|uses| **uses > 1).count();
    Partners { rows, report, shared }
}

/// Returns the median of the intervals between the sorted times, ignoring intervals of zero.
pub(super) fn median_interval(times: &[f64]) -> Option<f64> {
    let mut sorted = Vec::from_iter(times.iter().copied().filter(|time| !time.is_nan()));
    sorted.sort_by(f64::total_cmp);
    let intervals = sorted.windows(2).map(|pair| pair[1] - pair[0]);
    median(&mut Vec::from_iter(intervals.filter(|interval| *interval > 0.0)))
}

fn median(values: &mut [f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Number of rows moved at once.
const BLOCK: usize = 1 << 14;

/// Moves the columns `ids` into an array of `rows` × `ids`, and frees the others except those in `kept`, which are needed
/// later.
///
/// Works from the last row to the first and shortens the columns on the way, to avoid a second copy of the numbers in
/// memory.
pub(super) fn gather(columns: &mut [Column], ids: &[usize], rows: &[usize], kept: &[usize]) -> Array2<f64> {
    for (id, column) in columns.iter_mut().enumerate() {
        if !ids.contains(&id) && !kept.contains(&id) {
            column.clear();
        }
    }
    let is_ascending = rows.is_sorted();
    let mut all = Array2::zeros((rows.len(), ids.len()));
    let numbers = all.as_slice_mut().expect("a new array is contiguous");
    let mut end = rows.len();
    while end > 0 {
        let start = end.saturating_sub(BLOCK);
        for (place, &id) in ids.iter().enumerate() {
            let moved = &mut columns[id].numbers;
            let block = numbers[start * ids.len()..end * ids.len()].chunks_exact_mut(ids.len());
            for (sample, &row) in block.zip(&rows[start..end]) {
                sample[place] = moved[row];
            }
            if is_ascending {
                moved.truncate(rows[start]);
                moved.shrink_to_fit();
            }
        }
        end = start;
    }
    all
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

    use super::*;

    #[test]
    fn matches_equal_those_of_an_exhaustive_search() {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        for _ in 0..200 {
            // Few distinct values, so that some times are equal and some are equally far from two others.
            let mut draw = |count: usize| -> Vec<f64> {
                let missing_or = |time: i32| if time == 0 { f64::NAN } else { f64::from(time) };
                (0..count).map(|_| missing_or(rng.random_range(0..30))).collect()
            };
            let (times, joined) = (draw(20), draw(12));
            let limit = 2.0;
            let expected: Vec<Option<u32>> = times
                .iter()
                .map(|time| {
                    let gap = |row: &u32| (joined[*row as usize] - time).abs();
                    let near = (0..joined.len() as u32).filter(|row| gap(row) <= limit);
                    near.min_by(|one, other| {
                        let key = |row: &u32| (gap(row), joined[*row as usize]);
                        key(one).partial_cmp(&key(other)).unwrap()
                    })
                })
                .collect();
            assert_eq!(nearest(&times, &joined, limit).rows, expected, "{times:?} {joined:?}");
        }
    }

    #[test]
    fn the_median_interval_needs_two_times() {
        assert_eq!(median_interval(&[3.0, f64::NAN, 1.0, 2.0, 2.0, 7.0]), Some(1.0));
        assert_eq!(median_interval(&[1.0, 1.0]), None);
        assert_eq!(median_interval(&[]), None);
    }
}
