use rand::Rng;

use super::{
    newton::PlainFirst,
    row_search::{EXPLAINED, RowTwins, rest_of_searched},
};
use crate::{
    decoupling::{
        DecodeError, Decoder, Description, Newton, NewtonRules, NotDescribed, Posterior, PosteriorReport, RowChoice,
        RowProblemDescription, Solution, SolvedRows, side_by_side::LANES,
    },
    scene::{NoiseSource, RowModel, Scene},
    sensor::{SensorError, SensorModel},
};

/// Maximum ratio of misfit to noise that noise explains.
const MAX_NOISE_RATIO: f64 = 6.0;

/// Improves the answer of another decoder by a few Gauss-Newton steps, with noise and prior if the scene has noise.
pub struct PolishedDecoder {
    first: Box<dyn Decoder>,
    model: SensorModel,
    scene: Scene,
    improvement: Improvement,
    rows: Vec<usize>,
    row_model: RowModel,
    twins: RowTwins,
    steps: usize,
    solved: SolvedRows,
}

/// Method of improving an answer.
enum Improvement {
    /// Without noise.
    Newton(Box<Newton>),
    /// With noise: the posterior, and the noise with which the misfit is compared.
    Posterior(Box<Posterior>, NoiseSource),
}

impl PolishedDecoder {
    /// Creates a decoder that takes `steps` steps after `first`, for `rows` of `model` in `scene`. If rows are not
    /// known, the row-wire nearest to the first answer is used. `rng` draws the samples that estimate a prior without
    /// closed form.
    ///
    /// # Errors
    /// If the sensor has no resistances at rest.
    pub fn new(
        first: Box<dyn Decoder>,
        model: &SensorModel,
        scene: &Scene,
        rows: &[usize],
        steps: usize,
        rng: &mut impl Rng,
    ) -> Result<Self, SensorError> {
        let noise = scene.noise.in_test();
        let improvement = if noise.is_none() {
            let rules = NewtonRules {
                steps,
                ..NewtonRules::default()
            };
            Improvement::Newton(Box::new(Newton::new(model, scene, rules)))
        } else {
            Improvement::Posterior(Box::new(Posterior::new(model, scene, rows, rng)?), noise.source(model)?)
        };
        Ok(Self {
            first,
            model: *model,
            scene: *scene,
            improvement,
            rows: rows.to_vec(),
            row_model: scene.rows.model(),
            twins: RowTwins::of(model, scene, rows, &rest_of_searched(model, scene, rows)?),
            steps,
            solved: SolvedRows::default(),
        })
    }

    /// Returns the row-wire that belongs to this first answer.
    fn row_wire(&self, row_index: usize, coordinates_mm: &[f64]) -> usize {
        match self.row_model {
            RowModel::Each => self.rows[row_index],
            RowModel::Shared => self.nearest_row(coordinates_mm),
        }
    }

    /// Returns the row-wire whose x is nearest to the mean x of the coordinates.
    fn nearest_row(&self, coordinates_mm: &[f64]) -> usize {
        let x_mm = coordinates_mm.iter().step_by(3).sum::<f64>() / (coordinates_mm.len() / 3) as f64;
        let distance = |row: usize| (self.model.geometry.row_x_mm(row) - x_mm).abs();
        let nearest = self
            .rows
            .iter()
            .copied()
            .min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
        nearest.unwrap_or(0)
    }
}

/// Status of an answer to readings with this noise: with a posterior, an answer is reliable if noise explains its
/// misfit. The residual is independent of the gain, and so is the noise that it is compared with.
fn status_with_noise(noise: &NoiseSource, readings: &[f64], report: PosteriorReport) -> Solution {
    let variance = |&ohm: &f64| noise.relative_to(ohm).own.powi(2);
    let variance = readings.iter().map(variance).sum::<f64>() / readings.len() as f64;
    if report.residual <= MAX_NOISE_RATIO * variance.sqrt().max(EXPLAINED) {
        Solution::Unique
    } else {
        Solution::None
    }
}

impl PlainFirst for PolishedDecoder {
    fn answer_plainly(&mut self, first: usize, readings: &[f64], targets: &mut [f64]) -> [Option<Solution>; LANES] {
        let mut row_wires = [0; LANES];
        let first_answers = targets.chunks_exact(self.first.outputs()).enumerate();
        let count = first_answers.len();
        for (place, coordinates_mm) in first_answers {
            row_wires[place] = self.row_wire(first + place, coordinates_mm);
        }
        match &mut self.improvement {
            Improvement::Newton(newton) => {
                let reports = newton.polish_plainly(&row_wires[..count], readings, targets);
                let mut statuses = reports.map(|report| Some(report?.solution));
                let answers = targets.chunks_exact(self.first.outputs());
                for (status, coordinates_mm) in statuses.iter_mut().zip(answers) {
                    *status = status.map(|solution| self.twins.unless_twin(solution, coordinates_mm));
                }
                statuses
            }
            Improvement::Posterior(posterior, noise) => {
                let reports = posterior.polish_rows(&row_wires[..count], readings, targets, self.steps);
                let mut statuses = [None; LANES];
                let rows = readings
                    .chunks_exact(readings.len() / count)
                    .zip(reports.into_iter().flatten());
                for (status, (readings, report)) in statuses.iter_mut().zip(rows) {
                    *status = Some(status_with_noise(noise, readings, report));
                }
                statuses
            }
        }
    }

    fn answer(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<Solution, DecodeError> {
        let row_wire = self.row_wire(row_index, targets);
        match &mut self.improvement {
            Improvement::Newton(newton) => {
                let solution = newton.polish(row_wire, readings, targets)?.solution;
                Ok(self.twins.unless_twin(solution, targets))
            }
            Improvement::Posterior(posterior, noise) => {
                let report = posterior.polish(row_wire, readings, targets, self.steps)?;
                Ok(status_with_noise(noise, readings, report))
            }
        }
    }

    fn solved(&mut self) -> &mut SolvedRows {
        &mut self.solved
    }
}

impl Decoder for PolishedDecoder {
    fn channels(&self) -> usize {
        self.first.channels()
    }

    fn outputs(&self) -> usize {
        self.first.outputs()
    }

    fn decode_row(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        self.first.decode_row(row_index, readings, targets)?;
        let solution = self.answer(row_index, readings, targets)?;
        self.solved.count(solution);
        Ok(())
    }

    fn decode(&mut self, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        self.first.decode(readings, targets)?;
        self.answer_all(readings, targets)
    }

    fn take_solved_rows(&mut self) -> SolvedRows {
        std::mem::take(&mut self.solved)
    }

    fn description(&self) -> Result<Description, NotDescribed> {
        if let Improvement::Posterior(..) = self.improvement {
            return Err(NotDescribed::Posterior);
        }
        let rules = NewtonRules {
            steps: self.steps,
            ..NewtonRules::default()
        };
        let row_choice = match self.row_model {
            RowModel::Each => RowChoice::Given,
            RowModel::Shared => RowChoice::Nearest,
        };
        let of_scene = (&self.model, &self.scene);
        Ok(Description {
            program: self.first.description()?.program,
            equations: Some(RowProblemDescription::new(
                of_scene,
                (&self.rows, row_choice),
                rules,
                false,
            )),
        })
    }
}
