use super::{
    factor::{Factor, Ranges},
    pack::{LANES, Pack},
    truncated::Cut,
};
use crate::decoupling::row_problem::Range;

/// The distribution of one unknown.
#[derive(Clone, Copy, Debug)]
pub(super) struct Marginal {
    pub(super) mean: f64,
    pub(super) variance: f64,
    pub(super) range: Range,
    /// Everything said of the unknown but its range, to which it is cut.
    pub(super) seen: Factor,
    /// Factor that stands for the range.
    pub(super) factor: Factor,
}

/// The points below which half of each distribution lies: the answers of the least expected distance.
pub(super) fn medians(marginals: &[Marginal]) -> Vec<f64> {
    let mut medians = Vec::with_capacity(marginals.len());
    for some in marginals.chunks(LANES) {
        let (mut seen, mut ranges, mut means) = (Factor::FLAT, Ranges::NONE, Pack::ZERO);
        for (lane, marginal) in some.iter().enumerate() {
            seen.set(lane, marginal.seen);
            ranges.set(lane, marginal.range);
            means.set(lane, marginal.mean);
        }
        let found = pulp::Arch::new().dispatch(|| Cut::new(seen, &ranges).medians(&ranges, means));
        medians.extend((0..some.len()).map(|lane| found.get(lane)));
    }
    medians
}
