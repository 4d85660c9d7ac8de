//! The figures of an experiment as points of a chart, in the window as on paper.

use crate::evaluation::{
    Errors,
    experiments::{Axis, CellResults, CellSummary, Experiment, ExperimentResults, Figure, Trial},
};

/// Position and errors of a cell in a chart.
#[derive(Clone, Debug, PartialEq)]
pub struct CellPoint {
    /// Position on the axis: the value itself, or its index in the list.
    pub x: f64,
    pub published: Option<f64>,
    /// Median, least, largest.
    pub spread: Option<[f64; 3]>,
    pub bound: Option<f64>,
    pub linear: Option<f64>,
}

/// The Z errors of every cell along the first axis, in its order.
pub fn z_points(results: &ExperimentResults, summaries: &[CellSummary]) -> Vec<CellPoint> {
    let axis = &results.experiment.axis;
    let mut points: Vec<CellPoint> = summaries
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

/// An error of each trial of a cell against its number, from 1 and counted through all seeds: Fig. 5.
pub fn trial_points(experiment: &Experiment, cell: &CellResults, error: fn(&Errors) -> Option<f64>) -> Vec<[f64; 2]> {
    let repeats = experiment.cross_validation.map_or(1, |validation| validation.repeats);
    let number = |trial: &Trial| {
        let seeds_before = trial.seed.0.wrapping_sub(cell.cell.settings.seed.0) as f64;
        seeds_before * repeats as f64 + trial.repeat as f64 + 1.0
    };
    let points = cell.trials.iter();
    points
        .filter_map(|trial| Some([number(trial), error(&trial.errors)?]))
        .collect()
}

/// Name of what the trials of a cross-validation are counted by.
pub fn repeat_name(results: &ExperimentResults) -> &'static str {
    match results.experiment.seeds {
        1 => "repeat",
        _ => "trial",
    }
}

#[cfg(test)]
mod tests {
    use std::num::NonZero;

    use super::*;
    use crate::{
        dataset::{FoldUnit, Seed},
        evaluation::{
            CrossValidation,
            experiments::{Finished, PaperTable, run_experiments},
        },
    };

    #[test]
    fn trials_keep_their_numbers_in_whichever_order_they_finish() {
        let mut experiment = PaperTable::CrossValidation.experiment();
        experiment.base.training.stopping.epochs = 1;
        experiment.base.hidden = 1;
        experiment.axis = Axis::Samples(vec![40]);
        (experiment.seeds, experiment.base.seed) = (2, Seed(7));
        experiment.cross_validation = Some(CrossValidation {
            folds: 2,
            repeats: 3,
            unit: FoldUnit::Sample,
        });
        let mut results = ExperimentResults::new(experiment.clone());
        let mut finished = Vec::new();
        let keep = |trial: Finished| finished.push(trial);
        run_experiments(std::slice::from_ref(&experiment), NonZero::<usize>::MIN, || false, keep).unwrap();
        // The fourth trial is the second seed's first.
        for trial in finished.into_iter().rev().take(3) {
            results.record(trial.cell, trial.outcome);
        }
        let points = trial_points(&experiment, &results.cells[0], |errors| errors.z_percent);
        assert_eq!(points.iter().map(|point| point[0]).collect::<Vec<_>>(), [4.0, 5.0, 6.0]);
    }
}
