use decoupler_core::decoupling::Precision;

use super::schema::{
    Attribute, BOOL, DOUBLE, Dimension, FLOAT, Graph, INT_ATTRIBUTE, INT64, Node, TensorData, TensorShape, TensorType,
    TypeOfValue, ValueInfo,
};

/// Builder of a graph.
#[derive(Default)]
pub(super) struct GraphBuilder {
    pub(super) graph: Graph,
    count: usize,
}

/// ONNX type of numbers of this precision.
pub(super) fn element_type(precision: Precision) -> i32 {
    match precision {
        Precision::Single => FLOAT,
        Precision::Double => DOUBLE,
    }
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

    fn constant(&mut self, name: &str, data_type: i32, shape: &[usize], raw_data: Vec<u8>) -> String {
        self.graph.initializer.push(TensorData {
            dims: shape.iter().map(|&size| size as i64).collect(),
            data_type,
            name: name.to_owned(),
            raw_data,
        });
        name.to_owned()
    }

    /// Adds an operation without a name of its own and returns that of its result.
    pub(super) fn op(&mut self, operation: &str, inputs: &[&str]) -> String {
        let name = self.fresh(&operation.to_lowercase());
        self.named(operation, inputs, &[], &name)
    }

    /// Adds an operation with attributes that computes the value `output`, and returns that name.
    pub(super) fn named(
        &mut self,
        operation: &str,
        inputs: &[&str],
        attributes: &[(&str, i64)],
        output: &str,
    ) -> String {
        let attribute = attributes.iter().map(|&(name, value)| Attribute {
            name: name.to_owned(),
            i: Some(value),
            kind: INT_ATTRIBUTE,
        });
        self.graph.node.push(Node {
            input: inputs.iter().map(|&name| name.to_owned()).collect(),
            output: vec![output.to_owned()],
            name: format!("{output}_node"),
            op_type: operation.to_owned(),
            attribute: attribute.collect(),
        });
        output.to_owned()
    }

    /// Adds an operation with attributes and returns the name of its result.
    pub(super) fn with(&mut self, operation: &str, inputs: &[&str], attributes: &[(&str, i64)]) -> String {
        let name = self.fresh(&operation.to_lowercase());
        self.named(operation, inputs, attributes, &name)
    }

    /// Adds a conversion to numbers of this precision.
    pub(super) fn cast(&mut self, input: &str, precision: Precision) -> String {
        self.with("Cast", &[input], &[("to", i64::from(element_type(precision)))])
    }

    /// Adds a sum over the second axis, which is kept with size 1 or dropped.
    pub(super) fn sum(&mut self, input: &str, is_kept: bool) -> String {
        let axes = self.whole(&[1], &[1]);
        self.with("ReduceSum", &[input, &axes], &[("keepdims", i64::from(is_kept))])
    }

    /// Adds the number of true values of each line, as whole numbers.
    pub(super) fn count(&mut self, condition: &str, is_kept: bool) -> String {
        let ones = self.with("Cast", &[condition], &[("to", i64::from(INT64))]);
        self.sum(&ones, is_kept)
    }

    /// A name that no other value has.
    fn fresh(&mut self, name: &str) -> String {
        self.count += 1;
        format!("{name}_{}_", self.count)
    }
}

/// A size of a tensor, or its name.
pub(super) fn dimension(size: Option<usize>) -> Dimension {
    Dimension {
        dim_value: size.map(|size| size as i64),
        dim_param: size.is_none().then(|| "batch".to_owned()),
    }
}

/// An input or output of a graph.
pub(super) fn value(name: &str, elem_type: i32, shape: &[Option<usize>], doc_string: String) -> ValueInfo {
    debug_assert_ne!(elem_type, BOOL);
    ValueInfo {
        name: name.to_owned(),
        kind: Some(TypeOfValue {
            tensor_type: Some(TensorType {
                elem_type,
                shape: Some(TensorShape {
                    dim: shape.iter().map(|&size| dimension(size)).collect(),
                }),
            }),
        }),
        doc_string,
    }
}
