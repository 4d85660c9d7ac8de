//! A graph of a memory and its network together, for one sample at a time, with the state as an input and an output.
//!
//! | input | shape | output | shape |
//! |---|---|---|---|
//! | `readings` | 1 × channels | `targets` | 1 × targets |
//! | `interval_s` | 1 × 1 | `features` | 1 × features |
//! | `state` | rows × channels | `next_state` | rows × channels |
//!
//! The state has a row of ones after the first sample (zeros before it), the latest readings, and the averages.

use prost::Message;

use super::{
    evaluator::{Tensor, Values, element_type, evaluate},
    schema::{Dimension, Graph, GraphBuilder, INT64, Model, TensorShape, TensorType, TypeOfValue, ValueInfo},
    writer::model,
};
use crate::export::bundle::{
    exported_decoder::Metadata,
    portable::Portable,
    weights::{Digits, Weights},
};

/// Numbers of a memory for a graph.
pub(in crate::export::bundle) struct StreamParts {
    pub(in crate::export::bundle) channels: usize,
    /// Number of readings in the state.
    pub(in crate::export::bundle) kept: usize,
    /// Exponents of the averages per second, and per sample.
    pub(in crate::export::bundle) rates: Vec<f64>,
    pub(in crate::export::bundle) of_samples: Vec<f64>,
    /// Rows of the next state that are features, after the readings.
    pub(in crate::export::bundle) past: Vec<usize>,
    pub(in crate::export::bundle) differences: bool,
}

impl StreamParts {
    /// Writes the graph.
    pub(in crate::export::bundle) fn write(
        &self,
        portable: &Portable,
        weights: &Weights,
        metadata: &Metadata,
    ) -> Vec<u8> {
        let mut whole = model(portable, weights, metadata, &[]);
        let network = whole.graph.take().unwrap_or_default();
        let (rows, features) = (1 + self.kept + self.rates.len(), portable.channels);
        let input = |name: &str, shape: [usize; 2], text: &str| value(name, shape, text);
        let mut inputs = vec![
            input("readings", [1, self.channels], "Readings of the next sample"),
            input("interval_s", [1, 1], "Seconds since the sample before"),
            input("state", [rows, self.channels], "State; zeros before the first sample"),
        ];
        // The row of a network for each row-wire.
        inputs.extend(network.input.iter().skip(1).cloned());
        let mut outputs = network.output.clone();
        outputs.push(input("next_state", [rows, self.channels], "State after this sample"));
        outputs.push(input("features", [1, features], "Inputs of the network"));
        let memory = self.memory(rows, features);
        let graph = Graph {
            name: network.name.clone(),
            node: [memory.node, network.node].concat(),
            initializer: [memory.initializer, network.initializer].concat(),
            input: inputs,
            output: outputs,
            ..network
        };
        Model {
            graph: Some(graph),
            ..whole
        }
        .encode_to_vec()
    }

    /// The operations from readings, interval and state to features and the next state.
    fn memory(&self, rows: usize, features: usize) -> Graph {
        let mut builder = GraphBuilder::default();
        let real = |shape: [usize; 2], values: Vec<f64>| Tensor::real(Digits::Double, shape, values);
        let column = |of: &dyn Fn(usize) -> f64| real([rows, 1], (0..rows).map(of).collect());
        let indices = |all: Vec<usize>| Tensor::int([all.len()], all.into_iter().map(|index| index as i64).collect());
        let first_average = 1 + self.kept;
        let of_average = |row: usize, values: &[f64]| row.checked_sub(first_average).map_or(0.0, |index| values[index]);
        builder.constant("memory_half", &real([1, 1], vec![0.5]));
        builder.constant("memory_zero", &real([1, 1], vec![0.0]));
        builder.constant("memory_one", &real([1, 1], vec![1.0]));
        builder.constant("memory_flag_row", &indices(vec![0]));
        let flag = builder.node("Gather", &["state", "memory_flag_row"], "memory_flag");
        let has_started = builder.node("Greater", &[&flag, "memory_half"], "memory_has_started");
        let known = builder.node("Where", &[&has_started, "state", "readings"], "memory_known");
        // Each kept reading moves one row down.
        let moved = (0..rows).map(|row| {
            if (2..first_average).contains(&row) {
                row - 1
            } else {
                row
            }
        });
        builder.constant("memory_moved_rows", &indices(moved.collect()));
        let moved = builder.node("Gather", &[&known, "memory_moved_rows"], "memory_moved");
        // Time that runs backwards counts as none.
        let is_forward = builder.node("Greater", &["interval_s", "memory_zero"], "memory_is_forward");
        let elapsed = builder.node("Where", &[&is_forward, "interval_s", "memory_zero"], "memory_elapsed_s");
        builder.constant("memory_per_second", &column(&|row| of_average(row, &self.rates)));
        builder.constant("memory_per_sample", &column(&|row| of_average(row, &self.of_samples)));
        let by_time = builder.node("Mul", &["memory_per_second", &elapsed], "memory_exponents_by_time");
        let exponents = builder.node("Add", &[&by_time, "memory_per_sample"], "memory_exponents");
        let negative = builder.node("Neg", &[&exponents], "memory_negative_exponents");
        let decays = builder.node("Exp", &[&negative], "memory_decays");
        let shares = builder.node("Sub", &["memory_one", &decays], "memory_weights");
        let off = builder.node("Sub", &["readings", &moved], "memory_differences");
        let change = builder.node("Mul", &[&shares, &off], "memory_changes");
        let averaged = builder.node("Add", &[&moved, &change], "memory_averaged");
        builder.constant("memory_latest_row", &column(&|row| f64::from(u8::from(row == 1))));
        builder.constant("memory_first_row", &column(&|row| f64::from(u8::from(row == 0))));
        let is_latest = builder.node("Greater", &["memory_latest_row", "memory_half"], "memory_is_latest");
        let is_flag = builder.node("Greater", &["memory_first_row", "memory_half"], "memory_is_flag");
        let latest = builder.node("Where", &[&is_latest, "readings", &averaged], "memory_with_latest");
        builder.node("Where", &[&is_flag, "memory_one", &latest], "next_state");
        builder.constant(
            "memory_feature_rows",
            &indices(std::iter::once(1).chain(self.past.iter().copied()).collect()),
        );
        let mut chosen = builder.node("Gather", &["next_state", "memory_feature_rows"], "memory_chosen");
        if self.differences {
            let count = 1 + self.past.len();
            let is_past = (0..count).map(|row| f64::from(u8::from(row > 0)));
            builder.constant("memory_past_rows", &real([count, 1], is_past.collect()));
            let is_past = builder.node("Greater", &["memory_past_rows", "memory_half"], "memory_is_past");
            let before = builder.node("Sub", &["readings", &chosen], "memory_before");
            chosen = builder.node("Where", &[&is_past, &before, &chosen], "memory_with_differences");
        }
        builder.constant("memory_line", &Tensor::int([2], vec![1, features as i64]));
        builder.node("Reshape", &[&chosen, "memory_line"], "features");
        builder.build()
    }
}

fn value(name: &str, shape: [usize; 2], text: &str) -> ValueInfo {
    let size = |size: usize| Dimension {
        dim_value: Some(size as i64),
        ..Dimension::default()
    };
    let tensor_type = TensorType {
        elem_type: element_type(Digits::Double),
        shape: Some(TensorShape {
            dim: shape.map(size).to_vec(),
        }),
    };
    ValueInfo {
        name: name.to_owned(),
        kind: Some(TypeOfValue {
            tensor_type: Some(tensor_type),
        }),
        doc_string: text.to_owned(),
    }
}

/// A graph with state that was read back.
pub(in crate::export::bundle) struct StreamGraph {
    graph: Graph,
    takes_row: bool,
}

impl StreamGraph {
    /// Reads a file.
    ///
    /// # Errors
    /// A description of the damage.
    pub(in crate::export::bundle) fn read(bytes: &[u8]) -> Result<Self, String> {
        let model = Model::decode(bytes).map_err(|error| error.to_string())?;
        let graph = model.graph.ok_or("there is no graph in it")?;
        let takes_row = graph.input.iter().any(|input| {
            let kind = input.kind.as_ref().and_then(|kind| kind.tensor_type.as_ref());
            kind.is_some_and(|kind| kind.elem_type == INT64)
        });
        Ok(Self { graph, takes_row })
    }

    /// Evaluates one sample: returns its targets and the next state.
    ///
    /// # Errors
    /// A description of the first operation that fails.
    pub(in crate::export::bundle) fn step(
        &self,
        readings: &[f64],
        interval_s: f64,
        shape: [usize; 2],
        state: &[f64],
    ) -> Result<(Vec<f64>, Vec<f64>), String> {
        let real = |shape: [usize; 2], values: Vec<f64>| Tensor::real(Digits::Double, shape, values);
        let mut inputs = vec![
            ("readings".to_owned(), real([1, readings.len()], readings.to_vec())),
            ("interval_s".to_owned(), real([1, 1], vec![interval_s])),
            ("state".to_owned(), real(shape, state.to_vec())),
        ];
        if self.takes_row {
            inputs.push(("row".to_owned(), Tensor::int([1], vec![1])));
        }
        let mut values = evaluate(&self.graph, inputs)?;
        let mut taken = |name: &str| match values.remove(name).map(|tensor| tensor.values) {
            Some(Values::Real(_, values)) => Ok(values),
            _ => Err(format!("there is no output {name}")),
        };
        Ok((taken("targets")?, taken("next_state")?))
    }
}
