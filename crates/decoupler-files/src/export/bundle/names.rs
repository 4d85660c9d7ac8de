//! Names of values and constants in the files of a bundle.

use std::collections::HashMap;

use decoupler_core::decoupling::{Function, NodeId, Operation, Program};

use super::{exported_program::ExportedProgram, meaning::Meaning};

/// A name for each node of a program: the readings and outputs after their meaning, other nodes after their operation, and
/// constants after the node that takes them. A checked value has the name of the value.
pub(super) fn names(exported: &ExportedProgram, meaning: &Meaning) -> Vec<String> {
    let program = &exported.program;
    let mut used = HashMap::new();
    let mut names: Vec<String> = Vec::new();
    for (index, node) in program.nodes().iter().enumerate() {
        let id = NodeId::at(index);
        if let Operation::Valid { of, .. } = node.operation {
            names.push(names[of.index()].clone());
            continue;
        }
        let name = match &node.operation {
            _ if id == exported.targets => meaning.outputs(),
            _ if Some(id) == exported.half_widths => "half_widths",
            _ if Some(id) == exported.outside => "readings_outside",
            Operation::Readings => meaning.readings(),
            Operation::Select { .. } => of_constants(program, id),
            Operation::Subtract(..) => "differences",
            Operation::Divide(..) => "relative_differences",
            Operation::Map(Function::Tanh, _) => "activations",
            Operation::Map(Function::Gaussian, _) => "gaussians",
            Operation::Map(..) => "changes",
            Operation::SquaredDistances { .. } => "squared_distances",
            Operation::Clip { .. } => "within_segment",
            Operation::History { .. } => "features",
            Operation::Affine { .. } => "sums",
            _ => "values",
        };
        let count = used.entry(name).or_insert(0);
        *count += 1;
        names.push(match *count {
            1 => name.to_owned(),
            count => format!("{name}_{count}"),
        });
    }
    names
}

fn of_constants(program: &Program, id: NodeId) -> &'static str {
    let taking = program.nodes().iter().map(|node| &node.operation);
    let name = |operation: &Operation| match operation {
        Operation::Affine { weights, .. } if *weights == id => Some("weights"),
        Operation::Affine { biases, .. } if *biases == id => Some("biases"),
        Operation::SquaredDistances { points, .. } if *points == id => Some("centres"),
        Operation::Clip { low, .. } | Operation::CountOutside { low, .. } if *low == id => Some("lowest"),
        Operation::Clip { high, .. } | Operation::CountOutside { high, .. } if *high == id => Some("highest"),
        Operation::Subtract(_, other) | Operation::Divide(_, other) if *other == id => Some("reference"),
        _ => None,
    };
    taking.filter_map(name).next().unwrap_or("constants")
}
