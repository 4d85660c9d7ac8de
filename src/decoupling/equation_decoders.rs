use super::{
    DecodeError, Decoder, SolvedRows,
    newton::Newton,
    newton_report::{NewtonReport, NewtonRules, Solution},
    posterior::{Posterior, PosteriorReport},
};
use crate::{
    scene::{NoiseSource, RowModel, Scene},
    sensor::{ArrayScale, SensorError, SensorModel},
};

/// Finds the row-wire of each row of a frame by trial, where the scene's decoders are not told.
#[derive(Clone, Debug)]
struct RowSearch {
    scale: ArrayScale,
    /// Row-wires read.
    rows: Vec<usize>,
    /// Logarithms of the resistances of each of `rows` at rest; empty if rows are known.
    rest: Vec<Vec<f64>>,
    /// x of those of `rows` that another one equals in all readings; empty if rows are known.
    twins_x_mm: Vec<f64>,
    trial_mm: Vec<f64>,
}

/// Relative misfit (root mean square) below which a row-wire is accepted without trying the others.
const EXPLAINED: f64 = 1e-10;
/// Difference of the logarithms of resistances at rest below which row-wires mirror each other.
const SAME_AT_REST: f64 = 1e-13;
/// Ratio of the misfit to the noise above which noise does not explain it.
const NOISES: f64 = 6.0;

impl RowSearch {
    fn new(model: &SensorModel, scene: &Scene, rows: &[usize]) -> Result<Self, SensorError> {
        let at_rest = vec![glam::DVec3::ZERO; model.scale.nodes_per_row()];
        let rest = |&row: &usize| {
            let readings = model.row_resistances(row, &at_rest)?;
            Ok(readings.into_iter().map(f64::ln).collect())
        };
        let searched = match scene.rows.model() {
            RowModel::Each => &[],
            RowModel::Shared => rows,
        };
        let rest = searched
            .iter()
            .map(rest)
            .collect::<Result<Vec<Vec<f64>>, SensorError>>()?;
        let is_same = |a: &Vec<f64>, b: &Vec<f64>| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= SAME_AT_REST);
        let has_twin = |index: &usize| rest.iter().filter(|other| is_same(&rest[*index], other)).count() > 1;
        let twins = (0..rest.len()).filter(has_twin);
        Ok(Self {
            scale: model.scale,
            twins_x_mm: twins.map(|index| model.geometry.row_x_mm(rows[index])).collect(),
            rest,
            rows: rows.to_vec(),
            trial_mm: vec![0.0; model.scale.coordinates_per_row()],
        })
    }

    /// Returns `true` if rows are not known.
    fn is_needed(&self) -> bool {
        !self.rest.is_empty()
    }

    /// Returns `true` if another row-wire than the one of these coordinates may have the same readings: its mirror image,
    /// or any at another height if all electrodes of a column-wire have the same x.
    fn has_twin(&self, coordinates_mm: &[f64]) -> bool {
        self.rest.len() > 1 && self.scale.nodes_per_column() == 1 || self.twins_x_mm.contains(&coordinates_mm[0])
    }

    /// Solves one row with `solve`, which solves for a given row-wire and returns the root mean square relative misfit.
    ///
    /// If rows are not known, row-wires are tried in the order of similarity of their readings at rest, and the one
    /// that fits the readings best is taken; rows that mirror each other may then be confused.
    fn solve(
        &mut self,
        row_index: usize,
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
        mut solve: impl FnMut(usize, &[f64], &mut [f64]) -> Result<f64, DecodeError>,
    ) -> Result<(), DecodeError> {
        DecodeError::check(readings_ohm)?;
        if self.rest.is_empty() {
            return solve(self.rows[row_index], readings_ohm, coordinates_mm).map(drop);
        }
        let unlike = |rest: &Vec<f64>| -> f64 {
            let differences = rest.iter().zip(readings_ohm).map(|(rest, ohm)| ohm.ln() - rest);
            differences.map(|difference| difference * difference).sum()
        };
        let mut order: Vec<(f64, usize)> = self.rest.iter().map(unlike).zip(self.rows.iter().copied()).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut least = f64::INFINITY;
        for (_, row_wire) in order {
            let residual = solve(row_wire, readings_ohm, &mut self.trial_mm)?;
            if residual < least {
                least = residual;
                coordinates_mm.copy_from_slice(&self.trial_mm);
            }
            if least < EXPLAINED {
                break;
            }
        }
        Ok(())
    }
}

/// Decodes every row of a frame by the Gauss-Newton method. If rows are not known, the one that fits the readings best
/// is taken.
#[derive(Clone, Debug)]
pub struct NewtonDecoder {
    newton: Newton,
    search: RowSearch,
    /// Rules that give each row-wire one start.
    brief: NewtonRules,
    rules: NewtonRules,
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
            solved: SolvedRows::default(),
        })
    }

    /// Solves one row by `rules`; returns the standing of the answer for the row-wire that fits best.
    fn solve(
        &mut self,
        rules: NewtonRules,
        row_index: usize,
        readings: &[f64],
        targets: &mut [f64],
    ) -> Result<Solution, DecodeError> {
        let newton = &mut self.newton;
        newton.set_rules(rules);
        let mut best: Option<NewtonReport> = None;
        self.search
            .solve(row_index, readings, targets, |row, readings, coordinates| {
                let report = newton.solve(row, readings, coordinates)?;
                if best.is_none_or(|best| report.residual < best.residual) {
                    best = Some(report);
                }
                Ok(match report.solution {
                    Solution::None => report.residual.max(EXPLAINED),
                    Solution::Unique | Solution::Undetermined => report.residual.min(0.5 * EXPLAINED),
                })
            })?;
        Ok(best.map_or(Solution::None, |best| best.solution))
    }
}

impl Decoder for NewtonDecoder {
    fn channels(&self) -> usize {
        self.search.scale.columns()
    }

    fn outputs(&self) -> usize {
        self.search.scale.coordinates_per_row()
    }

    fn decode_row(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        let mut solution = Solution::None;
        if self.search.is_needed() {
            // Most row-wires tried are not the right one, and no start helps them.
            solution = self.solve(self.brief, row_index, readings, targets)?;
        }
        if solution == Solution::None {
            solution = self.solve(self.rules, row_index, readings, targets)?;
        }
        if solution == Solution::Unique && self.search.has_twin(targets) {
            solution = Solution::Undetermined;
        }
        self.solved.count(solution);
        Ok(())
    }

    fn take_solved_rows(&mut self) -> SolvedRows {
        std::mem::take(&mut self.solved)
    }
}

/// Decodes every row of a frame by the Gauss-Newton method with noise and prior. If rows are not known, the one that
/// fits the readings best is taken.
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
}

impl Decoder for PosteriorDecoder {
    fn channels(&self) -> usize {
        self.search.scale.columns()
    }

    fn outputs(&self) -> usize {
        self.search.scale.coordinates_per_row()
    }

    fn decode_row(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        let posterior = &mut self.posterior;
        let mut best: Option<PosteriorReport> = None;
        self.search
            .solve(row_index, readings, targets, |row, readings, coordinates| {
                let report = posterior.solve(row, readings, coordinates)?;
                if best.is_none_or(|best| report.residual < best.residual) {
                    best = Some(report);
                }
                Ok(report.residual)
            })?;
        self.solved.count(match best {
            Some(report) if report.converged && (report.determined || self.is_noisy) => Solution::Unique,
            Some(report) if report.converged => Solution::Undetermined,
            _ => Solution::None,
        });
        Ok(())
    }

    fn take_solved_rows(&mut self) -> SolvedRows {
        std::mem::take(&mut self.solved)
    }
}

/// Improves the answer of another decoder by a few Gauss-Newton steps, with noise and prior if the scene has noise.
pub struct PolishedDecoder {
    first: Box<dyn Decoder>,
    model: SensorModel,
    improvement: Improvement,
    rows: Vec<usize>,
    row_model: RowModel,
    steps: usize,
    solved: SolvedRows,
}

/// Method of improving an answer.
enum Improvement {
    /// Without noise.
    Newton(Box<Newton>),
    /// With noise: the posterior, and the noise by which the misfit is judged.
    Posterior(Box<Posterior>, Option<NoiseSource>),
}

impl PolishedDecoder {
    /// Creates a decoder that takes `steps` steps after `first`, for `rows` of `model` in `scene`, which must be among
    /// the rows of `posterior`. If rows are not known, the row-wire nearest to the first answer is taken.
    pub fn new(
        first: Box<dyn Decoder>,
        posterior: Posterior,
        model: &SensorModel,
        scene: &Scene,
        rows: &[usize],
        steps: usize,
    ) -> Self {
        let noise = scene.noise.in_test();
        let rules = NewtonRules {
            steps,
            ..NewtonRules::default()
        };
        Self {
            first,
            model: *model,
            improvement: if noise.is_none() {
                Improvement::Newton(Box::new(Newton::new(model, scene, rules)))
            } else {
                Improvement::Posterior(Box::new(posterior), noise.source(model).ok())
            },
            rows: rows.to_vec(),
            row_model: scene.rows.model(),
            steps,
            solved: SolvedRows::default(),
        }
    }

    /// Improves the answer in `targets`; returns its standing.
    fn improve(&mut self, row_wire: usize, readings: &[f64], targets: &mut [f64]) -> Result<Solution, DecodeError> {
        match &mut self.improvement {
            Improvement::Newton(newton) => Ok(newton.polish(row_wire, readings, targets)?.solution),
            Improvement::Posterior(posterior, noise) => {
                let report = posterior.polish(row_wire, readings, targets, self.steps)?;
                let variance = |&ohm: &f64| {
                    noise
                        .as_ref()
                        .map_or(0.0, |noise| noise.relative_to(ohm).total().powi(2))
                };
                let variance = readings.iter().map(variance).sum::<f64>() / readings.len() as f64;
                // Readings that noise explains are all that a posterior can ask for.
                Ok(if report.residual <= NOISES * variance.sqrt() {
                    Solution::Unique
                } else {
                    Solution::None
                })
            }
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

impl Decoder for PolishedDecoder {
    fn channels(&self) -> usize {
        self.first.channels()
    }

    fn outputs(&self) -> usize {
        self.first.outputs()
    }

    fn decode_row(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        self.first.decode_row(row_index, readings, targets)?;
        let row_wire = match self.row_model {
            RowModel::Each => self.rows[row_index],
            RowModel::Shared => self.nearest_row(targets),
        };
        let solution = self.improve(row_wire, readings, targets)?;
        self.solved.count(solution);
        Ok(())
    }

    fn take_solved_rows(&mut self) -> SolvedRows {
        std::mem::take(&mut self.solved)
    }
}

#[cfg(test)]
mod tests;
