use glam::DVec3;

use super::{check, solve_in_blocks};
use crate::{
    dataset::PerRow,
    decoupling::{
        DecodeError, Decoder, Description, Estimate, Estimator, NotDescribed, Program, RowChoice,
        RowProblemDescription, Solution, SolvedRows, affine_map::AffineStart, ranges,
    },
    scene::{RowModel, Scene},
    sensor::{Axes, SensorError, SensorModel},
};

/// Decodes every row of a frame by the [`Estimator`], with the noise and the prior of the scene. If rows are not known,
/// the row-wire that explains the readings best is used.
#[derive(Clone, Debug)]
pub struct NewtonDecoder {
    model: SensorModel,
    scene: Scene,
    rows: Vec<usize>,
    solver: Solver,
    /// Row-wires of the rows that are being decoded.
    row_wires: Vec<usize>,
    solved: SolvedRows,
}

#[derive(Clone, Debug)]
struct Solver {
    estimator: Estimator,
    /// Row-wires among which that of a reading is searched, with the logarithms of their resistances at rest; empty if
    /// it is known.
    searched: Vec<(usize, Vec<f64>)>,
    trial_mm: Vec<f64>,
}

impl NewtonDecoder {
    /// Creates a decoder for `rows` of `model` in `scene`.
    ///
    /// # Errors
    /// If the sensor has no resistances at rest.
    pub fn new(model: &SensorModel, scene: &Scene, rows: &[usize]) -> Result<Self, SensorError> {
        let at_rest = vec![DVec3::ZERO; model.scale.nodes_per_row()];
        let searched = match scene.rows.model() {
            RowModel::Each => &[],
            RowModel::Shared => rows,
        };
        let searched = searched.iter().map(|&row| {
            let readings = model.row_resistances(row, &at_rest)?;
            Ok((row, readings.into_iter().map(f64::ln).collect()))
        });
        Ok(Self {
            model: *model,
            scene: *scene,
            rows: rows.to_vec(),
            solver: Solver {
                estimator: Estimator::new(model, scene, rows)?,
                searched: searched.collect::<Result<_, SensorError>>()?,
                trial_mm: vec![0.0; model.scale.coordinates_per_row()],
            },
            row_wires: Vec::new(),
            solved: SolvedRows::default(),
        })
    }

    /// Coordinates of the nodes of a row-wire at the start of the iteration: the affine estimate if nodes move along z
    /// only, and mid-range otherwise.
    fn start_of(&self, row: usize) -> Program {
        let ranges = ranges(&self.model, &self.scene);
        let channels = self.model.scale.columns();
        if self.scene.movement.axes() == Axes::Z {
            return AffineStart::new(&self.model, row, ranges[0]).program(&self.model, row);
        }
        let nodes = 0..self.model.scale.nodes_per_row();
        let middles = nodes.zip(ranges.chunks_exact(3)).flat_map(|(node, ranges)| {
            let middle = DVec3::new(ranges[0].middle(), ranges[1].middle(), ranges[2].middle());
            self.model.displaced_mm(row, node, middle).to_array()
        });
        Program::constant(channels, &Vec::from_iter(middles))
    }
}

impl Solver {
    /// Solves rows of these row-wires, or of those that explain their readings best if rows are not known.
    fn solve_rows(&mut self, row_wires: &[usize], readings_ohm: &[f64], coordinates_mm: &mut [f64]) -> SolvedRows {
        if self.searched.is_empty() {
            return self.estimator.solve_rows(row_wires, readings_ohm, coordinates_mm, None);
        }
        let mut solved = SolvedRows::default();
        let rows = readings_ohm.chunks_exact(readings_ohm.len() / row_wires.len());
        for (readings_ohm, coordinates_mm) in rows.zip(coordinates_mm.chunks_exact_mut(self.trial_mm.len())) {
            solved.count(self.search(readings_ohm, coordinates_mm).solution);
        }
        solved
    }

    /// Tries row-wires in order of similarity with their readings at rest: the first that explains exact readings, or the
    /// one of the highest evidence under the noise. Rows that mirror each other may be confused.
    fn search(&mut self, readings_ohm: &[f64], coordinates_mm: &mut [f64]) -> Estimate {
        let unlike = |rest: &[f64]| -> f64 {
            let differences = rest.iter().zip(readings_ohm).map(|(rest, ohm)| ohm.ln() - rest);
            differences.map(|difference| difference * difference).sum()
        };
        let mut order: Vec<(f64, usize)> = self.searched.iter().map(|(row, rest)| (unlike(rest), *row)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let is_exact = self.estimator.is_exact();
        for &(_, row) in &order {
            let found = self.estimator.try_plainly(row, readings_ohm, coordinates_mm);
            if let Some(found) = found.filter(|found| found.solution != Solution::None) {
                return found;
            }
        }
        let mut chosen: Option<(f64, usize, Estimate)> = None;
        for (_, row) in order {
            let found = self.estimator.try_row(row, readings_ohm, &mut self.trial_mm);
            let is_enough = is_exact && found.solution != Solution::None;
            let score = if is_exact { found.residual } else { found.surprise };
            // Written so that NaN is replaced.
            if is_enough || !chosen.is_some_and(|(lowest, ..)| lowest <= score) {
                chosen = Some((score, row, found));
                coordinates_mm.copy_from_slice(&self.trial_mm);
            }
            if is_enough {
                break;
            }
        }
        let (_, row, found) = chosen.expect("a decoder has at least one row");
        if found.solution == Solution::None || is_exact && found.is_open() {
            return self.estimator.search(row, readings_ohm, coordinates_mm);
        }
        found
    }
}

impl Decoder for NewtonDecoder {
    fn channels(&self) -> usize {
        self.model.scale.columns()
    }

    fn outputs(&self) -> usize {
        self.model.scale.coordinates_per_row()
    }

    fn decode_row(&mut self, row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        self.decode_rows(&[row_index], readings, targets)
    }

    fn decode(&mut self, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        check(readings, self.channels())?;
        let rows = &self.rows[..readings.len() / self.channels()];
        assert_eq!(rows.len(), targets.len() / self.outputs());
        let solved = solve_in_blocks(&mut self.solver, rows, readings, targets, Solver::solve_rows);
        self.solved += solved;
        Ok(())
    }

    fn decode_rows(&mut self, row_indices: &[usize], readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        let rows = row_indices.len();
        assert_eq!(
            (readings.len(), targets.len()),
            (rows * self.channels(), rows * self.outputs())
        );
        check(readings, self.channels())?;
        self.row_wires.clear();
        self.row_wires.extend(row_indices.iter().map(|&index| self.rows[index]));
        let solved = solve_in_blocks(&mut self.solver, &self.row_wires, readings, targets, Solver::solve_rows);
        self.solved += solved;
        Ok(())
    }

    fn take_solved_rows(&mut self) -> SolvedRows {
        std::mem::take(&mut self.solved)
    }

    fn description(&self) -> Result<Description, NotDescribed> {
        if !self.solver.estimator.is_exact() {
            return Err(NotDescribed::Posterior);
        }
        let (readings, unknowns) = (self.channels(), self.solver.estimator.unknowns());
        if readings <= unknowns && unknowns > 1 {
            return Err(NotDescribed::Undetermined { readings, unknowns });
        }
        let row_choice = match &self.solver.searched[..] {
            [] => RowChoice::Given,
            searched => RowChoice::Tried {
                rest: searched.iter().map(|(_, rest)| rest.clone()).collect(),
            },
        };
        let of_scene = (&self.model, &self.scene);
        Ok(Description {
            program: Program::each(&PerRow::each(self.rows.iter().map(|&row| self.start_of(row)).collect())),
            equations: Some(RowProblemDescription::new(of_scene, (&self.rows, row_choice), None)),
        })
    }
}
