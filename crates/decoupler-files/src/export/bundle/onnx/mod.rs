//! Bundles as ONNX graphs (opset 13).
//!
//! | input | shape | type |
//! |---|---|---|
//! | `resistances_ohm`, or `readings` of own data | batch × M4 | float or double |
//! | `row`, for decoders of known rows | batch | int64, from 1 |
//! | `time_s` and `state`, with a history: batch is 1 | 1 × 1, rows × M4 | double |
//!
//! | output | shape | type |
//! |---|---|---|
//! | `coordinates_mm`, or `targets` | batch × 3·M2 | as the input; NaN where a reading or the row is invalid |
//! | `half_widths`, if there are prediction intervals | as the targets | as the targets |
//! | `readings_outside`, if the range in training is known | batch | int64 |
//! | `next_state`, with a history | as the state | double |

mod builder;
mod history;
mod message;

use std::collections::HashMap;

use decoupler_core::{
    decoupling::{Domain, Function, NodeId, Operation, Precision},
    problem::Channel,
};

use self::{
    builder::{GraphBuilder, element_type, value},
    message::{INT64, Message},
};
use super::{
    contents::{Contents, word},
    folder::AtomicFolder,
    meaning::comment,
    report::BundleError,
};

const OPSET: i64 = 13;
/// The first version of the format with opset 13.
const IR_VERSION: i64 = 7;
/// Longest lag in a graph, which copies its state for each sample.
const MAX_LAG: usize = 1000;

/// Writes the graph.
///
/// # Errors
/// A lag is too long, or the operating system refuses.
pub(super) fn print(contents: &Contents, folder: &mut AtomicFolder) -> Result<String, BundleError> {
    let lag = contents.history().map_or(0, |history| history.constants.longest_lag());
    if lag > MAX_LAG {
        return Err(BundleError::Unsuitable(format!(
            "a lag of {lag} samples is too long for an ONNX graph, which copies its state for each sample: export as c99, numpy \
             or matlab"
        )));
    }
    let notes = contents.notes.iter().map(|note| format!(" Note: {note}."));
    let state = contents.state_in_words().map(|about| format!(" {about}"));
    let about = format!(
        "{}. Answers are NaN where a reading or the row is invalid.{}{}",
        contents.meaning.purpose(),
        state.unwrap_or_default(),
        notes.collect::<String>()
    );
    let properties = contents.metadata.as_object().into_iter().flatten().map(|(key, value)| {
        let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        Message::default().bytes(1, key).bytes(2, value)
    });
    let model = Message::default()
        .int(1, IR_VERSION)
        .bytes(2, "decoupler")
        .bytes(3, env!("CARGO_PKG_VERSION"))
        .bytes(6, about)
        .bytes(7, Printer::graph(contents))
        .bytes(8, Message::default().int(2, OPSET))
        .all(14, properties);
    folder.write(&format!("{}.onnx", contents.noun), model)?;
    Ok(usage(contents))
}

/// A graph in progress.
struct Printer<'a> {
    contents: &'a Contents,
    builder: GraphBuilder,
    /// Conditions under which there is an answer, batch × 1 each.
    valid: Vec<String>,
    /// Values of nodes in the precision of other nodes.
    casts: HashMap<(usize, Precision), String>,
    next_state: Option<String>,
}

impl Printer<'_> {
    fn graph(contents: &Contents) -> Message {
        let mut printer = Printer {
            contents,
            builder: GraphBuilder::default(),
            valid: Vec::new(),
            casts: HashMap::new(),
            next_state: None,
        };
        printer.check_row();
        let builder = &mut printer.builder;
        for constant in contents.constants() {
            let name = match constant.tables.len() {
                1 => constant.name,
                _ => &format!("{}_of_rows", constant.name),
            };
            let all = builder.numbers(name, constant.precision, &constant.shape, constant.values());
            if all != constant.name {
                builder.named("Gather", &[&all, "row_index"], &[("axis", 0)], constant.name);
            }
        }
        for (id, operation) in contents.computed() {
            printer.add(id, operation);
        }
        printer.finish()
    }

    /// Adds the check of the row and its index.
    fn check_row(&mut self) {
        if !self.contents.takes_row() {
            return;
        }
        let builder = &mut self.builder;
        let [first, last] = [1, self.contents.rows].map(|row| builder.whole(&[], &[row as i64]));
        let not_below = builder.op("GreaterOrEqual", &["row", &first]);
        let not_above = builder.op("LessOrEqual", &["row", &last]);
        let is_row = builder.op("And", &[&not_below, &not_above]);
        let row = builder.op("Where", &[&is_row, "row", &first]);
        builder.named("Sub", &[&row, &first], &[], "row_index");
        let axis = builder.whole(&[1], &[1]);
        self.valid.push(builder.op("Unsqueeze", &[&is_row, &axis]));
    }

    /// Name of a value; the outputs have their own, as they are NaN where there is no answer.
    fn name(&self, id: NodeId) -> String {
        let name = self.contents.name_of(id);
        let exported = &self.contents.exported;
        match id == exported.targets || Some(id) == exported.half_widths {
            true => format!("{name}_computed"),
            false => name.to_owned(),
        }
    }

    /// The value of a node in this precision.
    fn value(&mut self, id: NodeId, precision: Precision) -> String {
        let name = self.name(id);
        if self.contents.precision_of(id) == precision {
            return name;
        }
        let Self { casts, builder, .. } = self;
        let cast = casts.entry((id.index(), precision));
        let to = [("to", element_type(precision))];
        cast.or_insert_with(|| builder.with("Cast", &[&name], &to)).clone()
    }

    fn add(&mut self, id: NodeId, operation: &Operation) {
        let contents = self.contents;
        let (name, precision) = (self.name(id), contents.precision_of(id));
        let operands = operation.operands().into_iter();
        let operands = Vec::from_iter(operands.map(|operand| self.value(operand, precision)));
        let operands = Vec::from_iter(operands.iter().map(String::as_str));
        let builder = &mut self.builder;
        match operation {
            Operation::Valid { of, domain } => {
                let x = contents.name_of(*of);
                let precision = contents.precision_of(*of);
                let infinity = builder.scalar(precision, f64::INFINITY);
                let size = builder.op("Abs", &[x]);
                let mut is_valid = builder.op("Less", &[&size, &infinity]);
                if *domain == Domain::Positive {
                    let zero = builder.scalar(precision, 0.0);
                    let is_positive = builder.op("Greater", &[x, &zero]);
                    is_valid = builder.op("And", &[&is_valid, &is_positive]);
                }
                let is_invalid = builder.op("Not", &[&is_valid]);
                let invalid = builder.count(&is_invalid);
                let none = builder.whole(&[], &[0]);
                self.valid.push(builder.op("Equal", &[&invalid, &none]));
            }
            Operation::Subtract(..) => drop(builder.named("Sub", &operands, &[], &name)),
            Operation::Divide(..) => drop(builder.named("Div", &operands, &[], &name)),
            Operation::Map(function, _) => self.map(*function, operands[0], precision, &name),
            Operation::Affine { weights, .. } => {
                let product = if contents.is_of_row(*weights) {
                    let axis = builder.whole(&[1], &[1]);
                    let line = builder.op("Unsqueeze", &[operands[0], &axis]);
                    let product = builder.op("MatMul", &[&line, operands[1]]);
                    builder.op("Squeeze", &[&product, &axis])
                } else {
                    builder.op("MatMul", &operands[..2])
                };
                builder.named("Add", &[&product, operands[2]], &[], &name);
            }
            Operation::SquaredDistances { .. } => {
                let axis = builder.whole(&[1], &[2]);
                let values = builder.op("Unsqueeze", &[operands[0], &axis]);
                let apart = builder.op("Sub", &[&values, operands[1]]);
                let squares = builder.op("Mul", &[&apart, &apart]);
                let axes = builder.whole(&[1], &[1]);
                builder.named("ReduceSum", &[&squares, &axes], &[("keepdims", 0)], &name);
            }
            Operation::Clip { .. } => {
                let above = builder.op("Max", &[operands[0], operands[1]]);
                builder.named("Min", &[&above, operands[2]], &[], &name);
            }
            Operation::Concatenate(_) => drop(builder.named("Concat", &operands, &[("axis", 1)], &name)),
            Operation::History { .. } => self.add_history(operands[0], &name),
            Operation::CountOutside { .. } => {
                let below = builder.op("Less", &operands[..2]);
                let above = builder.op("Greater", &[operands[0], operands[2]]);
                let is_outside = builder.op("Or", &[&below, &above]);
                let ones = builder.with("Cast", &[&is_outside], &[("to", INT64)]);
                let axes = builder.whole(&[1], &[1]);
                builder.named("ReduceSum", &[&ones, &axes], &[("keepdims", 0)], "readings_outside");
            }
            Operation::Readings | Operation::Select { .. } | Operation::Blend { .. } => {
                unreachable!("given, or not exported")
            }
        }
    }

    fn map(&mut self, function: Function, x: &str, precision: Precision, name: &str) {
        let builder = &mut self.builder;
        match function {
            Function::Tanh => drop(builder.named("Tanh", &[x], &[], name)),
            Function::Gaussian => {
                let negative = builder.op("Neg", &[x]);
                builder.named("Exp", &[&negative], &[], name);
            }
            Function::Log1p => {
                // With u = 1 + x rounded, ln u · x/(u − 1), and x where u is 1 (W. Kahan): the digits that x loses in u cancel.
                let one = builder.scalar(precision, 1.0);
                let u = builder.op("Add", &[x, &one]);
                let rounded = builder.op("Sub", &[&u, &one]);
                let zero = builder.scalar(precision, 0.0);
                let is_lost = builder.op("Equal", &[&rounded, &zero]);
                let divisor = builder.op("Where", &[&is_lost, &one, &rounded]);
                let log = builder.op("Log", &[&u]);
                let scaled = builder.op("Mul", &[&log, x]);
                let quotient = builder.op("Div", &[&scaled, &divisor]);
                builder.named("Where", &[&is_lost, x, &quotient], &[], name);
            }
        }
    }

    /// Adds the outputs, NaN where there is no answer.
    fn finish(mut self) -> Message {
        let contents = self.contents;
        let (exported, meaning) = (&contents.exported, &contents.meaning);
        let batch = if contents.history().is_some() { Some(1) } else { None };
        let valid = std::mem::take(&mut self.valid).into_iter();
        let is_valid = valid.reduce(|all, one| self.builder.op("And", &[&all, &one]));
        let is_valid = is_valid.expect("every decoder checks its readings");
        let precision = contents.outer_precision();
        let kind = element_type(precision);
        let mut outputs = Vec::new();
        let targets = meaning.either("Coordinates in mm", "Targets");
        let targets = channel_names(targets, &meaning.targets, meaning.is_array);
        let widths = "Half-widths of the 90 % prediction intervals, valid for all answers together";
        for (id, output, about) in [
            (Some(exported.targets), meaning.outputs(), targets.as_str()),
            (exported.half_widths, "half_widths", widths),
        ] {
            let Some(id) = id else { continue };
            let computed = self.value(id, precision);
            let nan = self.builder.scalar(precision, f64::NAN);
            self.builder.named("Where", &[&is_valid, &computed, &nan], &[], output);
            outputs.push(value(output, kind, &[batch, Some(contents.outputs())], about));
        }
        if exported.outside.is_some() {
            let about = contents.outside_in_words();
            outputs.push(value("readings_outside", INT64, &[batch], about));
        }
        let about = meaning.either("Readings in ohm", "Readings");
        let about = channel_names(about, &meaning.inputs, meaning.is_array);
        let shape = [batch, Some(contents.channels())];
        let mut inputs = vec![value(meaning.readings(), kind, &shape, &about)];
        if contents.takes_row() {
            let about = format!("Row of each reading, from 1 to {}", contents.rows);
            inputs.push(value("row", INT64, &[batch], &about));
        }
        if let (Some(next), Some(history)) = (self.next_state.take(), contents.history()) {
            let double = element_type(Precision::Double);
            let shape = [Some(history.state_rows()), Some(contents.channels())];
            let builder = &mut self.builder;
            builder.named("Where", &[&is_valid, &next, "state"], &[], "next_state");
            let of_state = "State of a series: zeros at the start, then next_state of the reading before";
            let of_time = "Time in seconds, NaN if it is not known";
            inputs.push(value("time_s", double, &[Some(1), Some(1)], of_time));
            inputs.push(value("state", double, &shape, of_state));
            outputs.push(value("next_state", double, &shape, "State after this reading"));
        }
        Message::default()
            .all(1, self.builder.nodes)
            .bytes(2, "decoupler")
            .all(5, self.builder.initializers)
            .all(11, inputs)
            .all(12, outputs)
    }
}

/// A list of channels, with units for own data.
fn channel_names(what: &str, channels: &[Channel], is_array: bool) -> String {
    let name = |channel: &Channel| match is_array {
        true => channel.name.clone(),
        false => comment(&channel.title()),
    };
    format!("{what}: {}", Vec::from_iter(channels.iter().map(name)).join(", "))
}

/// Lines of a program that decodes.
fn usage(contents: &Contents) -> String {
    let (input, output) = (contents.meaning.readings(), contents.meaning.outputs());
    let kind = word(contents.outer_precision(), ["float32", "float64"]);
    let row = match contents.takes_row() {
        true => ", \"row\": np.array([1], np.int64)",
        false => "",
    };
    let loaded = format!(
        "    import numpy as np\n    import onnxruntime\n    session = onnxruntime.InferenceSession(\"{}.onnx\")\n",
        contents.noun
    );
    if let Some(history) = contents.history() {
        let (rows, columns) = (history.state_rows(), contents.channels());
        return format!(
            "{loaded}    state = np.zeros(({rows}, {columns}))\n    \
             {output}, state = session.run([\"{output}\", \"next_state\"],\n        \
             {{\"{input}\": readings.astype(np.{kind}), \"time_s\": np.array([[time_s]]), \"state\": state{row}}})\n\n\
             takes one sample at a time. Invalid readings give NaN, and the state stays.\n"
        );
    }
    let first = usize::from(contents.takes_row());
    format!(
        "{loaded}    readings = np.loadtxt(\"golden.csv\", delimiter=\",\", skiprows=1, ndmin=2)[:1, {first}:{}]\n    \
         {output} = session.run([\"{output}\"], {{\"{input}\": readings.astype(np.{kind}){row}}})[0]\n\n\
         Invalid readings and rows give NaN.\n",
        first + contents.channels(),
    )
}

/// Values of a constant of a graph that was written, which has its own name or that of all row-wires.
#[cfg(test)]
pub(super) fn initializer(bytes: &[u8], name: &str) -> Vec<f64> {
    use message::tests::{Field, fields};
    let of_rows = format!("{name}_of_rows");
    let graph = fields(bytes).into_iter().find(|(field, _)| *field == 7);
    let Some((_, Field::Bytes(graph))) = graph else {
        panic!("no graph");
    };
    let mut initializers = fields(graph).into_iter().filter(|(field, _)| *field == 5);
    let found = initializers.find_map(|(_, tensor)| {
        let Field::Bytes(tensor) = tensor else { return None };
        let get = |number| {
            fields(tensor)
                .into_iter()
                .find(|(field, _)| *field == number)
                .map(|(_, value)| value)
        };
        let is_named = [name, &of_rows]
            .map(|name| Some(Field::Bytes(name.as_bytes())))
            .contains(&get(8));
        match (is_named, get(2), get(9)) {
            (true, Some(Field::Int(kind)), Some(Field::Bytes(raw))) => Some((kind as i64, raw)),
            _ => None,
        }
    });
    let (kind, bytes) = found.unwrap_or_else(|| panic!("no {name}"));
    match kind == message::DOUBLE {
        true => bytes
            .as_chunks()
            .0
            .iter()
            .map(|bytes| f64::from_le_bytes(*bytes))
            .collect(),
        false => bytes
            .as_chunks()
            .0
            .iter()
            .map(|bytes| f64::from(f32::from_le_bytes(*bytes)))
            .collect(),
    }
}
