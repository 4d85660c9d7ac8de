use std::{fmt, ops::RangeInclusive};

use serde::{
    Deserialize, Deserializer, Serialize, Serializer,
    de::{
        MapAccess, SeqAccess, Visitor,
        value::{MapAccessDeserializer, SeqAccessDeserializer},
    },
};

use super::{InputScaling, Inputs, MinMax, Mlp, NetworkError, Quantity, Shape};
use crate::dataset::PerRow;

/// Trained networks: one shared by all row-wires read, or one per row-wire where the row is known.
///
/// In files, a single network is stored as itself and several as a list.
pub type Networks = PerRow<DecouplingNetwork>;

impl PerRow<DecouplingNetwork> {
    /// Total number of weights in all networks.
    pub fn weights(&self) -> usize {
        self.values().iter().map(|network| network.mlp().weights().len()).sum()
    }
}

impl Serialize for Networks {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.only() {
            Some(only) => only.serialize(serializer),
            None => self.values().serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Networks {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(OneOrMany)
    }
}

struct OneOrMany;

impl<'de> Visitor<'de> for OneOrMany {
    type Value = Networks;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a network or a list of networks")
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Networks, A::Error> {
        DecouplingNetwork::deserialize(MapAccessDeserializer::new(map)).map(Networks::shared)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, sequence: A) -> Result<Networks, A::Error> {
        let all = Vec::<DecouplingNetwork>::deserialize(SeqAccessDeserializer::new(sequence))?;
        let Some(first) = all.first() else {
            return Err(serde::de::Error::custom("the list of networks is empty"));
        };
        let shape = |network: &DecouplingNetwork| {
            let inputs = &network.inputs;
            (inputs.quantity(), inputs.channels(), network.outputs.channels())
        };
        if all.iter().any(|network| shape(network) != shape(first)) {
            return Err(serde::de::Error::custom(
                "the networks of the row-wires differ in their readings or targets",
            ));
        }
        Ok(Networks::each(all))
    }
}

/// Largest number of hidden nodes offered to the user.
pub const LARGEST_HIDDEN: usize = 512;

/// Returns the numbers of hidden nodes that the paper's rules of thumb suggest for n `inputs` and m `outputs`, rounded to
/// whole nodes: those of Eq. (12), n₁ = √(n+m) + a for a from 1 to 10, and that of Eq. (13), n₁ = log₂ n. They are a
/// starting point, not a bound.
pub fn suggested_hidden(inputs: usize, outputs: usize) -> (RangeInclusive<usize>, usize) {
    let root = ((inputs + outputs) as f64).sqrt();
    let square_root = (root + 1.0).round() as usize..=(root + 10.0).round() as usize;
    (square_root, ((inputs as f64).log2().round() as usize).max(1))
}

/// A network together with its scaling, from resistances in ohm to coordinates in millimetres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Record", into = "Record")]
pub struct DecouplingNetwork {
    inputs: Inputs,
    mlp: Mlp,
    outputs: MinMax,
}

impl DecouplingNetwork {
    /// Combines a network with the scaling it was trained with.
    ///
    /// # Panics
    /// If the inputs or outputs of the network do not match the scaling.
    pub fn new(inputs: Inputs, mlp: Mlp, outputs: MinMax) -> Self {
        assert_eq!(inputs.count(), mlp.shape().inputs);
        assert_eq!(outputs.varying().len(), mlp.shape().outputs);
        Self { inputs, mlp, outputs }
    }

    /// Returns the network without its scaling.
    pub fn mlp(&self) -> &Mlp {
        &self.mlp
    }

    /// Returns the preprocessing of the resistances.
    pub fn inputs(&self) -> &Inputs {
        &self.inputs
    }

    /// Returns the scaling of the coordinates.
    pub fn outputs(&self) -> &MinMax {
        &self.outputs
    }
}

/// File format of a network: one array per layer, row by row, biases last.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Record {
    #[serde(default)]
    input_quantity: Quantity,
    input_scaling: InputScaling,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    reading_range: Option<MinMax>,
    hidden_nodes: usize,
    /// (varying inputs + 1) × hidden nodes.
    hidden_layer: Vec<f64>,
    /// (hidden nodes + 1) × varying outputs.
    output_layer: Vec<f64>,
    output_scaling: MinMax,
}

impl From<DecouplingNetwork> for Record {
    fn from(network: DecouplingNetwork) -> Self {
        let (hidden_layer, output_layer) = network.mlp.layers();
        Self {
            hidden_nodes: network.mlp.shape().hidden,
            hidden_layer: hidden_layer.to_vec(),
            output_layer: output_layer.to_vec(),
            input_quantity: network.inputs.quantity(),
            input_scaling: network.inputs.scaling().clone(),
            reading_range: network.inputs.range().cloned(),
            output_scaling: network.outputs,
        }
    }
}

impl TryFrom<Record> for DecouplingNetwork {
    type Error = NetworkError;

    fn try_from(record: Record) -> Result<Self, NetworkError> {
        let inputs = Inputs::new(record.input_quantity, record.input_scaling, record.reading_range);
        if !inputs.is_valid() {
            return Err(NetworkError::DamagedScaling("input"));
        }
        if !record.output_scaling.is_valid() {
            return Err(NetworkError::DamagedScaling("output"));
        }
        let shape = Shape {
            inputs: inputs.count(),
            hidden: record.hidden_nodes,
            outputs: record.output_scaling.varying().len(),
        };
        let check = |layer, weights: &[f64], expected: Option<usize>| {
            let (found, expected) = (weights.len(), expected.unwrap_or(usize::MAX));
            if found != expected {
                return Err(NetworkError::LayerSize { layer, found, expected });
            }
            let wrong = weights.iter().position(|weight| !weight.is_finite());
            wrong.map_or(Ok(()), |index| Err(NetworkError::Weight { layer, index }))
        };
        let (of_hidden, of_outputs) = (shape.inputs + 1, shape.hidden.saturating_add(1));
        check("hidden", &record.hidden_layer, of_hidden.checked_mul(shape.hidden))?;
        check("output", &record.output_layer, of_outputs.checked_mul(shape.outputs))?;
        let mlp = Mlp::from_weights(shape, [record.hidden_layer, record.output_layer].concat());
        Ok(Self::new(inputs, mlp, record.output_scaling))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_array() {
        assert_eq!(suggested_hidden(30, 30), (9..=18, 5));
        assert_eq!(suggested_hidden(1, 3).1, 1);
    }
}
