//! Bundles as ONNX graphs (opset 13), which are read back and evaluated.
//!
//! | input | shape | type |
//! |---|---|---|
//! | `resistances_ohm`, or `readings` of own data | batch × M4 | float or double |
//! | `row`, for networks of known rows | batch | int64, from 1 |
//!
//! | output | shape | type |
//! |---|---|---|
//! | `coordinates_mm`, or `targets` | batch × 3·M2 | as the input; NaN where a reading or the row is invalid |
//! | `readings_outside`, if the range in training is known | batch | int64 |

mod evaluator;
mod schema;
mod stream;
mod writer;

use prost::Message;

use self::{evaluator::evaluate, schema::Model};
use super::{
    choice::BundlePrecision,
    folder::{Call, Draft},
    report::{BundleCheck, BundleError},
    vectors::Vector,
    weights::Digits,
};
use decoupler_core::network::Quantity;
use evaluator::{Tensor, Values};

pub(super) use self::{
    stream::{StreamGraph, StreamParts},
    writer::write,
};

/// A graph that was read back.
pub(super) struct OnnxGraph {
    graph: schema::Graph,
    digits: Digits,
}

/// The outputs of a graph.
pub(super) struct OnnxAnswers {
    pub(super) answers: Vec<Vec<f64>>,
    pub(super) readings_outside: Option<Vec<i64>>,
}

impl OnnxGraph {
    /// Reads a file.
    ///
    /// # Errors
    /// A description of the damage.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, String> {
        let model = Model::decode(bytes).map_err(|error| error.to_string())?;
        let graph = model.graph.ok_or("there is no graph in it")?;
        let input = graph
            .input
            .first()
            .and_then(|input| input.kind.as_ref()?.tensor_type.as_ref());
        let digits = match input.map(|kind| kind.elem_type) {
            Some(schema::FLOAT) => Digits::Single,
            Some(schema::DOUBLE) => Digits::Double,
            _ => return Err("its first input is not of numbers".to_owned()),
        };
        Ok(Self { graph, digits })
    }

    /// Evaluates all vectors in batches; all values of a batch are in memory at once.
    ///
    /// # Errors
    /// A description of the first operation that fails.
    pub(super) fn decode(&self, vectors: &[Vector]) -> Result<OnnxAnswers, String> {
        /// Vectors of a batch.
        const BATCH: usize = 100;
        let mut all = OnnxAnswers {
            answers: Vec::new(),
            readings_outside: Some(Vec::new()),
        };
        for batch in vectors.chunks(BATCH) {
            let of_batch = self.decode_batch(batch)?;
            all.answers.extend(of_batch.answers);
            let outside = all.readings_outside.zip(of_batch.readings_outside);
            all.readings_outside = outside.map(|(all, of_batch)| [all, of_batch].concat());
        }
        Ok(all)
    }

    fn decode_batch(&self, vectors: &[Vector]) -> Result<OnnxAnswers, String> {
        let channels = vectors.first().map_or(0, |vector| vector.readings.len());
        let readings = vectors.iter().flat_map(|vector| &vector.readings);
        let readings = readings.map(|&ohm| self.digits.round(ohm)).collect();
        let name = |values: &[schema::ValueInfo]| values.first().map(|value| value.name.clone()).unwrap_or_default();
        let mut inputs = vec![(
            name(&self.graph.input),
            Tensor::real(self.digits, [vectors.len(), channels], readings),
        )];
        if self.graph.input.len() > 1 {
            let rows = vectors.iter().map(|vector| vector.row as i64 + 1).collect();
            inputs.push(("row".to_owned(), Tensor::int([vectors.len()], rows)));
        }
        let mut values = evaluate(&self.graph, inputs)?;
        let found = values.remove(&name(&self.graph.output));
        let answers = match found.map(|tensor| (tensor.shape, tensor.values)) {
            Some((shape, Values::Real(_, values))) if shape.len() == 2 => {
                values.chunks(shape[1].max(1)).map(<[f64]>::to_vec).collect()
            }
            _ => return Err("there are no outputs".to_owned()),
        };
        let readings_outside = match values.remove("readings_outside").map(|tensor| tensor.values) {
            Some(Values::Int(outside)) => Some(outside),
            _ => None,
        };
        Ok(OnnxAnswers {
            answers,
            readings_outside,
        })
    }
}

/// Writes the graph, reads it back and evaluates it.
///
/// # Errors
/// It cannot be written, read back or evaluated.
pub(super) fn export(draft: &mut Draft<'_>) -> Result<Vec<BundleCheck>, BundleError> {
    let file = format!("{}.onnx", draft.portable.decoder);
    let damaged = |reason| BundleError::read_back(&file, reason);
    let bytes = draft.write(
        &file,
        write(draft.portable, draft.weights, draft.metadata, draft.remarks),
    )?;
    let graph = OnnxGraph::read(&bytes).map_err(damaged)?;
    let answers = graph.decode(draft.vectors.all()).map_err(damaged)?.answers;
    if answers.len() != draft.vectors.all().len() {
        return Err(damaged("it has a different number of answers".to_owned()));
    }
    let mut answers = answers.into_iter();
    let deviation = draft.vectors.deviation(|_| answers.next().unwrap_or_default());
    Ok(vec![BundleCheck::of("ONNX graph, read back and evaluated", deviation)])
}

/// Returns the usage section of the README.
pub(super) fn call(call: &Call<'_>) -> String {
    let portable = call.portable;
    let (takes_row, channels, outputs) = (portable.takes_row(), portable.channels, portable.outputs);
    let meaning = &portable.meaning;
    let (input, output) = (meaning.readings(), meaning.outputs());
    let kind = if call.precision == BundlePrecision::Single {
        "float32"
    } else {
        "float64"
    };
    let row = if takes_row {
        ", \"row\": np.array([1], np.int64)"
    } else {
        ""
    };
    format!(
        "    import numpy as np\n    import onnxruntime\n    \
         session = onnxruntime.InferenceSession(\"{noun}.onnx\")\n    \
         readings = np.loadtxt(\"golden.csv\", delimiter=\",\", skiprows=1, ndmin=2)[:1, {first}:{end}]\n    \
         inputs = {{\"{input}\": readings.astype(np.{kind}){row}}}\n    \
         {output} = session.run([\"{output}\"], inputs)[0]\n\n\
         {input} is batch x {channels}, {output} batch x {outputs}; where a reading is not a finite \
         number{above}{row_text},\nthe {one}s are NaN. A second output, readings_outside, counts the readings \
         of each line beyond the range\nseen in training.",
        above = if portable.quantity == Quantity::Raw {
            ""
        } else {
            " above 0"
        },
        one = meaning.output(),
        noun = portable.decoder,
        first = usize::from(takes_row),
        end = channels + usize::from(takes_row),
        row_text = if takes_row { ", or the row does not exist" } else { "" },
    )
}
