use std::{fmt, ops::RangeInclusive};

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

/// Largest number of hidden nodes offered to the user.
pub const LARGEST_HIDDEN: usize = 512;

/// Numbers of hidden nodes suggested by the paper's rules of thumb; a starting point, not a bound.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HiddenSuggestions {
    /// Eq. (12): n₁ = √(n+m) + a, for a from 1 to 10.
    pub square_root: RangeInclusive<usize>,
    /// Eq. (13): n₁ = log₂ n.
    pub logarithm: usize,
}

impl HiddenSuggestions {
    /// Computes the suggestions for n `inputs` and m `outputs`, rounded to whole nodes.
    pub fn new(inputs: usize, outputs: usize) -> Self {
        let root = ((inputs + outputs) as f64).sqrt();
        Self {
            square_root: (root + 1.0).round() as usize..=(root + 10.0).round() as usize,
            logarithm: ((inputs as f64).log2().round() as usize).max(1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_array() {
        let suggestions = HiddenSuggestions::new(30, 30);
        assert_eq!(
            suggestions,
            HiddenSuggestions {
                square_root: 9..=18,
                logarithm: 5
            }
        );
        assert_eq!(HiddenSuggestions::new(1, 3).logarithm, 1);
    }
}
