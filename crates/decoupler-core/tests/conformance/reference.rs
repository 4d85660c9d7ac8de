//! Programs value by value, as their documentation defines them: no padding, no vector registers, one row at a time.

use std::collections::HashMap;

use decoupler_core::{
    dataset::{MemoryStream, Series},
    decoupling::{Function, NodeId, Operation, Precision, Program},
};

/// States of the history of each node and row-wire.
pub(crate) type States = HashMap<(usize, usize), MemoryStream>;

/// Values of the output for the readings of a row-wire; `None` if a reading is not in its domain.
pub(crate) fn answer(program: &Program, row: usize, readings: &[f64], states: &mut States) -> Option<Vec<f64>> {
    let mut values: Vec<Vec<f64>> = Vec::new();
    for (index, node) in program.nodes().iter().enumerate() {
        let round = |value: f64| match node.precision {
            Precision::Double => value,
            Precision::Single => f64::from(value as f32),
        };
        let of = |id: &NodeId| {
            values[id.index()]
                .iter()
                .map(|&value| round(value))
                .collect::<Vec<f64>>()
        };
        let by_pairs = |one: &NodeId, other: &NodeId, function: fn(f64, f64) -> f64| {
            let pairs = of(one).into_iter().zip(of(other));
            pairs
                .map(|(one, other)| round(function(one, other)))
                .collect::<Vec<f64>>()
        };
        let result = match &node.operation {
            Operation::Readings => readings.to_vec(),
            Operation::Select { tables, .. } => {
                let table = &tables[if tables.len() == 1 { 0 } else { row }];
                table.iter().map(|&value| round(value)).collect()
            }
            Operation::Valid { of: operand, domain } => {
                let checked = of(operand);
                if !checked.iter().all(|&value| domain.contains(value)) {
                    return None;
                }
                checked
            }
            Operation::Subtract(one, other) => by_pairs(one, other, |one, other| one - other),
            Operation::Divide(one, other) => by_pairs(one, other, |one, other| one / other),
            Operation::Map(function, operand) => {
                let function: fn(f64) -> f64 = match function {
                    Function::Log1p => f64::ln_1p,
                    Function::Tanh => f64::tanh,
                    Function::Gaussian => |x| (-x).exp(),
                };
                of(operand).into_iter().map(|value| round(function(value))).collect()
            }
            Operation::Affine {
                of: operand,
                weights,
                biases,
            } => {
                let (inputs, weights, mut sums) = (of(operand), of(weights), of(biases));
                let outputs = sums.len();
                for (output, sum) in sums.iter_mut().enumerate() {
                    for (input, value) in inputs.iter().enumerate() {
                        let weight = weights[input * outputs + output];
                        if weight != 0.0 {
                            *sum = round(*sum + round(value * weight));
                        }
                    }
                }
                sums
            }
            Operation::SquaredDistances { of: operand, points } => {
                let (inputs, points) = (of(operand), of(points));
                let distance = |point: usize| {
                    inputs.iter().enumerate().fold(0.0, |sum, (input, value)| {
                        let apart = round(value - points[input * node.size + point]);
                        round(sum + round(apart * apart))
                    })
                };
                (0..node.size).map(distance).collect()
            }
            Operation::Clip { of: operand, low, high } => {
                let limits = of(low).into_iter().zip(of(high));
                let clip = |(value, (low, high)): (f64, (f64, f64))| value.clamp(low, high);
                of(operand).into_iter().zip(limits).map(clip).collect()
            }
            Operation::Concatenate(parts) => parts.iter().flat_map(of).collect(),
            Operation::Blend { logits, of: operand } => {
                let (logits, vectors) = (of(logits), of(operand));
                let largest = logits.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let shares = Vec::from_iter(logits.iter().map(|logit| (logit - largest).exp()));
                let total: f64 = shares.iter().sum();
                let blend = |output: usize| {
                    let parts = shares.iter().enumerate();
                    let parts = parts.map(|(part, share)| share / total * vectors[part * node.size + output]);
                    Some(parts.sum()).filter(|sum: &f64| sum.is_finite()).unwrap_or(0.0)
                };
                (0..node.size).map(blend).collect()
            }
            Operation::History { of: operand, memory } => {
                let current = of(operand);
                let new = || MemoryStream::new(memory, current.len()).unwrap();
                let stream = states.entry((index, row)).or_insert_with(new);
                stream.step(Series::default(), &current, None).0.to_vec()
            }
            Operation::CountOutside { of: operand, low, high } => {
                let limits = of(low).into_iter().zip(of(high));
                let all = of(operand).into_iter().zip(limits);
                let outside = all.filter(|&(value, (low, high))| !(low <= value && value <= high));
                vec![outside.count() as f64]
            }
        };
        assert_eq!(result.len(), node.size, "{:?}", node.operation);
        values.push(result);
    }
    Some(values.swap_remove(program.output().index()))
}
