use super::{
    schema::{Attribute, Graph, INT_ATTRIBUTE, Node},
    tensor::{Tensor, element_type},
};
use crate::export::bundle::weights::Digits;

/// A graph in the making. Values are named after what they are.
#[derive(Default)]
pub(super) struct GraphBuilder {
    graph: Graph,
}

impl GraphBuilder {
    /// Adds a constant and returns its name.
    pub(super) fn constant(&mut self, name: &str, tensor: &Tensor) -> String {
        self.graph.initializer.push(tensor.message(name));
        name.to_owned()
    }

    /// Adds an operation that computes the value `output`, and returns this name.
    pub(super) fn node(&mut self, operation: &str, inputs: &[&str], output: &str) -> String {
        self.add(operation, inputs, output, Vec::new())
    }

    /// Adds a conversion to numbers of these digits.
    pub(super) fn cast(&mut self, input: &str, digits: Digits, output: &str) -> String {
        self.cast_to(input, element_type(digits), output)
    }

    /// Adds a conversion to an element type.
    pub(super) fn cast_to(&mut self, input: &str, element_type: i32, output: &str) -> String {
        self.add("Cast", &[input], output, vec![whole("to", i64::from(element_type))])
    }

    /// Adds a sum over the axes in the constant `axes`, which are kept with size 1 or dropped.
    pub(super) fn sum(&mut self, input: &str, axes: &str, are_kept: bool, output: &str) -> String {
        let attribute = whole("keepdims", i64::from(are_kept));
        self.add("ReduceSum", &[input, axes], output, vec![attribute])
    }

    /// The graph so far.
    pub(super) fn build(self) -> Graph {
        self.graph
    }

    fn add(&mut self, operation: &str, inputs: &[&str], output: &str, attribute: Vec<Attribute>) -> String {
        self.graph.node.push(Node {
            input: inputs.iter().map(|&name| name.to_owned()).collect(),
            output: vec![output.to_owned()],
            name: format!("{output}_node"),
            op_type: operation.to_owned(),
            attribute,
        });
        output.to_owned()
    }
}

fn whole(name: &str, value: i64) -> Attribute {
    Attribute {
        name: name.to_owned(),
        i: Some(value),
        kind: INT_ATTRIBUTE,
    }
}
