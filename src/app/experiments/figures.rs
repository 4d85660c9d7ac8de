//! The figures of an experiment as points of a chart. Free of the toolkit.

use super::Outcome;
use crate::evaluation::experiments::{Axis, CellSummary, Figure};

/// A cell in a chart: where it stands and what it came to.
#[derive(Clone, Debug, PartialEq)]
pub struct CellPoint {
    /// On the axis: the number itself, or the place in the list.
    pub x: f64,
    pub published: Option<f64>,
    /// Median, least, largest.
    pub spread: Option<[f64; 3]>,
    pub bound: Option<f64>,
    pub linear: Option<f64>,
}

/// The Z errors of every cell along the first axis, in its order.
pub fn z_points(outcome: &Outcome) -> Vec<CellPoint> {
    let axis = &outcome.results.experiment.axis;
    let mut points: Vec<CellPoint> = outcome
        .summaries
        .iter()
        .enumerate()
        .map(|(at, cell)| point(axis, at, cell))
        .collect();
    points.sort_by(|one, other| one.x.total_cmp(&other.x));
    points
}

fn point(axis: &Axis, at: usize, cell: &CellSummary) -> CellPoint {
    let x = match axis {
        Axis::Hidden(_) => cell.hidden,
        _ => at,
    };
    let Figure {
        published,
        median,
        min,
        max,
        ..
    } = cell.z_percent;
    CellPoint {
        x: x as f64,
        published,
        spread: median.zip(min).zip(max).map(|((median, min), max)| [median, min, max]),
        bound: cell.bound_z_percent,
        linear: cell.linear_z_percent,
    }
}

/// The error of each trial of a cell against its number, from 1: Fig. 5. Missing ones are left out.
pub fn trial_points(figure: &Figure) -> Vec<[f64; 2]> {
    let numbered = figure.values.iter().enumerate();
    numbered
        .filter_map(|(at, value)| Some([(at + 1) as f64, (*value)?]))
        .collect()
}

/// Where `value` stands between the least and largest of `values`, by the logarithm, from 0 to 1.
pub fn log_share(value: f64, values: impl Iterator<Item = f64> + Clone) -> f32 {
    let positive = values.filter(|value| *value > 0.0);
    let least = positive.clone().fold(f64::INFINITY, f64::min).ln();
    let largest = positive.fold(f64::NEG_INFINITY, f64::max).ln();
    let share = (value.ln() - least) / (largest - least);
    if share.is_finite() {
        share.clamp(0.0, 1.0) as f32
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trial_without_a_figure_keeps_its_number() {
        let figure = Figure {
            published: None,
            median: None,
            min: None,
            max: None,
            values: vec![Some(2.0), None, Some(3.0)],
        };
        assert_eq!(trial_points(&figure), [[1.0, 2.0], [3.0, 3.0]]);
    }

    #[test]
    fn shares_run_from_least_to_largest_and_one_value_has_the_least() {
        let values = [0.1, 1.0, 10.0];
        let shares = values.map(|value| log_share(value, values.into_iter()));
        assert_eq!(shares, [0.0, 0.5, 1.0]);
        assert_eq!(log_share(2.0, [2.0].into_iter()), 0.0);
        assert_eq!(log_share(0.0, values.into_iter()), 0.0);
    }
}
