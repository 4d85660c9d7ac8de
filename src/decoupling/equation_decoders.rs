use super::{
    frame::{DecodeError, FrameDecoder},
    newton::{Newton, NewtonError, NewtonRules},
    posterior::Posterior,
};
use crate::{scene::Scene, sensor::SensorModel};

/// Newton's method on every row of a frame.
///
/// Where rows are not known, every row-wire is tried and the one that explains the readings best is taken: rows that
/// mirror each other then come back as either of them.
#[derive(Clone, Debug)]
pub struct NewtonDecoder {
    newton: Newton,
    rows: Vec<usize>,
    known: bool,
    trial_mm: Vec<f64>,
}

impl NewtonDecoder {
    /// For `rows` of `model` in `scene`.
    pub fn new(model: &SensorModel, scene: &Scene, rows: &[usize], rules: NewtonRules) -> Self {
        Self {
            newton: Newton::new(model, scene, rules),
            rows: rows.to_vec(),
            known: scene.rows.are_known(),
            trial_mm: vec![0.0; model.scale.coordinates_per_row()],
        }
    }
}

impl FrameDecoder for NewtonDecoder {
    fn decode(&mut self, readings_ohm: &[f64], coordinates_mm: &mut [f64]) -> Result<(), DecodeError> {
        DecodeError::check(readings_ohm)?;
        let readings = readings_ohm.chunks_exact(readings_ohm.len() / self.rows.len());
        let coordinates = coordinates_mm.chunks_exact_mut(self.trial_mm.len());
        for (place, (readings, coordinates)) in readings.zip(coordinates).enumerate() {
            if self.known {
                self.newton
                    .solve(self.rows[place], readings, coordinates)
                    .map_err(in_frame(place, readings))?;
                continue;
            }
            let mut least = f64::INFINITY;
            for &row in &self.rows {
                let report = self
                    .newton
                    .solve(row, readings, &mut self.trial_mm)
                    .map_err(in_frame(place, readings))?;
                if report.residual < least {
                    least = report.residual;
                    coordinates.copy_from_slice(&self.trial_mm);
                }
            }
        }
        Ok(())
    }
}

/// Another decoder's answer, improved by a few steps of Newton's method.
pub struct PolishedDecoder {
    first: Box<dyn FrameDecoder>,
    model: SensorModel,
    newton: Newton,
    rows: Vec<usize>,
    known: bool,
}

impl PolishedDecoder {
    /// `steps` steps after `first`, for `rows` of `model` in `scene`. Where rows are not known, the row-wire nearest to
    /// the first answer is taken.
    pub fn new(first: Box<dyn FrameDecoder>, model: &SensorModel, scene: &Scene, rows: &[usize], steps: usize) -> Self {
        let rules = NewtonRules {
            steps,
            ..NewtonRules::default()
        };
        Self {
            first,
            model: *model,
            newton: Newton::new(model, scene, rules),
            rows: rows.to_vec(),
            known: scene.rows.are_known(),
        }
    }

    /// The row-wire whose x is nearest to the mean of the coordinates.
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

impl FrameDecoder for PolishedDecoder {
    fn decode(&mut self, readings_ohm: &[f64], coordinates_mm: &mut [f64]) -> Result<(), DecodeError> {
        self.first.decode(readings_ohm, coordinates_mm)?;
        let readings = readings_ohm.chunks_exact(readings_ohm.len() / self.rows.len());
        let coordinates = coordinates_mm.chunks_exact_mut(self.model.scale.coordinates_per_row());
        for (place, (readings, coordinates)) in readings.zip(coordinates).enumerate() {
            let row = if self.known {
                self.rows[place]
            } else {
                self.nearest_row(coordinates)
            };
            self.newton
                .polish(row, readings, coordinates)
                .map_err(in_frame(place, readings))?;
        }
        Ok(())
    }
}

/// Newton's method with noise and prior on every row of a frame, for known rows.
#[derive(Clone, Debug)]
pub struct PosteriorDecoder {
    posterior: Posterior,
    rows: Vec<usize>,
    coordinates_per_row: usize,
}

impl PosteriorDecoder {
    /// Decodes `rows`, which must be among those that `posterior` was made for.
    pub fn new(posterior: Posterior, model: &SensorModel, rows: &[usize]) -> Self {
        Self {
            posterior,
            rows: rows.to_vec(),
            coordinates_per_row: model.scale.coordinates_per_row(),
        }
    }
}

impl FrameDecoder for PosteriorDecoder {
    fn decode(&mut self, readings_ohm: &[f64], coordinates_mm: &mut [f64]) -> Result<(), DecodeError> {
        DecodeError::check(readings_ohm)?;
        let readings = readings_ohm.chunks_exact(readings_ohm.len() / self.rows.len());
        let coordinates = coordinates_mm.chunks_exact_mut(self.coordinates_per_row);
        for (place, (readings, coordinates)) in readings.zip(coordinates).enumerate() {
            self.posterior
                .solve(self.rows[place], readings, coordinates)
                .map_err(in_frame(place, readings))?;
        }
        Ok(())
    }
}

/// The place in the frame of a reading refused in its row.
fn in_frame(place: usize, readings: &[f64]) -> impl FnOnce(NewtonError) -> DecodeError {
    let before = place * readings.len();
    move |NewtonError::Reading { column, value }| DecodeError {
        index: before + column,
        value,
    }
}
