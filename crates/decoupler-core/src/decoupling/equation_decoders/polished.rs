use super::{check, solve_in_blocks};
use crate::{
    decoupling::{
        DecodeError, Decoder, Description, Estimator, NotDescribed, RowChoice, RowProblemDescription, SolvedRows,
    },
    scene::{RowModel, Scene},
    sensor::{SensorError, SensorModel},
};

/// Improves the answer of another decoder by a few steps of the [`Estimator`], with the noise and the prior of the scene.
pub struct PolishedDecoder {
    first: Box<dyn Decoder>,
    model: SensorModel,
    scene: Scene,
    estimator: Estimator,
    rows: Vec<usize>,
    row_wires: Vec<usize>,
    steps: usize,
    solved: SolvedRows,
}

impl PolishedDecoder {
    /// Creates a decoder that takes at most `steps` steps after `first`, for `rows` of `model` in `scene`. If rows are not
    /// known, the row-wire nearest to the first answer is used.
    ///
    /// # Errors
    /// If the sensor has no resistances at rest.
    pub fn new(
        first: Box<dyn Decoder>,
        model: &SensorModel,
        scene: &Scene,
        rows: &[usize],
        steps: usize,
    ) -> Result<Self, SensorError> {
        Ok(Self {
            first,
            model: *model,
            scene: *scene,
            estimator: Estimator::new(model, scene, rows)?,
            rows: rows.to_vec(),
            row_wires: Vec::new(),
            steps,
            solved: SolvedRows::default(),
        })
    }

    /// Improves the first answers in `targets` (rows × outputs).
    fn polish(&mut self, row_indices: impl Iterator<Item = usize>, readings: &[f64], targets: &mut [f64]) {
        let mut row_wires = std::mem::take(&mut self.row_wires);
        row_wires.clear();
        let answers = row_indices.zip(targets.chunks_exact(self.first.outputs()));
        row_wires.extend(answers.map(|(index, answer_mm)| self.row_wire(index, answer_mm)));
        let steps = Some(self.steps);
        let solve = |estimator: &mut Estimator, rows: &[usize], readings: &[f64], targets: &mut [f64]| {
            estimator.solve_rows(rows, readings, targets, steps)
        };
        self.solved += solve_in_blocks(&mut self.estimator, &row_wires, readings, targets, solve);
        self.row_wires = row_wires;
    }

    /// Returns the row-wire of this first answer: the known one, or that whose x is nearest to the mean x of the answer.
    fn row_wire(&self, row_index: usize, coordinates_mm: &[f64]) -> usize {
        match self.scene.rows.model() {
            RowModel::Each => self.rows[row_index],
            RowModel::Shared => {
                let x_mm = coordinates_mm.iter().step_by(3).sum::<f64>() / (coordinates_mm.len() / 3) as f64;
                let distance = |row: usize| (self.model.geometry.row_x_mm(row) - x_mm).abs();
                let rows = self.rows.iter().copied();
                rows.min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap_or(0)
            }
        }
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
        check(readings, self.channels())?;
        self.first.decode_row(row_index, readings, targets)?;
        self.polish([row_index].into_iter(), readings, targets);
        Ok(())
    }

    fn decode(&mut self, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        check(readings, self.channels())?;
        self.first.decode(readings, targets)?;
        self.polish(0..readings.len() / self.channels(), readings, targets);
        Ok(())
    }

    fn decode_rows(&mut self, row_indices: &[usize], readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        check(readings, self.channels())?;
        self.first.decode_rows(row_indices, readings, targets)?;
        self.polish(row_indices.iter().copied(), readings, targets);
        Ok(())
    }

    fn take_solved_rows(&mut self) -> SolvedRows {
        std::mem::take(&mut self.solved)
    }

    fn description(&self) -> Result<Description, NotDescribed> {
        if !self.estimator.is_exact() {
            return Err(NotDescribed::Posterior);
        }
        let row_choice = match self.scene.rows.model() {
            RowModel::Each => RowChoice::Given,
            RowModel::Shared => RowChoice::Nearest,
        };
        let of_scene = (&self.model, &self.scene);
        Ok(Description {
            program: self.first.description()?.program,
            equations: Some(RowProblemDescription::new(
                of_scene,
                (&self.rows, row_choice),
                Some(self.steps),
            )),
        })
    }
}
