use super::{CellResults, ExperimentResults, Trial};
use crate::evaluation::Spread;

/// A cell with results.
#[derive(Clone, Debug)]
pub(super) struct Measured {
    pub(super) label: String,
    pub(super) column: usize,
    pub(super) z: Spread,
    pub(super) published: Option<f64>,
    pub(super) linear: Option<f64>,
    pub(super) bound: Option<f64>,
    /// Z error of each trial, by seed and repeat.
    pub(super) trials: Vec<((u64, usize), f64)>,
}

impl Measured {
    /// Returns the cells that have results.
    pub(super) fn all(results: &ExperimentResults) -> Vec<Self> {
        let z_of = |trial: &Trial| Some(((trial.seed.0, trial.repeat), trial.errors.z_percent?));
        let measure = |cell: &CellResults| {
            let place = cell.cell;
            let median = |spread: Option<Spread>| spread.map(|spread| spread.median);
            Some(Self {
                label: results.cell_labels(cell).join("/"),
                column: place.column,
                z: cell.z_percent()?,
                published: place.published.map(|published| published.z_percent),
                linear: median(cell.spread(|trial| trial.baselines.linear.z_percent)),
                trials: cell.trials.iter().filter_map(z_of).collect(),
                bound: median(cell.spread(|trial| trial.bottleneck.z_percent)),
            })
        };
        results.cells.iter().filter_map(measure).collect()
    }

    /// Returns the Z errors of trials with the same seed and repeat in both cells.
    pub(super) fn beside<'a>(&'a self, other: &'a Self) -> impl Iterator<Item = (f64, f64)> + 'a {
        let partner = |key| other.trials.iter().find(move |trial| trial.0 == key);
        self.trials
            .iter()
            .filter_map(move |(key, z)| Some((*z, partner(*key)?.1)))
    }

    /// Returns the label and Z errors as text.
    pub(super) fn figures(&self) -> String {
        format!("{}: {}", self.label, spread(&self.z))
    }
}

/// Sorts cells by a key, ascending.
pub(super) fn sorted_by<K: Ord>(mut measured: Vec<Measured>, key: impl FnMut(&Measured) -> K) -> Vec<Measured> {
    measured.sort_by_key(key);
    measured
}

/// Formats a number with three significant digits.
pub(super) fn number(value: f64) -> String {
    match value.abs() {
        1e2.. => format!("{value:.0}"),
        1e1.. => format!("{value:.1}"),
        1.0.. => format!("{value:.2}"),
        0.001.. => format!("{value:.3}"),
        0.0 => "0".to_owned(),
        _ => format!("{value:.1e}"),
    }
}

/// Formats the median, and the smallest to largest value where they differ.
fn spread(spread: &Spread) -> String {
    if spread.smallest == spread.largest {
        return format!("{} %", number(spread.median));
    }
    let [median, smallest, largest] = [spread.median, spread.smallest, spread.largest].map(number);
    format!("{median} % ({smallest} to {largest})")
}
