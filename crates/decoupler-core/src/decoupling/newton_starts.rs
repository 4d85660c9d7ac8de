use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

use super::row_problem::Range;

/// Starts of the Gauss-Newton method, one after the other: the middle of the ranges, which is the least far from any
/// answer, the undeformed state, the whole stroke, then random ones, the same for every row.
#[derive(Default)]
pub(super) struct Starts {
    given: usize,
    /// Not seeded before it is needed, which is rare.
    rng: Option<ChaCha8Rng>,
}

impl Starts {
    /// Returns the unknowns of the next start in millimetres.
    pub(super) fn next_mm(&mut self, ranges: &[Range]) -> Vec<f64> {
        self.given += 1;
        let ranges = ranges.iter();
        match self.given {
            1 => ranges.map(|range| range.middle()).collect(),
            2 => ranges.map(|range| range.clamp(0.0)).collect(),
            3 => ranges.map(|range| range.highest).collect(),
            _ => {
                let rng = self.rng.get_or_insert_with(|| ChaCha8Rng::seed_from_u64(0));
                ranges
                    .map(|range| range.lowest + range.width() * rng.random_range(0.0..=1.0))
                    .collect()
            }
        }
    }
}
