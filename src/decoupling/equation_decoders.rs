use super::{DecodeError, Decoder, newton::Newton, newton_report::NewtonRules, posterior::Posterior};
use crate::{
    scene::{RowModel, Scene},
    sensor::{ArrayScale, SensorError, SensorModel},
};

/// The row-wire of each row of a frame, found by trying where the scene's decoders are not told.
#[derive(Clone, Debug)]
struct RowSearch {
    scale: ArrayScale,
    /// The row-wires read.
    rows: Vec<usize>,
    /// ln R of each of `rows` at rest; empty where rows are known.
    rest: Vec<Vec<f64>>,
    trial_mm: Vec<f64>,
}

/// An answer whose readings are explained to this relative error (rms) is the right row's: others are not tried.
const EXPLAINED: f64 = 1e-10;

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
        Ok(Self {
            scale: model.scale,
            rest: searched.iter().map(rest).collect::<Result<_, SensorError>>()?,
            rows: rows.to_vec(),
            trial_mm: vec![0.0; model.scale.coordinates_per_row()],
        })
    }

    /// Solves one row by `solve`, which answers for one row-wire and gives the rms relative misfit. Where rows are not
    /// known, row-wires are tried in the order of how alike their readings at rest are, and the one that explains the
    /// readings best is taken: rows that mirror each other then come back as either of them.
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

/// Newton's method on every row of a frame. Where rows are not known, the one that explains the readings best is taken.
#[derive(Clone, Debug)]
pub struct NewtonDecoder {
    newton: Newton,
    search: RowSearch,
}

impl NewtonDecoder {
    /// For `rows` of `model` in `scene`.
    ///
    /// # Errors
    /// A sensor without resistances at rest.
    pub fn new(model: &SensorModel, scene: &Scene, rows: &[usize], rules: NewtonRules) -> Result<Self, SensorError> {
        Ok(Self {
            newton: Newton::new(model, scene, rules),
            search: RowSearch::new(model, scene, rows)?,
        })
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
        let newton = &mut self.newton;
        self.search
            .solve(row_index, readings, targets, |row, readings, coordinates| {
                Ok(newton.solve(row, readings, coordinates)?.residual)
            })
    }
}

/// Newton's method with noise and prior on every row of a frame. Where rows are not known, the one that explains the
/// readings best is taken.
#[derive(Clone, Debug)]
pub struct PosteriorDecoder {
    posterior: Posterior,
    search: RowSearch,
}

impl PosteriorDecoder {
    /// Decodes `rows` of `model` in `scene`, which must be among those that `posterior` was made for.
    ///
    /// # Errors
    /// A sensor without resistances at rest.
    pub fn new(posterior: Posterior, model: &SensorModel, scene: &Scene, rows: &[usize]) -> Result<Self, SensorError> {
        Ok(Self {
            posterior,
            search: RowSearch::new(model, scene, rows)?,
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
        self.search
            .solve(row_index, readings, targets, |row, readings, coordinates| {
                Ok(posterior.solve(row, readings, coordinates)?.residual)
            })
    }
}

/// Another decoder's answer, improved by a few steps of Newton's method: with noise and prior where the scene has noise.
pub struct PolishedDecoder {
    first: Box<dyn Decoder>,
    model: SensorModel,
    posterior: Posterior,
    rows: Vec<usize>,
    row_model: RowModel,
    steps: usize,
}

impl PolishedDecoder {
    /// `steps` steps after `first`, for `rows` of `model` in `scene`, all of which `posterior` was made for. Where rows
    /// are not known, the row-wire nearest to the first answer is taken.
    pub fn new(
        first: Box<dyn Decoder>,
        posterior: Posterior,
        model: &SensorModel,
        scene: &Scene,
        rows: &[usize],
        steps: usize,
    ) -> Self {
        Self {
            first,
            model: *model,
            posterior,
            rows: rows.to_vec(),
            row_model: scene.rows.model(),
            steps,
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
        self.posterior.polish(row_wire, readings, targets, self.steps)?;
        Ok(())
    }
}
