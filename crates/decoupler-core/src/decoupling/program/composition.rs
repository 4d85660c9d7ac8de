//! Programs made of other programs.

use ndarray::{Array2, ArrayView1, Axis, Slice};
use serde::{Deserialize, Serialize};

use super::{Builder, Node, NodeId, Operation, Program};
use crate::{
    decoupling::Precision,
    network::{Networks, Quantity},
};

impl Program {
    /// The sum of the answers of programs that take the same readings, each target multiplied by its weight: an affine map of
    /// their concatenation.
    ///
    /// # Panics
    /// If there are no programs, or they differ in their readings or targets.
    #[must_use]
    pub fn combination(parts: &[(Self, Vec<f64>)]) -> Self {
        if let [(only, weights)] = parts
            && weights.iter().all(|weight| *weight == 1.0)
        {
            return only.clone();
        }
        let (channels, targets) = (parts[0].0.channels(), parts[0].0.outputs());
        let mut builder = Builder::new(channels);
        let mut answers = Vec::new();
        for (program, weights) in parts {
            assert_eq!((program.channels(), weights.len()), (channels, targets));
            let readings = builder.readings();
            answers.push(builder.include(program, readings));
        }
        let joined = builder.concatenate(&answers);
        let weight = |(place, target): (usize, usize)| match place % targets == target {
            true => parts[place / targets].1[target],
            false => 0.0,
        };
        let weights = Array2::from_shape_fn((parts.len() * targets, targets), weight);
        let sum = builder.affine(joined, weights, &vec![0.0; targets], Precision::Double);
        builder.finish(sum)
    }

    /// The affine map of `quantity` of the readings with these weights (channels + 1 × targets, the constant last); `centre`
    /// are usual values of the quantity.
    pub(crate) fn of_map(map: &Array2<f64>, quantity: Quantity, centre: &[f64]) -> Self {
        let weights = map.slice_axis(Axis(0), Slice::from(..centre.len())).to_owned();
        let constants = ArrayView1::from(centre).dot(&weights) + map.row(centre.len());
        let mut builder = Builder::new(centre.len());
        let changes = builder.changes(quantity, centre, Precision::Double);
        let targets = builder.affine_of(&changes, weights, &constants.to_vec());
        builder.finish(targets)
    }

    /// Describes the first defect of a program that comes from a file: operands that do not come before their node, or sizes
    /// and constants that do not match.
    pub fn defect(&self) -> Option<String> {
        let is_readings = |node: &Node| node.operation == Operation::Readings;
        if !self.nodes.first().is_some_and(is_readings) || self.output.0 >= self.nodes.len() {
            return Some("it does not lead from readings to targets".to_owned());
        }
        let index = self.nodes.iter().enumerate().position(|(index, node)| {
            let is_before = node.operation.operands().iter().all(|operand| operand.0 < index);
            let is_sound = |tables: &[Array2<f64>]| tables.iter().flatten().all(|value| value.is_finite());
            !is_before
                || (index > 0 && node.operation.size(&self.nodes) != Some(node.size))
                || matches!(&node.operation, Operation::Select { tables, .. } if !is_sound(tables))
        });
        index.map(|index| format!("its node {index} does not match the nodes before"))
    }
}

impl Operation {
    /// Number of values of an operation on these nodes; `None` if the sizes of its operands do not match, or for readings,
    /// whose number is given.
    pub(super) fn size(&self, nodes: &[Node]) -> Option<usize> {
        let size = |id: &NodeId| nodes[id.0].size;
        let same = |ids: &[NodeId]| ids.iter().all(|id| size(id) == size(&ids[0])).then(|| size(&ids[0]));
        let table = |id: &NodeId| match &nodes[id.0].operation {
            Self::Select { tables, .. } => tables.first(),
            _ => None,
        };
        match self {
            Self::Readings => None,
            Self::Select { tables, .. } => {
                let first = tables.first()?;
                tables
                    .iter()
                    .all(|table| table.dim() == first.dim())
                    .then_some(first.len())
            }
            Self::Valid { of, .. } | Self::Map(_, of) => Some(size(of)),
            Self::Subtract(one, other) | Self::Divide(one, other) => same(&[*one, *other]),
            Self::Affine { of, weights, biases } => {
                (table(weights)?.dim() == (size(of), table(biases)?.len())).then(|| size(biases))
            }
            Self::SquaredDistances { of, points } => {
                let (inputs, points) = table(points)?.dim();
                (inputs == size(of)).then_some(points)
            }
            Self::Clip { of, low, high } => same(&[*of, *low, *high]),
            Self::CountOutside { of, low, high } => same(&[*of, *low, *high]).map(|_| 1),
            Self::Concatenate(parts) => Some(parts.iter().map(size).sum()),
            Self::Blend { logits, of } => {
                (size(logits) > 0 && size(of).is_multiple_of(size(logits))).then(|| size(of) / size(logits))
            }
            Self::History { of, memory } => memory.check(size(of)).ok().map(|()| memory.features(size(of))),
        }
    }
}

impl Builder {
    /// Adds the nodes of a program that reads `readings`; returns the node of its targets.
    pub(super) fn include(&mut self, program: &Program, readings: NodeId) -> NodeId {
        let first = self.nodes.len();
        let moved = |id: &NodeId| match id.0 {
            0 => readings,
            index => NodeId(first + index - 1),
        };
        self.nodes.extend(program.nodes[1..].iter().map(|node| Node {
            operation: node.operation.with_operands(moved),
            ..node.clone()
        }));
        moved(&program.output)
    }
}

/// What a choice of settings answers with: for each target a convex combination of decoders that were fitted to the training
/// samples, the network of the run among them. Its weights are those with the smallest held-out error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Combined {
    /// Weight of the network for each target.
    pub network: Vec<f64>,
    /// Other decoders, each with its weight for each target.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<(Program, Vec<f64>)>,
    /// Share of the range of each reading in training by which it is extended before readings are limited to it.
    pub margin: f64,
}

impl Combined {
    /// The combination with this network as a program. Its readings are limited to their range in training, extended by a
    /// margin.
    ///
    /// # Panics
    /// If the network has other channels or targets.
    pub(super) fn program(&self, networks: &Networks) -> Program {
        let network = self.network.iter().any(|weight| *weight > 0.0);
        let network = network.then(|| (networks.program(Precision::Double), self.network.clone()));
        let parts = Vec::from_iter(network.into_iter().chain(self.others.iter().cloned()));
        networks.clipped(self.margin, |_| Program::combination(&parts))
    }

    /// Describes the first part that does not match this number of readings and targets, for files.
    pub fn defect(&self, channels: usize, targets: usize) -> Option<String> {
        let weights = || std::iter::once(&self.network).chain(self.others.iter().map(|(_, weights)| weights));
        let is_sound = |weights: &Vec<f64>| {
            weights.len() == targets && weights.iter().all(|weight| *weight >= 0.0 && weight.is_finite())
        };
        if !(0.0..=10.0).contains(&self.margin) {
            return Some("the margin must be from 0 to 10".to_owned());
        }
        let has_answer = weights().flatten().any(|weight| *weight > 0.0);
        if !has_answer || !weights().all(is_sound) {
            return Some("there must be one weight of at least 0 for each target".to_owned());
        }
        self.others.iter().find_map(|(program, _)| {
            let sizes = (program.defect().is_none()).then(|| (program.channels(), program.outputs(), program.rows()));
            (sizes != Some((channels, targets, 1))).then(|| {
                program
                    .defect()
                    .unwrap_or("it has other readings or targets than the network".to_owned())
            })
        })
    }
}
