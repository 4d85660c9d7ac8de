//! What a decoder computes, as a small program over vectors.
//!
//! A [`Program`] is a list of [`Node`]s, each a vector computed by one [`Operation`] from earlier ones. It is built once
//! from a fitted decoder by a [`Builder`]; [`ProgramDecoder`] evaluates it, and exports write it in other languages.
//! A sum of decoders is an affine map of their concatenation, so averages and stacks of decoders need no operation of
//! their own.

mod builder;
mod composition;
mod evaluate;
mod kernel;
mod networks;

use ndarray::Array2;
use serde::{Deserialize, Serialize};

pub use builder::Builder;
pub use composition::Combined;
pub use evaluate::ProgramDecoder;

use super::Precision;
use crate::dataset::{DatasetError, Memory, PerRow};
pub use crate::network::Domain;

/// A computation from the readings of a row to its targets.
///
/// Nodes are in the order of evaluation: operands come before the nodes that use them, and the readings are the first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Program {
    nodes: Vec<Node>,
    output: NodeId,
}

/// A vector computed by a program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Node {
    /// Operation that computes the values.
    pub operation: Operation,
    /// Number of values.
    pub size: usize,
    /// Precision in which the values are computed. In single precision, operands are rounded to 32 bits first, and so
    /// is the result of each product and each sum.
    pub precision: Precision,
}

/// Index of a node in its program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct NodeId(usize);

impl NodeId {
    /// The node with this index.
    pub fn at(index: usize) -> Self {
        Self(index)
    }

    /// Index in [`Program::nodes`].
    pub fn index(self) -> usize {
        self.0
    }
}

/// An operation on vectors. Binary operations take vectors of the same size, value by value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Operation {
    /// The readings of the row.
    Readings,
    /// Constants, the same for all row-wires or selected by the row-wire.
    Select {
        /// One table for all row-wires, or one for each among those read; all of the same shape.
        tables: Vec<Array2<f64>>,
        /// Value to which a smaller table is padded when the programs of several row-wires are joined.
        padding: f64,
    },
    /// The values themselves if all are in the domain. Otherwise there is no answer: an error that names the reading, or
    /// NaN in languages without errors.
    Valid {
        /// Values that are checked.
        of: NodeId,
        /// Numbers that are accepted.
        domain: Domain,
    },
    /// The first minus the second.
    Subtract(NodeId, NodeId),
    /// The first divided by the second.
    Divide(NodeId, NodeId),
    /// A function of each value.
    Map(Function, NodeId),
    /// values · weights + biases. A term whose weight is 0 is 0, also for values that are not finite.
    Affine {
        /// Values (inputs).
        of: NodeId,
        /// Constants (inputs × outputs).
        weights: NodeId,
        /// Constants (1 × outputs).
        biases: NodeId,
    },
    /// Squared Euclidean distances to points.
    SquaredDistances {
        /// Values (inputs).
        of: NodeId,
        /// Constants (inputs × points).
        points: NodeId,
    },
    /// The nearest value within limits.
    Clip {
        /// Values that are limited.
        of: NodeId,
        /// Smallest values.
        low: NodeId,
        /// Largest values.
        high: NodeId,
    },
    /// The values of all parts, one after the other.
    Concatenate(Vec<NodeId>),
    /// Weighted mean Σ sᵣ·vᵣ of vectors with the softmax of the logits as shares, sᵣ = exp(lᵣ) / Σ exp(l); 0 where it is
    /// not finite.
    Blend {
        /// Logits l, one for each vector.
        logits: NodeId,
        /// Vectors v, one after the other.
        of: NodeId,
    },
    /// Current values with their past: see [`Memory`] for the features and their order.
    ///
    /// The only operation with a state, one for each group and row-wire.
    /// [`MemoryStream`](crate::dataset::MemoryStream) decides which state a row continues and where it restarts.
    History {
        /// Current values.
        of: NodeId,
        /// Lags and averages.
        memory: Memory,
    },
    /// Number of values outside limits (one value).
    CountOutside {
        /// Values that are counted.
        of: NodeId,
        /// Smallest values.
        low: NodeId,
        /// Largest values.
        high: NodeId,
    },
}

/// A function of one value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Function {
    /// ln(1 + x).
    Log1p,
    /// Hyperbolic tangent.
    Tanh,
    /// e⁻ˣ, a Gaussian of a squared distance.
    Gaussian,
}

impl Program {
    /// The program of these nodes.
    ///
    /// # Panics
    /// If the first are not the readings, or an operand does not come before its node.
    pub fn new(nodes: Vec<Node>, output: NodeId) -> Self {
        assert_eq!(nodes[0].operation, Operation::Readings);
        for (index, node) in nodes.iter().enumerate() {
            assert!(node.operation.operands().iter().all(|operand| operand.0 < index));
        }
        Self { nodes, output }
    }

    /// All nodes in the order of evaluation.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Node with this index.
    pub fn node(&self, id: NodeId) -> &Node {
        &self.nodes[id.0]
    }

    /// Node of the targets.
    pub fn output(&self) -> NodeId {
        self.output
    }

    /// Number of readings per row.
    pub fn channels(&self) -> usize {
        self.nodes[0].size
    }

    /// Number of targets per row.
    pub fn outputs(&self) -> usize {
        self.node(self.output).size
    }

    /// Number of row-wires that are distinguished; 1 if all have the same constants.
    pub fn rows(&self) -> usize {
        let tables = self.nodes.iter().map(|node| match &node.operation {
            Operation::Select { tables, .. } => tables.len(),
            _ => 1,
        });
        tables.max().unwrap_or(1)
    }

    /// Number of times that a node is taken, as an operand or as the targets.
    pub fn uses(&self, id: NodeId) -> usize {
        let operands = self.nodes.iter().flat_map(|node| node.operation.operands());
        operands.chain([self.output]).filter(|&operand| operand == id).count()
    }

    /// Joins the programs of the row-wires, which consist of the same operations, into one that selects their constants by
    /// the row-wire. Smaller tables are padded: to weights of 0, unless the table states another padding. A node is in
    /// single precision only if it is for every row-wire.
    ///
    /// # Panics
    /// If the programs consist of different operations.
    #[must_use]
    pub fn each(programs: &PerRow<Self>) -> Self {
        let mut joined = programs.values()[0].clone();
        if programs.only().is_some() {
            return joined;
        }
        for (index, joined) in joined.nodes.iter_mut().enumerate() {
            let nodes = programs.values().iter().map(|program| &program.nodes[index]);
            let is_single = nodes.clone().all(|node| node.precision == Precision::Single);
            joined.precision = if is_single {
                Precision::Single
            } else {
                Precision::Double
            };
            joined.size = nodes.clone().map(|node| node.size).max().unwrap_or(0);
            if let Operation::Select { tables, padding } = &mut joined.operation {
                let all = nodes.flat_map(|node| match &node.operation {
                    Operation::Select { tables, .. } => &tables[..],
                    _ => panic!("the programs of all row-wires consist of the same operations"),
                });
                *tables = padded(&Vec::from_iter(all), *padding);
                joined.size = tables[0].len();
            } else {
                let is_same = nodes.clone().all(|node| node.operation == joined.operation);
                assert!(is_same, "the programs of all row-wires consist of the same operations");
                let is_joint = matches!(joined.operation, Operation::Concatenate(_));
                assert!(
                    !is_joint || nodes.clone().all(|node| node.size == joined.size),
                    "padding inside of a concatenation"
                );
            }
        }
        joined
    }

    /// The program that reads the current readings and takes their past as well, for a decoder fitted to the features of
    /// `memory`.
    ///
    /// # Errors
    /// If the memory is invalid for this number of channels.
    ///
    /// # Panics
    /// If the memory has another number of features than the program has readings.
    pub fn with_history(self, memory: &Memory, channels: usize) -> Result<Self, DatasetError> {
        memory.check(channels)?;
        assert_eq!(memory.features(channels), self.channels());
        let mut builder = Builder::new(channels);
        let current = builder.valid(builder.readings(), Domain::Finite);
        let features = builder.history(current, memory);
        let output = builder.include(&self, features);
        Ok(builder.finish(output))
    }
}

/// Pads tables to the shape of the largest.
fn padded(tables: &[&Array2<f64>], padding: f64) -> Vec<Array2<f64>> {
    let largest = |of: fn(&Array2<f64>) -> usize| tables.iter().map(|table| of(table)).max().unwrap_or(0);
    let shape = (largest(Array2::nrows), largest(Array2::ncols));
    let pad = |table: &&Array2<f64>| Array2::from_shape_fn(shape, |place| *table.get(place).unwrap_or(&padding));
    tables.iter().map(pad).collect()
}

impl Operation {
    /// The same operation on other nodes.
    #[must_use]
    pub fn with_operands(&self, moved: impl Fn(&NodeId) -> NodeId) -> Self {
        let mut operation = self.clone();
        for operand in operation.operands_mut() {
            *operand = moved(operand);
        }
        operation
    }

    /// Nodes from which the operation computes.
    pub fn operands(&self) -> Vec<NodeId> {
        match self {
            Self::Readings | Self::Select { .. } => Vec::new(),
            Self::Valid { of, .. } | Self::Map(_, of) | Self::History { of, .. } => vec![*of],
            Self::Subtract(one, other) | Self::Divide(one, other) => vec![*one, *other],
            Self::SquaredDistances { of, points: other } | Self::Blend { logits: other, of } => vec![*of, *other],
            Self::Affine { of, weights, biases } => vec![*of, *weights, *biases],
            Self::Clip { of, low, high } | Self::CountOutside { of, low, high } => vec![*of, *low, *high],
            Self::Concatenate(parts) => parts.clone(),
        }
    }

    fn operands_mut(&mut self) -> Vec<&mut NodeId> {
        match self {
            Self::Readings | Self::Select { .. } => Vec::new(),
            Self::Valid { of, .. } | Self::Map(_, of) | Self::History { of, .. } => vec![of],
            Self::Subtract(one, other) | Self::Divide(one, other) => vec![one, other],
            Self::SquaredDistances { of, points: other } | Self::Blend { logits: other, of } => vec![of, other],
            Self::Affine { of, weights, biases } => vec![of, weights, biases],
            Self::Clip { of, low, high } | Self::CountOutside { of, low, high } => vec![of, low, high],
            Self::Concatenate(parts) => parts.iter_mut().collect(),
        }
    }
}
