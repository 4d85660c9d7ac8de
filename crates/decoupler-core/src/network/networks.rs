use std::fmt;

use ndarray::Array2;
use serde::{
    Deserialize, Deserializer, Serialize, Serializer,
    de::{MapAccess, SeqAccess, Visitor, value::MapAccessDeserializer},
};

use super::DecouplingNetwork;
use crate::dataset::{Dataset, PerRow};

/// Trained networks: one shared by all row-wires read, or one per row-wire where the row is known.
///
/// In files, a single network is stored as itself and several as a list.
pub type Networks = PerRow<DecouplingNetwork>;

impl PerRow<DecouplingNetwork> {
    /// Total number of weights in all networks.
    pub fn weights(&self) -> usize {
        self.values().iter().map(|network| network.mlp().weights().len()).sum()
    }

    /// Decodes each sample of `set` with the network of its row-wire. Returns samples × outputs, in the units of the
    /// targets.
    ///
    /// # Panics
    /// If the set has another number of channels, or a row-wire without a network.
    pub fn decouple(&self, set: &Dataset) -> Array2<f64> {
        if let Some(only) = self.only() {
            return only.decouple(set.readings());
        }
        let outputs = self.at(0).outputs().channels();
        let mut answers = Array2::zeros((set.samples(), outputs));
        for row_index in 0..set.row_count() {
            let of_row = self.at(row_index).decouple(set.of_row(row_index).readings());
            let samples = (0..set.samples()).filter(|&sample| set.row_index(sample) == row_index);
            for (sample, answer) in samples.zip(of_row.rows()) {
                answers.row_mut(sample).assign(&answer);
            }
        }
        answers
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

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Networks, A::Error> {
        let mut all = Vec::new();
        while let Some(network) = sequence.next_element()? {
            all.push(network);
        }
        if all.is_empty() {
            return Err(serde::de::Error::custom("there is no network in the list"));
        }
        Ok(Networks::each(all))
    }
}
