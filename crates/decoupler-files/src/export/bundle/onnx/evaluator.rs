use std::collections::HashMap;

use super::{
    operations::{affine_product, binary, cast, gather, only_axis, reduce_sum, reshape, select, softmax, unary},
    schema::{BOOL, DOUBLE, FLOAT, Graph, INT64, Node, TensorData},
};
use crate::export::bundle::weights::Digits;

/// Evaluates the operations that our graphs consist of, in the arithmetic of their element types.
///
/// # Errors
/// A description of the first value that is missing, or operation that is not known or does not fit its inputs.
pub(super) fn evaluate(graph: &Graph, inputs: Vec<(String, Tensor)>) -> Result<HashMap<String, Tensor>, String> {
    let mut values: HashMap<String, Tensor> = inputs.into_iter().collect();
    for constant in &graph.initializer {
        values.insert(constant.name.clone(), Tensor::read(constant)?);
    }
    for node in &graph.node {
        let input = |index: usize| {
            let name = node
                .input
                .get(index)
                .ok_or_else(|| format!("{} lacks an input", node.name))?;
            let value = values.get(name);
            value.ok_or_else(|| format!("{} needs '{name}', which is not computed before", node.name))
        };
        let value = apply(node, input).map_err(|defect| format!("{}: {defect}", node.name))?;
        let [output] = &node.output[..] else {
            return Err(format!("{} has not one output", node.name));
        };
        values.insert(output.clone(), value);
    }
    Ok(values)
}

fn apply<'a>(node: &Node, input: impl Fn(usize) -> Result<&'a Tensor, String>) -> Result<Tensor, String> {
    let attribute = |name: &str| {
        let mut all = node.attribute.iter();
        let found = all.find(|attribute| attribute.name == name);
        found
            .and_then(|attribute| attribute.i)
            .ok_or_else(|| format!("there is no attribute {name}"))
    };
    match node.op_type.as_str() {
        "Add" | "Sub" | "Mul" | "Div" | "Greater" | "GreaterOrEqual" | "Less" | "LessOrEqual" | "Equal" | "And" => {
            binary(&node.op_type, input(0)?, input(1)?)
        }
        "Neg" | "Log" | "Exp" | "Tanh" | "Not" | "Abs" => unary(&node.op_type, input(0)?),
        "Where" => select(input(0)?, input(1)?, input(2)?),
        "Cast" => cast(input(0)?, attribute("to")?),
        "Gather" => gather(input(0)?, input(1)?),
        "MatMul" => affine_product(input(0)?, input(1)?),
        "ReduceSum" => reduce_sum(input(0)?, attribute("keepdims")? == 1),
        "Unsqueeze" => {
            let tensor = input(0)?;
            let mut shape = tensor.shape.clone();
            let axis = only_axis(input(1)?)?;
            shape.insert(axis.min(shape.len()), 1);
            Ok(Tensor {
                shape,
                ..tensor.clone()
            })
        }
        "Squeeze" => {
            let tensor = input(0)?;
            let mut shape = tensor.shape.clone();
            if shape.get(1) != Some(&1) {
                return Err("the axis to drop has not the size 1".to_owned());
            }
            shape.remove(1);
            Ok(Tensor {
                shape,
                ..tensor.clone()
            })
        }
        "Softmax" => softmax(input(0)?),
        "Reshape" => reshape(input(0)?, input(1)?),
        other => Err(format!("the operation {other} is not known")),
    }
}

/// An array of any number of dimensions, row by row.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tensor {
    pub(super) shape: Vec<usize>,
    pub(super) values: Values,
}

/// Elements of a tensor.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    Real(Digits, Vec<f64>),
    Int(Vec<i64>),
    Bool(Vec<bool>),
}

impl Tensor {
    pub(super) fn real(digits: Digits, shape: impl Into<Vec<usize>>, values: Vec<f64>) -> Self {
        Self {
            shape: shape.into(),
            values: Values::Real(digits, values),
        }
    }

    pub(super) fn int(shape: impl Into<Vec<usize>>, values: Vec<i64>) -> Self {
        Self {
            shape: shape.into(),
            values: Values::Int(values),
        }
    }

    /// Writes it as a message.
    pub(super) fn message(&self, name: &str) -> TensorData {
        let raw_data = match &self.values {
            Values::Real(Digits::Double, values) => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
            Values::Real(Digits::Single, values) => {
                values.iter().flat_map(|&value| (value as f32).to_le_bytes()).collect()
            }
            Values::Int(values) => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
            Values::Bool(values) => values.iter().map(|&value| u8::from(value)).collect(),
        };
        TensorData {
            dims: self.shape.iter().map(|&size| size as i64).collect(),
            data_type: match self.values {
                Values::Real(digits, _) => element_type(digits),
                Values::Int(_) => INT64,
                Values::Bool(_) => BOOL,
            },
            name: name.to_owned(),
            raw_data,
        }
    }

    /// Reads a message.
    ///
    /// # Errors
    /// A description of the damage.
    pub(super) fn read(message: &TensorData) -> Result<Self, String> {
        let bytes = &message.raw_data;
        let shape: Vec<usize> = message
            .dims
            .iter()
            .map(|&size| usize::try_from(size).unwrap_or(0))
            .collect();
        let (values, count) = match message.data_type {
            FLOAT => {
                let values: Vec<_> = chunks::<4>(bytes)
                    .map(|bytes| f64::from(f32::from_le_bytes(bytes)))
                    .collect();
                (Values::Real(Digits::Single, values.clone()), values.len() * 4)
            }
            DOUBLE => {
                let values: Vec<_> = chunks::<8>(bytes).map(f64::from_le_bytes).collect();
                (Values::Real(Digits::Double, values.clone()), values.len() * 8)
            }
            INT64 => {
                let values: Vec<_> = chunks::<8>(bytes).map(i64::from_le_bytes).collect();
                (Values::Int(values.clone()), values.len() * 8)
            }
            other => return Err(format!("tensor '{}' has elements of type {other}", message.name)),
        };
        let tensor = Self { shape, values };
        if count == bytes.len() && tensor.len() == tensor.shape.iter().product::<usize>() {
            Ok(tensor)
        } else {
            Err(format!(
                "tensor '{}' has not as many elements as its shape",
                message.name
            ))
        }
    }

    pub(super) fn len(&self) -> usize {
        match &self.values {
            Values::Real(_, values) => values.len(),
            Values::Int(values) => values.len(),
            Values::Bool(values) => values.len(),
        }
    }
}

/// Number of an element type.
pub(super) fn element_type(digits: Digits) -> i32 {
    match digits {
        Digits::Single => FLOAT,
        Digits::Double => DOUBLE,
    }
}

fn chunks<const N: usize>(bytes: &[u8]) -> impl Iterator<Item = [u8; N]> + '_ {
    bytes.as_chunks::<N>().0.iter().copied()
}
