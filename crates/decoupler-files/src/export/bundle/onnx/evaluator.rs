//! The operations of the ONNX specification, opset 13, that exported graphs use.

use std::collections::HashMap;

use super::schema::{BOOL, DOUBLE, FLOAT, Graph, INT64, Node, TensorData};
use crate::export::bundle::weights::Digits;

/// Evaluates the operations of exported graphs in the arithmetic of their element types.
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
            return Err(format!("{} does not have exactly one output", node.name));
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
                return Err("the axis to drop does not have size 1".to_owned());
            }
            shape.remove(1);
            Ok(Tensor {
                shape,
                ..tensor.clone()
            })
        }
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
                "tensor '{}' does not have as many elements as its shape",
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

type Outcome = Result<Tensor, String>;

/// Applies an operation to each element.
pub(super) fn unary(operation: &str, tensor: &Tensor) -> Outcome {
    let values = match (&tensor.values, operation) {
        (Values::Bool(values), "Not") => Values::Bool(values.iter().map(|value| !value).collect()),
        (Values::Real(digits, values), _) => {
            let of = |value: f64| match operation {
                "Neg" => Some(-value),
                "Abs" => Some(value.abs()),
                "Log" => Some(libm::log(value)),
                "Exp" => Some(libm::exp(value)),
                "Tanh" => Some(libm::tanh(value)),
                _ => None,
            };
            let all = values.iter().map(|&value| of(value).map(|value| digits.round(value)));
            Values::Real(
                *digits,
                all.collect::<Option<_>>().ok_or("no such operation on numbers")?,
            )
        }
        _ => return Err("it does not fit its elements".to_owned()),
    };
    Ok(Tensor {
        shape: tensor.shape.clone(),
        values,
    })
}

/// Applies an operation to pairs of elements, of shapes that broadcast.
pub(super) fn binary(operation: &str, left: &Tensor, right: &Tensor) -> Outcome {
    let (shape, pairs) = broadcast(&[left, right])?;
    let index = |side: usize| pairs.iter().map(move |indices| indices[side]);
    let values = match (&left.values, &right.values) {
        (Values::Real(digits, a), Values::Real(other, b)) if digits == other => {
            let pairs = index(0).zip(index(1)).map(|(i, j)| (a[i], b[j]));
            match operation {
                "Add" => Values::Real(*digits, pairs.map(|(a, b)| digits.round(a + b)).collect()),
                "Sub" => Values::Real(*digits, pairs.map(|(a, b)| digits.round(a - b)).collect()),
                "Mul" => Values::Real(*digits, pairs.map(|(a, b)| digits.round(a * b)).collect()),
                "Div" => Values::Real(*digits, pairs.map(|(a, b)| digits.round(a / b)).collect()),
                _ => Values::Bool(compare(operation, pairs)?),
            }
        }
        (Values::Int(a), Values::Int(b)) => {
            let pairs = index(0).zip(index(1)).map(|(i, j)| (a[i], b[j]));
            match operation {
                "Sub" => Values::Int(pairs.map(|(a, b)| a.wrapping_sub(b)).collect()),
                _ => Values::Bool(compare(operation, pairs)?),
            }
        }
        (Values::Bool(a), Values::Bool(b)) if operation == "And" => {
            Values::Bool(index(0).zip(index(1)).map(|(i, j)| a[i] && b[j]).collect())
        }
        _ => return Err("the elements are of different types".to_owned()),
    };
    Ok(Tensor { shape, values })
}

fn compare<T: PartialOrd>(operation: &str, pairs: impl Iterator<Item = (T, T)>) -> Result<Vec<bool>, String> {
    let of: fn(&T, &T) -> bool = match operation {
        "Greater" => |a, b| a > b,
        "GreaterOrEqual" => |a, b| a >= b,
        "Less" => |a, b| a < b,
        "LessOrEqual" => |a, b| a <= b,
        "Equal" => |a, b| a == b,
        _ => return Err("no such operation on these elements".to_owned()),
    };
    Ok(pairs.map(|(a, b)| of(&a, &b)).collect())
}

/// Selects each element from `yes` or `no`.
pub(super) fn select(condition: &Tensor, yes: &Tensor, no: &Tensor) -> Outcome {
    let (shape, all) = broadcast(&[condition, yes, no])?;
    let Values::Bool(condition) = &condition.values else {
        return Err("the condition is not Boolean".to_owned());
    };
    let values = match (&yes.values, &no.values) {
        (Values::Real(digits, yes), Values::Real(other, no)) if digits == other => {
            let of = |at: &Vec<usize>| if condition[at[0]] { yes[at[1]] } else { no[at[2]] };
            Values::Real(*digits, all.iter().map(of).collect())
        }
        (Values::Int(yes), Values::Int(no)) => {
            let of = |at: &Vec<usize>| if condition[at[0]] { yes[at[1]] } else { no[at[2]] };
            Values::Int(all.iter().map(of).collect())
        }
        _ => return Err("the elements are of different types".to_owned()),
    };
    Ok(Tensor { shape, values })
}

/// Converts elements to another type.
pub(super) fn cast(tensor: &Tensor, element_type: i64) -> Outcome {
    let to = i32::try_from(element_type).unwrap_or(0);
    let digits = if to == FLOAT { Digits::Single } else { Digits::Double };
    let values = match &tensor.values {
        Values::Real(_, values) if [FLOAT, DOUBLE].contains(&to) => {
            Values::Real(digits, values.iter().map(|&value| digits.round(value)).collect())
        }
        Values::Bool(values) if to == INT64 => Values::Int(values.iter().map(|&value| i64::from(value)).collect()),
        Values::Bool(_) if to == BOOL => tensor.values.clone(),
        _ => return Err(format!("no conversion to type {to}")),
    };
    Ok(Tensor {
        shape: tensor.shape.clone(),
        values,
    })
}

/// Selects the slices of `table` along its first axis at `indices` (batch).
pub(super) fn gather(table: &Tensor, indices: &Tensor) -> Outcome {
    let (Values::Real(digits, values), Values::Int(indices)) = (&table.values, &indices.values) else {
        return Err("it does not fit its elements".to_owned());
    };
    let (&rows, rest) = table.shape.split_first().ok_or("the table has no axis")?;
    let size: usize = rest.iter().product();
    let mut gathered = Vec::with_capacity(indices.len() * size);
    for &index in indices {
        let row = usize::try_from(index).ok().filter(|&row| row < rows);
        let row = row.ok_or_else(|| format!("there is no index {index}"))?;
        gathered.extend(&values[row * size..][..size]);
    }
    Ok(Tensor::real(*digits, [&[indices.len()], rest].concat(), gathered))
}

/// Matrix product: n × k with k × m, or batches of both.
pub(super) fn affine_product(left: &Tensor, right: &Tensor) -> Outcome {
    let (Values::Real(digits, a), Values::Real(other, b)) = (&left.values, &right.values) else {
        return Err("it does not fit its elements".to_owned());
    };
    let (batches, [n, k], [k_right, m]) = match (&left.shape[..], &right.shape[..]) {
        (&[n, k], &[k_right, m]) => (1, [n, k], [k_right, m]),
        (&[of_left, n, k], &[of_right, k_right, m]) if of_left == of_right => (of_left, [n, k], [k_right, m]),
        _ => return Err("the shapes do not fit".to_owned()),
    };
    if k != k_right || digits != other {
        return Err("the shapes or types do not fit".to_owned());
    }
    let mut product = Vec::with_capacity(batches * n * m);
    for batch in 0..batches {
        for row in 0..n {
            let left = &a[(batch * n + row) * k..][..k];
            for column in 0..m {
                let mut sum = 0.0;
                for (i, value) in left.iter().enumerate() {
                    sum = digits.round(sum + digits.round(value * b[(batch * k + i) * m + column]));
                }
                product.push(sum);
            }
        }
    }
    let mut shape = left.shape.clone();
    shape.pop();
    shape.push(m);
    Ok(Tensor::real(*digits, shape, product))
}

/// Sums over the second axis, which is kept with size 1 or dropped.
pub(super) fn reduce_sum(tensor: &Tensor, is_kept: bool) -> Outcome {
    let [rows, columns, ref rest @ ..] = tensor.shape[..] else {
        return Err("there is no second axis".to_owned());
    };
    let inner: usize = rest.iter().product();
    let places = |row: usize, place: usize| (0..columns).map(move |column| (row * columns + column) * inner + place);
    let sums = (0..rows).flat_map(|row| (0..inner).map(move |place| (row, place)));
    let values = match &tensor.values {
        Values::Int(values) => Values::Int(sums.map(|(r, p)| places(r, p).map(|at| values[at]).sum()).collect()),
        Values::Real(digits, values) => {
            let sum = |(r, p)| places(r, p).fold(0.0, |sum, at| digits.round(sum + values[at]));
            Values::Real(*digits, sums.map(sum).collect())
        }
        Values::Bool(_) => return Err("conditions have no sum".to_owned()),
    };
    let kept: &[usize] = if is_kept { &[1] } else { &[] };
    Ok(Tensor {
        shape: [&[rows], kept, rest].concat(),
        values,
    })
}

/// Reshapes the elements; a size of 0 keeps the original size.
pub(super) fn reshape(tensor: &Tensor, sizes: &Tensor) -> Outcome {
    let Values::Int(sizes) = &sizes.values else {
        return Err("the shape is not a list of integers".to_owned());
    };
    let size = |(axis, &size): (usize, &i64)| match size {
        0 => tensor.shape.get(axis).copied().unwrap_or(0),
        _ => usize::try_from(size).unwrap_or(0),
    };
    let shape: Vec<usize> = sizes.iter().enumerate().map(size).collect();
    if shape.iter().product::<usize>() != tensor.len() {
        return Err("the shape has another number of elements".to_owned());
    }
    Ok(Tensor {
        shape,
        values: tensor.values.clone(),
    })
}

/// Returns the only axis of a list.
pub(super) fn only_axis(axes: &Tensor) -> Result<usize, String> {
    match &axes.values {
        Values::Int(axes) if axes.len() == 1 => usize::try_from(axes[0]).map_err(|error| error.to_string()),
        _ => Err("there is not exactly one axis".to_owned()),
    }
}

/// Returns the common shape, and for each of its elements the indices into the tensors.
fn broadcast(tensors: &[&Tensor]) -> Result<(Vec<usize>, Vec<Vec<usize>>), String> {
    let dimensions = tensors.iter().map(|tensor| tensor.shape.len()).max().unwrap_or(0);
    let size = |tensor: &Tensor, axis: usize| {
        let missing = dimensions - tensor.shape.len();
        if axis < missing {
            1
        } else {
            tensor.shape[axis - missing]
        }
    };
    let mut shape = Vec::new();
    for axis in 0..dimensions {
        let sizes = tensors.iter().map(|tensor| size(tensor, axis));
        let common = sizes.clone().find(|&size| size != 1).unwrap_or(1);
        if sizes.into_iter().any(|size| size != 1 && size != common) {
            return Err("the shapes do not broadcast".to_owned());
        }
        shape.push(common);
    }
    let mut indices = Vec::new();
    for element in 0..shape.iter().product() {
        let of_tensor = |tensor: &&Tensor| {
            let (mut rest, mut index, mut stride) = (element, 0, 1);
            for axis in (0..dimensions).rev() {
                let (at, own) = (rest % shape[axis], size(tensor, axis));
                rest /= shape[axis];
                index += if own == 1 { 0 } else { at * stride };
                stride *= own;
            }
            index
        };
        indices.push(tensors.iter().map(of_tensor).collect());
    }
    Ok((shape, indices))
}
