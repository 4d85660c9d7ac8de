//! The program that is printed.

use decoupler_core::{
    decoupling::{Builder, Domain, Node, NodeId, Operation, Precision, Program},
    evaluation::HalfWidth,
};
use ndarray::Array2;

/// The program of a decoder with everything that a bundle answers: the targets, the half-widths of their intervals, and the
/// number of readings outside of the range of training. The output of the program are these, one after the other.
#[derive(Clone, Debug)]
pub(super) struct ExportedProgram {
    pub(super) program: Program,
    pub(super) targets: NodeId,
    /// Half-widths of the 90 % prediction intervals.
    pub(super) half_widths: Option<NodeId>,
    /// Number of readings, or of features of their past, beyond the range of training.
    pub(super) outside: Option<NodeId>,
}

/// Limits of each reading or feature, beyond which it counts as outside: for all row-wires or for each.
pub(super) type Limits = Vec<Vec<(f64, f64)>>;

impl ExportedProgram {
    /// Extends the program of a decoder; its successive affine maps are joined.
    pub(super) fn of(program: &Program, half_widths: &[HalfWidth], limits: Option<&Limits>) -> Self {
        let targets = program.output();
        let mut builder = Builder::extending(&join_affine_maps(program));
        let widths = (!half_widths.is_empty()).then(|| add_half_widths(&mut builder, targets, half_widths));
        let outside = limits.map(|limits| add_outside(&mut builder, program, limits));
        let parts = [Some(targets), widths, outside].into_iter().flatten();
        let output = builder.concatenate(&Vec::from_iter(parts));
        let (program, moved) = compact(&builder.finish(output));
        let moved = |id: NodeId| moved[id.index()];
        Self {
            program,
            targets: moved(targets),
            half_widths: widths.map(moved),
            outside: outside.map(moved),
        }
    }

    /// The same program in single precision, except for the nodes up to the layer number `wide`, the state of a history and the
    /// comparison with limits.
    pub(super) fn in_single(&self, wide: usize) -> Self {
        let first = wide.checked_sub(1).map_or(0, |last| self.layers()[last] + 1);
        let mut nodes = self.program.nodes().to_vec();
        for index in 0..nodes.len() {
            let precision = match nodes[index].operation {
                // Those of tables follow from the nodes that take them.
                Operation::Select { .. } => continue,
                // A checked value has the precision of the value.
                Operation::Valid { of, .. } => nodes[of.index()].precision,
                Operation::History { .. } | Operation::CountOutside { .. } => Precision::Double,
                Operation::Readings => Precision::Single,
                _ if index < first => Precision::Double,
                _ => Precision::Single,
            };
            nodes[index].precision = precision;
            for operand in nodes[index].operation.operands() {
                let operand = &mut nodes[operand.index()];
                if let Operation::Select { .. } = operand.operation {
                    operand.precision = precision;
                }
            }
        }
        Self {
            program: Program::new(nodes, self.program.output()),
            ..self.clone()
        }
    }

    /// The program with constants that are larger or smaller by this relative error, in a fixed pattern.
    pub(super) fn disturbed(&self, error: f64) -> Program {
        let mut nodes = self.program.nodes().to_vec();
        // A linear congruential generator (Knuth, The Art of Computer Programming, volume 2, section 3.3.4).
        let mut state = 1_u64;
        let values = nodes.iter_mut().flat_map(|node| match &mut node.operation {
            Operation::Select { tables, .. } => &mut tables[..],
            _ => &mut [],
        });
        for value in values.flatten() {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            *value *= 1.0 + if state >> 63 == 0 { error } else { -error };
        }
        Program::new(nodes, self.program.output())
    }

    /// Indices of the nodes with sums of products.
    pub(super) fn layers(&self) -> Vec<usize> {
        let is_layer =
            |operation: &Operation| matches!(operation, Operation::Affine { .. } | Operation::SquaredDistances { .. });
        let nodes = self.program.nodes().iter().enumerate();
        let layers = nodes.filter(|(_, node)| is_layer(&node.operation));
        layers.map(|(index, _)| index).collect()
    }

    /// The parts of an answer.
    pub(super) fn parts(&self) -> impl Iterator<Item = NodeId> {
        let parts = [Some(self.targets), self.half_widths, self.outside];
        parts.into_iter().flatten()
    }

    /// Number of targets.
    pub(super) fn outputs(&self) -> usize {
        self.program.node(self.targets).size
    }
}

/// `true` if a reading of this program must be above 0.
pub(super) fn are_positive(program: &Program) -> bool {
    let mut operations = program.nodes().iter().map(|node| &node.operation);
    operations.any(|operation| matches!(operation, Operation::Valid { domain, .. } if *domain == Domain::Positive))
}

/// The constants of node `id`, of row-wire `row`.
pub(super) fn table(nodes: &[Node], id: NodeId, row: usize) -> &Array2<f64> {
    let tables = tables(nodes, id);
    &tables[row.min(tables.len() - 1)]
}

fn tables(nodes: &[Node], id: NodeId) -> &[Array2<f64>] {
    match &nodes[id.index()].operation {
        Operation::Select { tables, .. } => tables,
        _ => panic!("the tables of an operation are constants"),
    }
}

/// Joins affine maps of affine maps: the constants that restore the units of targets need no layer of their own.
fn join_affine_maps(program: &Program) -> Program {
    let mut nodes = program.nodes().to_vec();
    for index in 0..nodes.len() {
        let Operation::Affine { of, weights, biases } = nodes[index].operation else {
            continue;
        };
        let Operation::Affine {
            of: first,
            weights: first_weights,
            biases: first_biases,
        } = nodes[of.index()].operation
        else {
            continue;
        };
        if program.uses(of) > 1 {
            continue;
        }
        let all = [weights, biases, first_weights, first_biases];
        let rows = all.map(|id| tables(&nodes, id).len()).into_iter().max().unwrap_or(1);
        let joined = (0..rows).map(|row| {
            let [weights, biases, first_weights, first_biases] = all.map(|id| table(&nodes, id, row));
            (first_weights.dot(weights), first_biases.dot(weights) + biases)
        });
        let (joined_weights, joined_biases): (Vec<_>, Vec<_>) = joined.unzip();
        for (id, tables) in [(weights, joined_weights), (biases, joined_biases)] {
            nodes[id.index()].size = tables[0].len();
            nodes[id.index()].operation = Operation::Select { tables, padding: 0.0 };
        }
        let of = first;
        nodes[index].operation = Operation::Affine { of, weights, biases };
    }
    Program::new(nodes, program.output())
}

/// Adds half-widths that are constant, or piecewise linear in the target: a constant and, for each segment, a slope times
/// the target within it.
fn add_half_widths(builder: &mut Builder, targets: NodeId, half_widths: &[HalfWidth]) -> NodeId {
    let count = half_widths.len();
    let segments = half_widths.iter().map(|of| of.by_answer.len().saturating_sub(1)).max();
    let segments = segments.unwrap_or(0).max(1);
    let mut weights = Array2::zeros((segments * count, count));
    let mut biases = vec![0.0; count];
    let (mut low, mut high) = (vec![vec![0.0; count]; segments], vec![vec![0.0; count]; segments]);
    for (target, of) in half_widths.iter().enumerate() {
        biases[target] = of.by_answer.first().map_or(of.constant, |point| point[1]);
        for (segment, pair) in of.by_answer.windows(2).enumerate() {
            let ([x0, y0], [x1, y1]) = (pair[0], pair[1]);
            let slope = (y1 - y0) / (x1 - x0);
            (low[segment][target], high[segment][target]) = (x0, x1);
            weights[[segment * count + target, target]] = slope;
            biases[target] -= slope * x0;
        }
    }
    let limits = low.iter().zip(&high);
    let clipped = limits.map(|(low, high)| builder.clip(targets, [low, high], Precision::Double));
    let clipped = Vec::from_iter(clipped);
    let of = builder.concatenate(&clipped);
    builder.affine(of, weights, &biases, Precision::Double)
}

/// Adds the number of readings, or features of a history, outside of `limits`.
fn add_outside(builder: &mut Builder, program: &Program, limits: &Limits) -> NodeId {
    let first = |is: fn(&Operation) -> bool| program.nodes().iter().position(|node| is(&node.operation));
    let of = first(|operation| matches!(operation, Operation::History { .. }))
        .or_else(|| first(|operation| matches!(operation, Operation::Valid { .. })))
        .expect("every decoder checks its readings");
    let side = |pick: fn(&(f64, f64)) -> f64| {
        let of_row = |limits: &Vec<_>| Array2::from_shape_fn((1, limits.len()), |(_, index)| pick(&limits[index]));
        limits.iter().map(of_row).collect()
    };
    builder.count_outside(NodeId::at(of), [side(|limits| limits.0), side(|limits| limits.1)])
}

/// The program of the nodes that its output needs, and the new place of each.
fn compact(program: &Program) -> (Program, Vec<NodeId>) {
    let (nodes, output) = (program.nodes(), program.output());
    let mut is_needed = vec![false; nodes.len()];
    (is_needed[0], is_needed[output.index()]) = (true, true);
    for index in (0..nodes.len()).rev() {
        if is_needed[index] {
            for operand in nodes[index].operation.operands() {
                is_needed[operand.index()] = true;
            }
        }
    }
    let (mut kept, mut moved) = (Vec::new(), Vec::new());
    for (node, is_needed) in nodes.iter().zip(is_needed) {
        moved.push(NodeId::at(kept.len()));
        if is_needed {
            kept.push(Node {
                operation: node.operation.with_operands(|id| moved[id.index()]),
                ..node.clone()
            });
        }
    }
    (Program::new(kept, moved[output.index()]), moved)
}

#[cfg(test)]
mod tests {
    use decoupler_core::decoupling::{Builder, Decoder, ProgramDecoder};

    use super::*;

    fn answers(program: &Program, readings: &[f64]) -> Vec<f64> {
        let mut decoder = ProgramDecoder::new(program.clone());
        let mut answers = vec![0.0; decoder.outputs()];
        decoder.decode_row(0, readings, &mut answers).unwrap();
        answers
    }

    /// Targets 2a + 3b + 1 and −a; half-widths by hand: constant 0.5, and 1 at −1, 3 at 1, 2 at 2.
    #[test]
    fn joined_maps_half_widths_and_counts_answer_as_the_definitions_say() {
        let mut builder = Builder::new(2);
        let valid = builder.valid(builder.readings(), Domain::Finite);
        let double = Precision::Double;
        let weights = Array2::from_shape_vec((2, 2), vec![1.0, 0.5, 2.0, 0.0]).unwrap();
        let first = builder.affine(valid, weights, &[0.25, 0.0], double);
        let weights = Array2::from_shape_vec((2, 2), vec![1.5, 0.0, 1.0, -2.0]).unwrap();
        let second = builder.affine(first, weights, &[0.625, 0.0], double);
        let program = builder.finish(second);
        let half_width = |by_answer: Vec<[f64; 2]>| HalfWidth {
            constant: 0.5,
            by_answer,
            samples: 100,
            effective_samples: 100.0,
        };
        let widths = [
            half_width(vec![]),
            half_width(vec![[-1.0, 1.0], [1.0, 3.0], [2.0, 2.0]]),
        ];
        let limits = vec![vec![(-2.0, 2.0), (0.0, 1.0)]];
        let exported = ExportedProgram::of(&program, &widths, Some(&limits));
        assert_eq!(
            exported.layers().len(),
            2,
            "one for the targets, one for the half-widths"
        );
        for (readings, width, outside) in [
            ([0.0, 0.0], 2.0, 0.0),
            ([3.0, 0.0], 1.0, 1.0),
            ([-1.5, 2.0], 2.5, 1.0),
            ([-9.0, -1.0], 2.0, 2.0),
        ] {
            let [a, b] = readings;
            let expected = [2.0 * a + 3.0 * b + 1.0, -a, 0.5, width, outside];
            for program in [
                &exported.program,
                &exported.in_single(0).program,
                &exported.in_single(1).program,
            ] {
                for (found, expected) in answers(program, &readings).iter().zip(expected) {
                    assert!((found - expected).abs() < 1e-6, "{readings:?}: {found} {expected}");
                }
            }
            assert_eq!(
                answers(&program, &readings)[..2],
                answers(&exported.program, &readings)[..2]
            );
        }
    }
}
