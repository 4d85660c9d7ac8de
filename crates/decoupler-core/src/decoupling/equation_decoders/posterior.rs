use super::row_search::{EXPLAINED, RowSearch, Trial};
use crate::{
    decoupling::{DecodeError, Decoder, Description, NotDescribed, Posterior, PosteriorReport, Solution, SolvedRows},
    scene::Scene,
    sensor::{SensorError, SensorModel},
};

/// Decodes every row of a frame by the Gauss-Newton method with noise and prior. If rows are not known, the most probable
/// one is taken: the row of the largest evidence under the noise of the scene.
#[derive(Clone, Debug)]
pub struct PosteriorDecoder {
    posterior: Posterior,
    search: RowSearch,
    /// Noise leaves every answer undetermined, which the reference tells.
    is_noisy: bool,
    solved: SolvedRows,
}

impl PosteriorDecoder {
    /// Creates a decoder for `rows` of `model` in `scene`, which must be among the rows of `posterior`.
    ///
    /// # Errors
    /// If the sensor has no resistances at rest.
    pub fn new(posterior: Posterior, model: &SensorModel, scene: &Scene, rows: &[usize]) -> Result<Self, SensorError> {
        Ok(Self {
            posterior,
            search: RowSearch::new(model, scene, rows)?,
            is_noisy: !scene.noise.in_test().is_none(),
            solved: SolvedRows::default(),
        })
    }

    /// Solves rows side by side, each with the index of its own row-wire; returns the standing of the answers.
    fn answers(
        &mut self,
        row_indices: &[usize],
        readings: &[f64],
        targets: &mut [f64],
    ) -> Result<Vec<Solution>, DecodeError> {
        let (posterior, is_search) = (&mut self.posterior, self.search.is_needed());
        let taken = self
            .search
            .solve_rows(row_indices, readings, targets, |rows, readings, coordinates| {
                let reports = posterior.solve_rows(rows, readings, coordinates)?;
                let scores = if is_search {
                    posterior.surprises(rows, readings, coordinates, &reports)
                } else {
                    vec![0.0; rows.len()]
                };
                let trial = |(report, score): (PosteriorReport, f64)| Trial {
                    score,
                    is_explained: report.residual < EXPLAINED,
                    report,
                };
                Ok(reports.into_iter().zip(scores).map(trial).collect())
            })?;
        Ok(taken.into_iter().map(|report| self.standing(report)).collect())
    }

    fn standing(&self, report: Option<PosteriorReport>) -> Solution {
        match report {
            Some(report) if report.converged => {
                if self.is_noisy || report.determined && report.residual < EXPLAINED {
                    Solution::Unique
                } else if report.determined {
                    // Readings that leave nothing open, and that the answer does not explain.
                    Solution::None
                } else {
                    Solution::Undetermined
                }
            }
            _ => Solution::None,
        }
    }

    /// Solves one row; returns the standing of the answer.
    pub(super) fn answer(
        &mut self,
        row_index: usize,
        readings: &[f64],
        targets: &mut [f64],
    ) -> Result<Solution, DecodeError> {
        Ok(self.answers(&[row_index], readings, targets)?[0])
    }
}

impl Decoder for PosteriorDecoder {
    fn channels(&self) -> usize {
        self.search.channels()
    }

    fn outputs(&self) -> usize {
        self.search.outputs()
    }

    fn decode_row(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        self.decode_rows(&[row_index], readings, targets)
    }

    fn decode_rows(&mut self, row_indices: &[usize], readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        for solution in self.answers(row_indices, readings, targets)? {
            self.solved.count(solution);
        }
        Ok(())
    }

    fn decode(&mut self, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        let row_indices: Vec<usize> = (0..readings.len() / self.channels()).collect();
        self.decode_rows(&row_indices, readings, targets)
    }

    fn take_solved_rows(&mut self) -> SolvedRows {
        std::mem::take(&mut self.solved)
    }

    fn description(&self) -> Result<Description, NotDescribed> {
        Err(NotDescribed::Posterior)
    }
}
