use ndarray::Array2;
use thiserror::Error;

use super::RowProblemDescription;
use crate::{network::Quantity, text::counted};

/// What a decoder computes, as plain numbers and a few kinds of steps, for programs that decode without this one.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// Maps from readings to targets: one for all row-wires, or one for each.
    pub maps: Vec<LayeredMap>,
    /// Iteration on the equations of the sensor that starts from the answers of the maps.
    pub equations: Option<RowProblemDescription>,
}

/// A map from the readings of a row to its targets, layer by layer.
#[derive(Clone, Debug, PartialEq)]
pub struct LayeredMap {
    /// Quantity computed from each reading.
    pub quantity: Quantity,
    /// Value subtracted from the quantity in each channel.
    pub centre: Vec<f64>,
    /// Layers; the first takes the centred values and the last returns the targets.
    pub layers: Vec<Layer<f64>>,
}

/// A layer.
#[derive(Clone, Debug, PartialEq)]
pub enum Layer<T> {
    /// Weighted sums.
    Affine(AffineLayer<T>),
    /// Hyperbolic tangent of each value.
    Tanh,
    /// Gaussians exp(−‖x − c‖²) around centres c.
    Gaussians {
        /// Inputs × Gaussians.
        centres: Array2<T>,
    },
}

/// Weighted sums with a constant: values · weights + biases.
#[derive(Clone, Debug, PartialEq)]
pub struct AffineLayer<T> {
    /// Inputs × outputs.
    pub weights: Array2<T>,
    /// Constant of each output.
    pub biases: Vec<T>,
}

/// Reason why a decoder cannot be described.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum NotDescribed {
    /// The decoder uses the noise of the readings and the prior of the scene.
    #[error(
        "the readings of the scene have noise, for which this decoder uses a prior of the deformation, which bundles do not support: take another decoder, or settings without noise"
    )]
    Posterior,
    /// There are no more equations than unknowns.
    #[error(
        "a row has {} for {unknowns} unknown displacements, too few for the equations to have one solution: take another decoder",
        counted(*.readings, "reading")
    )]
    Undetermined {
        /// Number of readings of a row.
        readings: usize,
        /// Number of unknowns of a row.
        unknowns: usize,
    },
    /// The decoder is a system of fuzzy rules.
    #[error("fuzzy rules are only for comparison and cannot be exported: take another decoder, such as rbf or ridge")]
    Rules,
    /// The decoder cannot be described.
    #[error("this decoder cannot be exported for other programs: take another decoder")]
    Unknown,
}

impl Description {
    /// Describes a decoder that consists of maps alone.
    pub(super) fn of_maps(maps: Vec<LayeredMap>) -> Self {
        Self { maps, equations: None }
    }
}

impl<T> AffineLayer<T> {
    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.biases.len()
    }
}

impl AffineLayer<f64> {
    /// Returns a layer without constants.
    pub(super) fn linear(weights: Array2<f64>) -> Self {
        Self {
            biases: vec![0.0; weights.ncols()],
            weights,
        }
    }

    /// Changes of the targets with these indices, added to the constants of all targets.
    pub(super) fn of_varying(changes: &Array2<f64>, varying: &[usize], constants: &[f64]) -> Self {
        let mut weights = Array2::zeros((changes.nrows(), constants.len()));
        for (column, &target) in changes.columns().into_iter().zip(varying) {
            weights.column_mut(target).assign(&column);
        }
        Self {
            weights,
            biases: constants.to_vec(),
        }
    }
}

impl<T> Layer<T> {
    /// Values of all tables: weights (row by row) before biases.
    pub fn values(&self) -> Box<dyn Iterator<Item = &T> + '_> {
        match self {
            Self::Affine(affine) => Box::new(affine.values()),
            Self::Tanh => Box::new(std::iter::empty()),
            Self::Gaussians { centres } => Box::new(centres.iter()),
        }
    }

    /// A layer of the same shape with other values, in the order of [`Self::values`]; `None` if there are too few.
    pub fn with_values<U>(&self, values: &mut impl Iterator<Item = U>) -> Option<Layer<U>> {
        Some(match self {
            Self::Affine(affine) => Layer::Affine(affine.with_values(values)?),
            Self::Tanh => Layer::Tanh,
            Self::Gaussians { centres } => Layer::Gaussians {
                centres: array(centres.dim(), values)?,
            },
        })
    }

    /// Number of outputs for this number of inputs.
    pub fn outputs(&self, inputs: usize) -> usize {
        match self {
            Self::Affine(affine) => affine.outputs(),
            Self::Tanh => inputs,
            Self::Gaussians { centres } => centres.ncols(),
        }
    }
}

impl<T> AffineLayer<T> {
    fn values(&self) -> impl Iterator<Item = &T> {
        self.weights.iter().chain(&self.biases)
    }

    fn with_values<U>(&self, values: &mut impl Iterator<Item = U>) -> Option<AffineLayer<U>> {
        let weights = array(self.weights.dim(), values)?;
        let biases: Vec<U> = values.take(self.biases.len()).collect();
        (biases.len() == self.biases.len()).then_some(AffineLayer { weights, biases })
    }
}

/// Returns an array of the next values, row by row.
fn array<U>((rows, columns): (usize, usize), values: &mut impl Iterator<Item = U>) -> Option<Array2<U>> {
    Array2::from_shape_vec((rows, columns), values.take(rows * columns).collect()).ok()
}
