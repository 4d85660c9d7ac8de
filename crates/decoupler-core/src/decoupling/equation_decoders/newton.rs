use glam::DVec3;

use super::row_search::{EXPLAINED, RowSearch, Trial};
use crate::{
    dataset::PerRow,
    decoupling::{
        DecodeError, Decoder, Description, LARGEST_ERROR, Newton, NewtonReport, NewtonRules, NotDescribed, Posterior,
        PosteriorReport, Program, RowProblemDescription, Solution, SolvedRows, affine_map::AffineStart,
        row_problem::ranges, side_by_side::LANES,
    },
    scene::Scene,
    sensor::{Axes, SensorError, SensorModel},
};

/// Decodes every row of a frame by the Gauss-Newton method. If rows are not known, the row-wire that fits the
/// readings best is used.
///
/// It assumes exact readings, with gain 1. Readings with drift or other noise need a [`PosteriorDecoder`], whose
/// unknowns include the gain of the snapshot; here they count as not solved.
#[derive(Clone, Debug)]
pub struct NewtonDecoder {
    model: SensorModel,
    scene: Scene,
    newton: Newton,
    search: RowSearch,
    /// Rules with one start for each row-wire.
    brief: NewtonRules,
    rules: NewtonRules,
    /// Decoder for the rows that the equations do not determine.
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
            model: *model,
            scene: *scene,
            newton: Newton::new(model, scene, rules),
            search: RowSearch::new(model, scene, rows)?,
            brief: NewtonRules { starts: 1, ..rules },
            rules,
            of_open_rows: None,
            solved: SolvedRows::default(),
        })
    }

    /// As [`Self::new`], but `posterior` decodes the rows whose equations have no solution to within
    /// [`LARGEST_ERROR`]: among all deformations that explain the readings to their rounding, its median has the
    /// minimum expected error. `rows` must be among its rows.
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

    /// Solves one row by `rules`; returns the report on the row-wire that was chosen.
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

/// Coordinates of the nodes of a row-wire at the start of the iteration: the affine estimate if nodes move along z
/// only, and mid-range otherwise.
fn start_of((model, scene): (&SensorModel, &Scene), row: usize) -> Program {
    let ranges = ranges(model, scene);
    let channels = model.scale.columns();
    if scene.movement.axes() == Axes::Z {
        return AffineStart::new(model, row, ranges[0]).program(model, row);
    }
    let nodes = 0..model.scale.nodes_per_row();
    let middles = nodes.zip(ranges.chunks_exact(3)).flat_map(|(node, ranges)| {
        let middle = DVec3::new(ranges[0].middle(), ranges[1].middle(), ranges[2].middle());
        model.displaced_mm(row, node, middle).to_array()
    });
    Program::constant(channels, &Vec::from_iter(middles))
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
            // Most row-wires tried are not the right one, and no restart helps them.
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

    fn description(&self) -> Result<Description, NotDescribed> {
        let (rows, row_choice) = self.search.description();
        let (readings, unknowns) = (self.channels(), self.newton.unknowns());
        if readings <= unknowns && unknowns > 1 {
            return Err(NotDescribed::Undetermined { readings, unknowns });
        }
        let of_scene = (&self.model, &self.scene);
        Ok(Description {
            program: Program::each(&PerRow::each(rows.iter().map(|&row| start_of(of_scene, row)).collect())),
            equations: Some(RowProblemDescription::new(
                of_scene,
                (rows, row_choice),
                self.rules,
                true,
            )),
        })
    }
}

/// Decoders that solve the rows of a frame side by side by plain steps, and the remaining rows one by one with
/// damping.
pub(super) trait PlainFirst: Decoder {
    /// Solves at most [`LANES`] rows from index `first` on, by plain steps; returns the status of the solved ones.
    /// Leaves the targets of all others unchanged.
    fn answer_plainly(&mut self, first: usize, readings: &[f64], targets: &mut [f64]) -> [Option<Solution>; LANES];

    /// Solves one row with damping and restarts; returns its status.
    ///
    /// # Errors
    /// If a reading is not a resistance.
    fn answer(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<Solution, DecodeError>;

    /// Returns the rows counted so far.
    fn solved(&mut self) -> &mut SolvedRows;

    /// Solves all rows of a frame.
    ///
    /// # Errors
    /// If a reading is not a resistance; the error names the row.
    ///
    /// # Panics
    /// If the numbers of rows of targets and readings differ.
    fn answer_all(&mut self, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        let (channels, outputs) = (self.channels(), self.outputs());
        assert_eq!(readings.len() / channels, targets.len() / outputs);
        for (row_index, readings) in readings.chunks_exact(channels).enumerate() {
            DecodeError::check(readings).map_err(|error| DecodeError { row_index, ..error })?;
        }
        let chunks = readings
            .chunks(LANES * channels)
            .zip(targets.chunks_mut(LANES * outputs));
        for (chunk, (readings, targets)) in chunks.enumerate() {
            let first = chunk * LANES;
            let plain = self.answer_plainly(first, readings, targets);
            let rows = readings.chunks_exact(channels).zip(targets.chunks_exact_mut(outputs));
            for (place, ((readings, targets), plain)) in rows.zip(plain).enumerate() {
                let row_index = first + place;
                let solution = match plain {
                    Some(solution) => solution,
                    None => self
                        .answer(row_index, readings, targets)
                        .map_err(|error| DecodeError { row_index, ..error })?,
                };
                self.solved().count(solution);
            }
        }
        Ok(())
    }
}

/// Decodes every row of a frame by the Gauss-Newton method with noise and prior. If rows are not known, the most
/// probable row-wire is used: the one with the largest evidence under the noise of the scene.
#[derive(Clone, Debug)]
pub struct PosteriorDecoder {
    posterior: Posterior,
    search: RowSearch,
    /// With noise, no answer is fully determined, which is not reported.
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

    /// Solves rows side by side, each with the index of its own row-wire; returns the status of the answers.
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
        Ok(taken.into_iter().map(|report| self.status(report)).collect())
    }

    fn status(&self, report: Option<PosteriorReport>) -> Solution {
        match report {
            Some(report) if report.converged => {
                if self.is_noisy || report.determined && report.residual < EXPLAINED {
                    Solution::Unique
                } else if report.determined {
                    // The readings determine the answer, but it does not explain them.
                    Solution::None
                } else {
                    Solution::Undetermined
                }
            }
            _ => Solution::None,
        }
    }

    /// Solves one row; returns the status of the answer.
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
