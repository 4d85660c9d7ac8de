use super::truncated::Factor;
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

impl Marginal {
    /// Half lies below: the answer of the least expected distance.
    pub(super) fn median(&self) -> f64 {
        self.seen.median(self.range, self.mean)
    }
}
