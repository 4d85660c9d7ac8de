use std::time::Duration;

use super::{Cell, Experiment, TrialSamples};
use crate::training::Method;

/// Estimates the remaining time from the finished jobs. Jobs of a cell with finished jobs count as their mean; other
/// jobs by the number of operations of their training, at the speed of all finished jobs.
pub(super) struct TimeLeft {
    threads: usize,
    cells: Vec<CellTime>,
}

struct CellTime {
    /// Approximate number of multiplications in one job.
    work: f64,
    jobs: usize,
    finished: usize,
    seconds: f64,
}

impl TimeLeft {
    /// Creates an estimate from `(work, jobs)` of each cell: multiplications per job, roughly, and number of jobs.
    pub(super) fn new(cells: impl IntoIterator<Item = (f64, usize)>, threads: usize) -> Self {
        let cells = cells.into_iter().map(|(work, jobs)| CellTime {
            work,
            jobs,
            finished: 0,
            seconds: 0.0,
        });
        Self {
            threads,
            cells: cells.collect(),
        }
    }

    /// Records the time of a finished job of cell `cell`.
    pub(super) fn finished(&mut self, cell: usize, took: Duration) {
        let cell = &mut self.cells[cell];
        cell.finished += 1;
        cell.seconds += took.as_secs_f64();
    }

    /// Returns the time until all jobs are finished; `None` before the first is.
    pub(super) fn estimate(&self) -> Option<Duration> {
        let (seconds, work) = self.cells.iter().fold((0.0, 0.0), |(seconds, work), cell| {
            (seconds + cell.seconds, work + cell.work * cell.finished as f64)
        });
        if work == 0.0 {
            return None;
        }
        let rest = self.cells.iter().map(|cell| {
            let of_one = match cell.finished {
                0 => cell.work * seconds / work,
                finished => cell.seconds / finished as f64,
            };
            of_one * cell.jobs.saturating_sub(cell.finished) as f64
        });
        Duration::try_from_secs_f64(rest.sum::<f64>() / self.threads as f64).ok()
    }
}

/// Approximate number of multiplications in one job of `cell`, if it runs all of its epochs.
pub(super) fn work(experiment: &Experiment, cell: &Cell, samples: &TrialSamples) -> f64 {
    let settings = &cell.settings;
    let (inputs, outputs, samples) = match (settings.source.simulation(), samples) {
        (Some(source), _) => {
            let scale = source.sensor.scale;
            (scale.columns(), scale.coordinates_per_row(), source.samples)
        }
        (None, TrialSamples::Recorded(recorded)) => {
            (recorded.set.channels(), recorded.set.outputs(), recorded.set.samples())
        }
        (None, TrialSamples::Drawn) => (1, 1, 1),
    };
    let (n1, h) = ((inputs + 1) as f64, settings.hidden as f64);
    let (outputs, samples) = (outputs as f64, samples as f64);
    // Forward and backward passes, and the test and validation sets.
    let passes = 4.0 * samples * h * (n1 + outputs);
    let second_order = samples * (h * n1).powi(2) / 4.0 + 0.5 * (h * n1).powi(3);
    let epoch = match settings.training.method {
        Method::LevenbergMarquardt(_) | Method::BayesianRegularization(_) | Method::VariableProjection(_) => {
            passes + second_order
        }
        _ => passes,
    };
    let trainings = experiment.folds() * settings.starts * settings.training.stopping.epochs;
    epoch * trainings as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_finished_tells_what_is_left() {
        let mut time = TimeLeft::new([(1.0, 4), (3.0, 2)], 2);
        assert_eq!(time.estimate(), None);
        time.finished(0, Duration::from_secs(2));
        // 3 more of 2 s, and 2 of three times the work: 18 s for two threads.
        assert_eq!(time.estimate(), Some(Duration::from_secs(9)));
        time.finished(1, Duration::from_secs(4));
        // The cell's own time counts now: 3 of 2 s and 1 of 4 s.
        assert_eq!(time.estimate(), Some(Duration::from_secs(5)));
        for cell in [0, 0, 0, 1] {
            time.finished(cell, Duration::from_secs(1));
        }
        assert_eq!(time.estimate(), Some(Duration::ZERO));
    }
}
