use std::collections::HashMap;

use super::{
    operations::{affine_product, binary, cast, gather, only_axis, reduce_sum, reshape, select, softmax, unary},
    schema::{Graph, Node},
    tensor::Tensor,
};

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
