use decoupler_core::decoupling::Precision;

use super::message::{DOUBLE, FLOAT, INT_ATTRIBUTE, INT64, Message};
use crate::export::bundle::contents::word;

/// Builder of a graph.
#[derive(Default)]
pub(super) struct GraphBuilder {
    pub(super) nodes: Vec<Message>,
    pub(super) initializers: Vec<Message>,
    count: usize,
}

/// ONNX type of numbers of this precision.
pub(super) fn element_type(precision: Precision) -> i64 {
    word(precision, [FLOAT, DOUBLE])
}

impl GraphBuilder {
    /// Adds constant numbers and returns their name.
    pub(super) fn numbers(
        &mut self,
        name: &str,
        precision: Precision,
        shape: &[usize],
        values: impl Iterator<Item = f64>,
    ) -> String {
        let raw_data = match precision {
            Precision::Single => values.flat_map(|value| (value as f32).to_le_bytes()).collect(),
            Precision::Double => values.flat_map(f64::to_le_bytes).collect(),
        };
        self.constant(name, element_type(precision), shape, raw_data)
    }

    /// Adds constant whole numbers and returns their name.
    pub(super) fn whole(&mut self, shape: &[usize], values: &[i64]) -> String {
        let name = self.fresh("whole");
        let raw_data = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.constant(&name, INT64, shape, raw_data)
    }

    /// Adds a constant scalar and returns its name.
    pub(super) fn scalar(&mut self, precision: Precision, value: f64) -> String {
        let name = self.fresh("constant");
        self.numbers(&name, precision, &[], std::iter::once(value))
    }

    fn constant(&mut self, name: &str, data_type: i64, shape: &[usize], raw_data: Vec<u8>) -> String {
        let dims = shape
            .iter()
            .fold(Message::default(), |tensor, &size| tensor.int(1, size as i64));
        let tensor = dims.int(2, data_type).bytes(8, name).bytes(9, raw_data);
        self.initializers.push(tensor);
        name.to_owned()
    }

    /// Adds an operation without a name of its own and returns that of its result.
    pub(super) fn op(&mut self, operation: &str, inputs: &[&str]) -> String {
        self.with(operation, inputs, &[])
    }

    /// Adds an operation with attributes that computes the value `output`, and returns that name.
    pub(super) fn named(
        &mut self,
        operation: &str,
        inputs: &[&str],
        attributes: &[(&str, i64)],
        output: &str,
    ) -> String {
        let attribute =
            |&(name, value): &(&str, i64)| Message::default().bytes(1, name).int(3, value).int(20, INT_ATTRIBUTE);
        let node = Message::default().all(1, inputs).bytes(2, output);
        let node = node.bytes(3, format!("{output}_node")).bytes(4, operation);
        self.nodes.push(node.all(5, attributes.iter().map(attribute)));
        output.to_owned()
    }

    /// Adds an operation with attributes and returns the name of its result.
    pub(super) fn with(&mut self, operation: &str, inputs: &[&str], attributes: &[(&str, i64)]) -> String {
        let name = self.fresh(&operation.to_lowercase());
        self.named(operation, inputs, attributes, &name)
    }

    /// Adds the rows in a range of a value; `axis` is the name of that of the rows.
    pub(super) fn rows(&mut self, of: &str, range: std::ops::Range<usize>, axis: &str) -> String {
        let [first, end] = [range.start, range.end].map(|row| self.whole(&[1], &[row as i64]));
        self.op("Slice", &[of, &first, &end, axis])
    }

    /// Adds the number of true values of each line, as whole numbers (batch × 1).
    pub(super) fn count(&mut self, condition: &str) -> String {
        let ones = self.with("Cast", &[condition], &[("to", INT64)]);
        let axes = self.whole(&[1], &[1]);
        self.with("ReduceSum", &[&ones, &axes], &[("keepdims", 1)])
    }

    /// A name that no other value has.
    fn fresh(&mut self, name: &str) -> String {
        self.count += 1;
        format!("{name}_{}_", self.count)
    }
}

/// An input or output of a graph; a size that is not given is that of the batch.
pub(super) fn value(name: &str, elem_type: i64, shape: &[Option<usize>], about: &str) -> Message {
    let dimension = |size: &Option<usize>| match size {
        Some(size) => Message::default().int(1, *size as i64),
        None => Message::default().bytes(2, "batch"),
    };
    let shape = Message::default().all(1, shape.iter().map(dimension));
    let tensor_type = Message::default().int(1, elem_type).bytes(2, shape);
    let kind = Message::default().bytes(1, tensor_type);
    Message::default().bytes(1, name).bytes(2, kind).bytes(3, about)
}
