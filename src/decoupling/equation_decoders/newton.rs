use super::{
    PosteriorDecoder,
    plain_first::PlainFirst,
    row_search::{RowSearch, Trial},
};
use crate::{
    decoupling::side_by_side::LANES,
    decoupling::{
        DecodeError, Decoder, LARGEST_ERROR, Newton, NewtonReport, NewtonRules, Posterior, Solution, SolvedRows,
    },
    scene::Scene,
    sensor::{SensorError, SensorModel},
};

/// Decodes every row of a frame by the Gauss-Newton method. If rows are not known, the one that fits the readings best
/// is taken.
///
/// It takes readings to be exact: all of them have gain 1. Readings with drift or other noise are for
/// [`PosteriorDecoder`], whose unknowns include the gain of the snapshot; here they count as not solved.
#[derive(Clone, Debug)]
pub struct NewtonDecoder {
    newton: Newton,
    search: RowSearch,
    /// Rules that give each row-wire one start.
    brief: NewtonRules,
    rules: NewtonRules,
    /// Answers the rows that the equations leave open.
    of_open_rows: Option<PosteriorDecoder>,
    solved: SolvedRows,
}

impl NewtonDecoder {
    /// Creates a decoder for `rows` of `model` in `scene`.
    ///
    /// # Errors
    /// If the sensor has no resistances at rest.
    pub fn new(model: &SensorModel, scene: &Scene, rows: &[usize], rules: NewtonRules) -> Result<Self, SensorError> {
        Ok(Self {
            newton: Newton::new(model, scene, rules),
            search: RowSearch::new(model, scene, rows)?,
            brief: NewtonRules { starts: 1, ..rules },
            rules,
            of_open_rows: None,
            solved: SolvedRows::default(),
        })
    }

    /// As [`Self::new`], but `posterior` answers where the equations have no solution to within [`LARGEST_ERROR`]: of all
    /// deformations that explain the readings to their rounding, its median has the least expected error. `rows` must be
    /// among its rows.
    ///
    /// # Errors
    /// If the sensor has no resistances at rest.
    pub fn with_posterior(
        posterior: Posterior,
        model: &SensorModel,
        scene: &Scene,
        rows: &[usize],
    ) -> Result<Self, SensorError> {
        let of_open_rows = Some(PosteriorDecoder::new(posterior, model, scene, rows)?);
        Ok(Self {
            of_open_rows,
            ..Self::new(model, scene, rows, NewtonRules::default())?
        })
    }

    /// Solves one row by `rules`; returns the report on the row-wire taken.
    fn solve(
        &mut self,
        rules: NewtonRules,
        row_index: usize,
        readings: &[f64],
        targets: &mut [f64],
    ) -> Result<Option<NewtonReport>, DecodeError> {
        let newton = &mut self.newton;
        newton.set_rules(rules);
        self.search
            .solve(row_index, readings, targets, |row, readings, coordinates| {
                let report = newton.solve(row, readings, coordinates)?;
                Ok(Trial {
                    score: report.residual,
                    is_explained: report.solution != Solution::None,
                    report,
                })
            })
    }
}

impl PlainFirst for NewtonDecoder {
    fn answer_plainly(&mut self, first: usize, readings: &[f64], targets: &mut [f64]) -> [Option<Solution>; LANES] {
        let count = readings.len() / self.search.channels();
        let Some(known) = self.search.known_rows() else {
            return [None; LANES];
        };
        self.newton.set_rules(self.rules);
        let reports = self
            .newton
            .solve_plainly(&known[first..first + count], readings, targets);
        reports.map(|report| Some(report?.solution))
    }

    fn answer(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<Solution, DecodeError> {
        let mut report = None;
        if self.search.is_needed() {
            // Most row-wires tried are not the right one, and no start helps them.
            report = self.solve(self.brief, row_index, readings, targets)?;
        }
        if report.is_none_or(|report| report.solution == Solution::None) {
            report = self.solve(self.rules, row_index, readings, targets)?;
        }
        let is_open = report.is_none_or(|report| report.largest_error > LARGEST_ERROR);
        if let Some(posterior) = self.of_open_rows.as_mut().filter(|_| is_open) {
            return posterior.answer(row_index, readings, targets);
        }
        let solution = report.map_or(Solution::None, |report| report.solution);
        Ok(self.search.twins().unless_twin(solution, targets))
    }

    fn solved(&mut self) -> &mut SolvedRows {
        &mut self.solved
    }
}

impl Decoder for NewtonDecoder {
    fn channels(&self) -> usize {
        self.search.channels()
    }

    fn outputs(&self) -> usize {
        self.search.outputs()
    }

    fn decode_row(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        let solution = self.answer(row_index, readings, targets)?;
        self.solved.count(solution);
        Ok(())
    }

    fn decode(&mut self, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        self.answer_all(readings, targets)
    }

    fn take_solved_rows(&mut self) -> SolvedRows {
        std::mem::take(&mut self.solved)
    }
}
