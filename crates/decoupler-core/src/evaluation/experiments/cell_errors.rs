use std::cmp::Ordering;

use super::{CellResults, ExperimentResults};
use crate::{evaluation::Spread, text::format_number};

/// Errors of the trials of a cell that has some.
#[derive(Clone, Debug)]
pub(super) struct CellErrors {
    pub(super) label: String,
    pub(super) column: usize,
    /// Errors of the network in percent.
    pub(super) percent: Spread,
    pub(super) published: Option<f64>,
    pub(super) linear: Option<f64>,
    pub(super) bound: Option<f64>,
    /// Number of trials.
    trials: usize,
}

impl CellErrors {
    /// Fewest trials that have a spread. By chance, the ranges of three and three trials are apart in this order once in 20.
    pub(super) const FEWEST_TRIALS: usize = 3;

    /// Returns the cells that have results.
    pub(super) fn all(results: &ExperimentResults) -> Vec<Self> {
        let errors = |cell: &CellResults| {
            let place = cell.cell;
            let median = |spread: Option<Spread>| spread.map(|spread| spread.median);
            Some(Self {
                label: results.cell_labels(cell).join("/"),
                column: place.column,
                percent: cell.percent()?,
                published: place.published.map(|published| published.z_percent),
                linear: median(cell.spread(|trial| trial.baselines.linear.percent())),
                trials: cell
                    .trials
                    .iter()
                    .filter(|trial| trial.errors.percent().is_some())
                    .count(),
                bound: median(cell.spread(|trial| trial.bottleneck.as_ref()?.percent())),
            })
        };
        results.cells.iter().filter_map(errors).collect()
    }

    /// Compares the errors of all trials with a figure; `None` within their spread, or with too few trials.
    pub(super) fn against(&self, figure: f64) -> Option<Ordering> {
        self.apart([figure, figure])
    }

    /// Compares the errors of all trials with those of another cell; `None` if their ranges overlap, or with too few trials.
    pub(super) fn compare(&self, other: &Self) -> Option<Ordering> {
        let is_enough = other.trials >= Self::FEWEST_TRIALS;
        self.apart([other.percent.smallest, other.percent.largest])
            .filter(|_| is_enough)
    }

    fn apart(&self, [low, high]: [f64; 2]) -> Option<Ordering> {
        match self.percent {
            _ if self.trials < Self::FEWEST_TRIALS => None,
            Spread { largest, .. } if largest < low => Some(Ordering::Less),
            Spread { smallest, .. } if smallest > high => Some(Ordering::Greater),
            _ => None,
        }
    }

    /// Returns the label and errors as text.
    pub(super) fn figures(&self) -> String {
        format!("{}: {}", self.label, spread(&self.percent))
    }
}

/// Sorts cells by a key, ascending.
pub(super) fn sorted_by<K: Ord>(mut cells: Vec<CellErrors>, key: impl FnMut(&CellErrors) -> K) -> Vec<CellErrors> {
    cells.sort_by_key(key);
    cells
}

/// Formats the median, and the smallest to largest value where they differ.
fn spread(spread: &Spread) -> String {
    if spread.smallest == spread.largest {
        return format!("{} %", format_number(spread.median));
    }
    let [median, smallest, largest] = [spread.median, spread.smallest, spread.largest].map(format_number);
    format!("{median} % ({smallest} to {largest})")
}
