use ndarray::{Array2, ArrayView1};

use super::{Domain, Function, Node, NodeId, Operation, Program};
use crate::{
    dataset::Memory,
    decoupling::Precision,
    network::{MinMax, Quantity},
};

/// Changes of the readings from the centres of their channels.
#[derive(Clone, Debug)]
pub(crate) struct Changes {
    node: NodeId,
    /// Derivative of the quantity by the change of each channel.
    slopes: Vec<f64>,
    /// The quantity where the change is 0, relative to the centre.
    offsets: Vec<f64>,
    precision: Precision,
}

/// Builds a program node by node.
#[derive(Clone, Debug)]
pub struct Builder {
    pub(super) nodes: Vec<Node>,
}

impl Builder {
    /// Begins a program with the readings of a row, in double precision.
    pub fn new(channels: usize) -> Self {
        let readings = Node {
            operation: Operation::Readings,
            size: channels,
            precision: Precision::Double,
        };
        Self { nodes: vec![readings] }
    }

    /// Continues a program behind its last node.
    pub fn extending(program: &Program) -> Self {
        let nodes = program.nodes.clone();
        Self { nodes }
    }

    /// The node of the readings.
    pub fn readings(&self) -> NodeId {
        NodeId(0)
    }

    /// Ends the program with the node of its targets.
    pub fn finish(mut self, output: NodeId) -> Program {
        self.nodes.truncate(output.0 + 1);
        Program {
            nodes: self.nodes,
            output,
        }
    }

    fn push(&mut self, operation: Operation, precision: Precision) -> NodeId {
        self.nodes.push(Node {
            size: operation.size(&self.nodes).expect("the sizes of the operands match"),
            operation,
            precision,
        });
        NodeId(self.nodes.len() - 1)
    }

    /// Adds a table of constants, and the value to which it is padded when the programs of several row-wires are joined.
    fn table(&mut self, table: Array2<f64>, padding: f64, precision: Precision) -> NodeId {
        let tables = vec![table.as_standard_layout().into_owned()];
        self.push(Operation::Select { tables, padding }, precision)
    }

    /// Adds a vector of constants.
    pub fn constants(&mut self, values: &[f64], precision: Precision) -> NodeId {
        self.table(row(values), 0.0, precision)
    }

    /// Adds the check that values are in a domain.
    pub fn valid(&mut self, of: NodeId, domain: Domain) -> NodeId {
        self.push(Operation::Valid { of, domain }, Precision::Double)
    }

    /// Adds a difference, value by value.
    ///
    /// # Panics
    /// If the sizes differ.
    pub fn subtract(&mut self, one: NodeId, other: NodeId, precision: Precision) -> NodeId {
        self.push(Operation::Subtract(one, other), precision)
    }

    /// Adds a quotient, value by value.
    ///
    /// # Panics
    /// If the sizes differ.
    pub fn divide(&mut self, one: NodeId, other: NodeId, precision: Precision) -> NodeId {
        self.push(Operation::Divide(one, other), precision)
    }

    /// Adds a function of each value.
    pub fn map(&mut self, function: Function, of: NodeId, precision: Precision) -> NodeId {
        self.push(Operation::Map(function, of), precision)
    }

    /// Adds an affine map with these weights (inputs × outputs) and biases (outputs).
    ///
    /// # Panics
    /// If the sizes do not match.
    pub fn affine(&mut self, of: NodeId, weights: Array2<f64>, biases: &[f64], precision: Precision) -> NodeId {
        let weights = self.table(weights, 0.0, precision);
        let biases = self.constants(biases, precision);
        self.push(Operation::Affine { of, weights, biases }, precision)
    }

    /// Adds the squared distances to `points` (inputs × points).
    ///
    /// # Panics
    /// If the sizes do not match.
    pub fn squared_distances(&mut self, of: NodeId, points: Array2<f64>, precision: Precision) -> NodeId {
        let points = self.table(points, 0.0, precision);
        self.push(Operation::SquaredDistances { of, points }, precision)
    }

    /// Adds the nearest values within limits.
    ///
    /// # Panics
    /// If the sizes differ.
    pub fn clip(&mut self, of: NodeId, [low, high]: [&[f64]; 2], precision: Precision) -> NodeId {
        let [low, high] = [low, high].map(|values| self.constants(values, precision));
        self.push(Operation::Clip { of, low, high }, precision)
    }

    /// Adds the values of all parts, one after the other.
    pub fn concatenate(&mut self, parts: &[NodeId]) -> NodeId {
        self.push(Operation::Concatenate(parts.to_vec()), Precision::Double)
    }

    /// Adds the mean of the vectors `of`, with the softmax of `logits` as shares.
    ///
    /// # Panics
    /// If there are not as many vectors as logits.
    pub fn blend(&mut self, logits: NodeId, of: NodeId) -> NodeId {
        self.push(Operation::Blend { logits, of }, Precision::Double)
    }

    /// Adds values with their past.
    ///
    /// # Panics
    /// If the memory is invalid for this number of values.
    pub fn history(&mut self, of: NodeId, memory: &Memory) -> NodeId {
        let memory = memory.clone();
        self.push(Operation::History { of, memory }, Precision::Double)
    }

    /// Adds the number of values outside limits: one vector of them for all row-wires, or one for each.
    ///
    /// # Panics
    /// If the sizes differ.
    pub fn count_outside(&mut self, of: NodeId, limits: [Vec<Array2<f64>>; 2]) -> NodeId {
        let padding = 0.0;
        let [low, high] = limits.map(|tables| self.push(Operation::Select { tables, padding }, Precision::Double));
        self.push(Operation::CountOutside { of, low, high }, Precision::Double)
    }

    /// Adds the changes of the readings from R₀, the readings whose `quantity` is `centre`, rounded to single precision. They
    /// are valid readings only.
    ///
    /// R − R₀ is computed in double precision and the change in `precision`, which loses no digits in single precision where
    /// readings differ little. As R₀ is the same number in both precisions, programs that take their readings in single
    /// precision can compute the difference in it.
    ///
    /// | quantity q | change | q − q(R₀) |
    /// |---|---|---|
    /// | resistance, raw | R − R₀ | the change |
    /// | conductance | (R − R₀)/R | −1/R₀ times the change |
    /// | logarithm | ln(1 + (R − R₀)/R₀), in double precision | the change |
    pub(crate) fn changes(&mut self, quantity: Quantity, centre: &[f64], precision: Precision) -> Changes {
        let (exact, centre): (Vec<f64>, Vec<f64>) = centre
            .iter()
            .map(|&value| {
                let exact = quantity.resistance_ohm(value);
                let rounded = f64::from(exact as f32);
                (exact, if quantity.accepts(rounded) { rounded } else { exact })
            })
            .unzip();
        let off = exact.iter().zip(&centre).map(|(exact, rounded)| match quantity {
            Quantity::Resistance | Quantity::Raw => rounded - exact,
            Quantity::Conductance => (exact - rounded) / rounded / exact,
            Quantity::LogResistance => ((rounded - exact) / exact).ln_1p(),
        });
        let offsets = off.collect();
        let readings = self.valid(self.readings(), quantity.domain());
        let reference = self.constants(&centre, Precision::Double);
        let difference = self.subtract(readings, reference, Precision::Double);
        let mut slopes = vec![1.0; centre.len()];
        let node = match quantity {
            Quantity::Resistance | Quantity::Raw => difference,
            Quantity::Conductance => {
                slopes = centre.iter().map(|ohm| -1.0 / ohm).collect();
                self.divide(difference, readings, precision)
            }
            Quantity::LogResistance => {
                let relative = self.divide(difference, reference, Precision::Double);
                self.map(Function::Log1p, relative, Precision::Double)
            }
        };
        Changes {
            node,
            slopes,
            offsets,
            precision,
        }
    }

    /// Adds an affine map of the quantity relative to its centre, with weights (channels × outputs) and biases, computed from
    /// its changes and in their precision.
    ///
    /// # Panics
    /// If the sizes do not match.
    pub(crate) fn affine_of(&mut self, changes: &Changes, weights: Array2<f64>, biases: &[f64]) -> NodeId {
        self.affine_padded(changes, weights, biases, 0.0)
    }

    /// As [`Self::affine_of`], with the value of outputs that only other row-wires have.
    pub(crate) fn affine_padded(
        &mut self,
        changes: &Changes,
        mut weights: Array2<f64>,
        biases: &[f64],
        padding: f64,
    ) -> NodeId {
        assert_eq!(weights.dim(), (changes.slopes.len(), biases.len()));
        let biases = (&ArrayView1::from(biases) + &ArrayView1::from(&changes.offsets).dot(&weights)).to_vec();
        for (mut weights, slope) in weights.rows_mut().into_iter().zip(&changes.slopes) {
            weights *= *slope;
        }
        let (of, precision) = (changes.node, changes.precision);
        let weights = self.table(weights, 0.0, precision);
        let biases = self.table(row(&biases), padding, precision);
        self.push(Operation::Affine { of, weights, biases }, precision)
    }

    /// Adds the targets for scaled ones: constant targets are restored.
    ///
    /// # Panics
    /// If there are not as many values as varying targets.
    pub fn restored(&mut self, of: NodeId, outputs: &MinMax) -> NodeId {
        let (middles, half_widths): (Vec<f64>, Vec<f64>) = outputs.middles_and_half_widths().into_iter().unzip();
        let varying = outputs.varying();
        let weight = |(output, target): (usize, usize)| {
            if varying[output] == target {
                half_widths[target]
            } else {
                0.0
            }
        };
        let weights = Array2::from_shape_fn((varying.len(), middles.len()), weight);
        self.affine(of, weights, &middles, Precision::Double)
    }
}

fn row(values: &[f64]) -> Array2<f64> {
    Array2::from_shape_fn((1, values.len()), |(_, index)| values[index])
}
