//! The view of a program as a chain of layers, from which the writers start.

use decoupler_core::{
    decoupling::{Domain, Function, NodeId, Operation, Program},
    network::Quantity,
};
use ndarray::Array2;

/// A map from the readings of a row to its targets, layer by layer.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LayeredMap {
    /// Quantity of each reading.
    pub(super) quantity: Quantity,
    /// R₀ of each channel, from which the changes are measured that the first layer takes.
    pub(super) centre: Vec<f64>,
    /// Layers; the last returns the targets.
    pub(super) layers: Vec<Layer<f64>>,
}

/// A layer.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Layer<T> {
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
pub(super) struct AffineLayer<T> {
    /// Inputs × outputs.
    pub(super) weights: Array2<T>,
    /// Constant of each output.
    pub(super) biases: Vec<T>,
}

impl LayeredMap {
    /// Maps of a program that is a chain of layers, one for each row-wire that it distinguishes; `None` for other programs.
    pub(super) fn of(program: &Program) -> Option<Vec<Self>> {
        (0..program.rows()).map(|row| Self::of_row(program, row)).collect()
    }

    fn of_row(program: &Program, row: usize) -> Option<Self> {
        let operation = |id: NodeId| &program.node(id).operation;
        let table = |id: NodeId| match operation(id) {
            Operation::Select { tables, .. } => Some(&tables[if tables.len() == 1 { 0 } else { row }]),
            _ => None,
        };
        let mut layers = Vec::new();
        let mut id = program.output();
        // From the targets back to the changes of the readings.
        loop {
            let (layer, before) = match operation(id) {
                Operation::Affine { of, weights, biases } => {
                    let weights = table(*weights)?.clone();
                    let biases = table(*biases)?.iter().copied().collect();
                    (Layer::Affine(AffineLayer { weights, biases }), of)
                }
                Operation::Map(Function::Tanh, of) => (Layer::Tanh, of),
                Operation::Map(Function::Gaussian, of) => match operation(*of) {
                    Operation::SquaredDistances { of, points } => {
                        let centres = table(*points)?.clone();
                        (Layer::Gaussians { centres }, of)
                    }
                    _ => return None,
                },
                _ => break,
            };
            layers.push(layer);
            id = *before;
        }
        layers.reverse();
        let difference = |id: NodeId| match operation(id) {
            Operation::Subtract(readings, reference) => Some((*readings, *reference)),
            _ => None,
        };
        let (quantity, (readings, reference)) = match operation(id) {
            Operation::Divide(change, _) => (Quantity::Conductance, difference(*change)?),
            Operation::Map(Function::Log1p, relative) => match operation(*relative) {
                Operation::Divide(change, _) => (Quantity::LogResistance, difference(*change)?),
                _ => return None,
            },
            _ => (Quantity::Resistance, difference(id)?),
        };
        let quantity = match operation(readings) {
            Operation::Valid {
                domain: Domain::Finite, ..
            } => Quantity::Raw,
            _ => quantity,
        };
        Some(Self {
            quantity,
            centre: table(reference)?.iter().copied().collect(),
            layers,
        })
    }
}

impl<T> AffineLayer<T> {
    /// Number of outputs.
    pub(super) fn outputs(&self) -> usize {
        self.biases.len()
    }

    fn values(&self) -> impl Iterator<Item = &T> {
        self.weights.iter().chain(&self.biases)
    }

    fn with_values<U>(&self, values: &mut impl Iterator<Item = U>) -> Option<AffineLayer<U>> {
        let weights = array(self.weights.dim(), values)?;
        let biases: Vec<U> = values.take(self.biases.len()).collect();
        (biases.len() == self.biases.len()).then_some(AffineLayer { weights, biases })
    }
}

impl<T> Layer<T> {
    /// Values of all tables: weights (row by row) before biases.
    pub(super) fn values(&self) -> Box<dyn Iterator<Item = &T> + '_> {
        match self {
            Self::Affine(affine) => Box::new(affine.values()),
            Self::Tanh => Box::new(std::iter::empty()),
            Self::Gaussians { centres } => Box::new(centres.iter()),
        }
    }

    /// A layer of the same shape with other values, in the order of [`Self::values`]; `None` if there are too few.
    pub(super) fn with_values<U>(&self, values: &mut impl Iterator<Item = U>) -> Option<Layer<U>> {
        Some(match self {
            Self::Affine(affine) => Layer::Affine(affine.with_values(values)?),
            Self::Tanh => Layer::Tanh,
            Self::Gaussians { centres } => Layer::Gaussians {
                centres: array(centres.dim(), values)?,
            },
        })
    }

    /// Number of outputs for this number of inputs.
    pub(super) fn outputs(&self, inputs: usize) -> usize {
        match self {
            Self::Affine(affine) => affine.outputs(),
            Self::Tanh => inputs,
            Self::Gaussians { centres } => centres.ncols(),
        }
    }
}

/// Returns an array of the next values, row by row.
fn array<U>((rows, columns): (usize, usize), values: &mut impl Iterator<Item = U>) -> Option<Array2<U>> {
    Array2::from_shape_vec((rows, columns), values.take(rows * columns).collect()).ok()
}
