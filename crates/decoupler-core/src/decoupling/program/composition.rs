//! Programs made of other programs.

use ndarray::{Array2, ArrayView1, Axis, Slice};

use super::{Builder, Domain, Node, NodeId, Operation, Program};
use crate::{
    dataset::PerRow,
    decoupling::{Combined, Precision},
    network::{DecouplingNetwork, MARGIN, Quantity},
    problem::Problem,
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

    /// The program with its readings limited to these ranges, channel by channel, before anything is computed from them.
    ///
    /// # Panics
    /// If there is not one range for each reading.
    #[must_use]
    pub fn clipped(&self, domain: Domain, limits: &[(f64, f64)]) -> Self {
        let (low, high): (Vec<f64>, Vec<f64>) = limits.iter().copied().unzip();
        let mut builder = Builder::new(self.channels());
        let valid = builder.valid(builder.readings(), domain);
        let clipped = builder.clip(valid, [&low, &high], Precision::Double);
        let output = builder.include(self, clipped);
        builder.finish(output)
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
            !is_before || self.size_of(&node.operation) != Some(node.size)
        });
        index.map(|index| format!("its node {index} does not match the nodes before"))
    }

    /// Number of values of an operation on the nodes of this program; `None` if the sizes of its operands do not match, or a
    /// constant is not finite.
    fn size_of(&self, operation: &Operation) -> Option<usize> {
        let size = |id: &NodeId| self.nodes[id.0].size;
        let same = |ids: &[NodeId]| ids.iter().all(|id| size(id) == size(&ids[0])).then(|| size(&ids[0]));
        let is_constant = |id: &NodeId| matches!(self.nodes[id.0].operation, Operation::Select { .. });
        match operation {
            Operation::Readings => Some(self.nodes[0].size),
            Operation::Select { tables, .. } => {
                let first = tables.first()?;
                let is_sound = |table: &Array2<f64>| table.dim() == first.dim() && table.iter().all(|x| x.is_finite());
                tables.iter().all(is_sound).then_some(first.len())
            }
            Operation::Valid { of, .. } | Operation::Map(_, of) => Some(size(of)),
            Operation::Subtract(one, other) | Operation::Divide(one, other) => same(&[*one, *other]),
            Operation::Affine { of, weights, biases } => {
                (is_constant(weights) && is_constant(biases) && size(weights) == size(of) * size(biases))
                    .then(|| size(biases))
            }
            Operation::SquaredDistances { of, points } => {
                (is_constant(points) && size(of) > 0 && size(points).is_multiple_of(size(of)))
                    .then(|| size(points) / size(of))
            }
            Operation::Clip { of, low, high } => same(&[*of, *low, *high]),
            Operation::CountOutside { of, low, high } => same(&[*of, *low, *high]).map(|_| 1),
            Operation::Concatenate(parts) => Some(parts.iter().map(size).sum()),
            Operation::Blend { logits, of } => {
                (size(logits) > 0 && size(of).is_multiple_of(size(logits))).then(|| size(of) / size(logits))
            }
            Operation::History { of, memory } => memory.check(size(of)).ok().map(|()| memory.features(size(of))),
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

impl PerRow<DecouplingNetwork> {
    /// The program that answers to the readings of `problem`: that of a combination with these networks, if there is one,
    /// otherwise that of the networks. For a recording, readings are limited to their range in training, extended by a tenth.
    ///
    /// # Panics
    /// As [`Self::program`], or if the combination has other readings or targets.
    pub fn decoder_program(&self, problem: &Problem, combined: Option<&Combined>) -> Program {
        match combined {
            Some(combined) => combined.program(self),
            None if problem.has_nodes() => self.program(Precision::Double),
            None => self.clipped(MARGIN, |network| network.program(Precision::Double)),
        }
    }

    /// Joins one program for each network, with the readings limited to their range in training, extended by `margin` of
    /// it: outside, networks and maps extrapolate without bound. Those of networks whose range is not known are not limited.
    pub(crate) fn clipped(&self, margin: f64, program: impl Fn(&DecouplingNetwork) -> Program) -> Program {
        let limited = |network: &DecouplingNetwork| {
            let (inputs, program) = (network.inputs(), program(network));
            let Some(range) = inputs.range() else { return program };
            let domain = match inputs.quantity() {
                Quantity::Raw => Domain::Finite,
                Quantity::Resistance | Quantity::Conductance | Quantity::LogResistance => Domain::Positive,
            };
            let limits = (0..range.channels()).map(|channel| range.limits_within(inputs.quantity(), channel, margin));
            program.clipped(domain, &Vec::from_iter(limits))
        };
        Program::each(&self.map(limited))
    }
}
