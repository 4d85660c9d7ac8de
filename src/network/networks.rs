use std::fmt;

use ndarray::{Array2, ArrayView2, Axis};
use serde::{
    Deserialize, Deserializer, Serialize, Serializer,
    de::{MapAccess, SeqAccess, Visitor, value::MapAccessDeserializer},
};

use super::DecouplingNetwork;

/// The networks of a scene: one for every row-wire read, or one for each where the row is known.
///
/// In files a single network stands for itself and several are a list.
#[derive(Clone, Debug, PartialEq)]
pub struct Networks(Vec<DecouplingNetwork>);

impl From<DecouplingNetwork> for Networks {
    fn from(network: DecouplingNetwork) -> Self {
        Self(vec![network])
    }
}

impl Networks {
    /// One network for each row-wire read, or a single one for all.
    ///
    /// # Panics
    /// If there is none.
    pub fn new(networks: Vec<DecouplingNetwork>) -> Self {
        assert!(!networks.is_empty());
        Self(networks)
    }

    /// All of them.
    pub fn each(&self) -> &[DecouplingNetwork] {
        &self.0
    }

    /// The network of the row-wire in this place of those read.
    pub fn of_place(&self, place: usize) -> &DecouplingNetwork {
        &self.0[place % self.0.len()]
    }

    /// Weights of all of them together.
    pub fn weights(&self) -> usize {
        self.0.iter().map(|network| network.mlp().weights().len()).sum()
    }

    /// Coordinates in millimetres (samples × 3·M2) from resistances in ohm (samples × M4). Where each row-wire has a
    /// network of its own, samples are whole snapshots, in each the rows from first to last.
    pub fn decouple(&self, resistances_ohm: ArrayView2<'_, f64>) -> Array2<f64> {
        if let [only] = &self.0[..] {
            return only.decouple(resistances_ohm);
        }
        let coordinates = self.0[0].outputs().channels();
        let mut all_mm = Array2::zeros((resistances_ohm.nrows(), coordinates));
        for (place, network) in self.0.iter().enumerate() {
            let samples: Vec<usize> = (place..resistances_ohm.nrows()).step_by(self.0.len()).collect();
            let decoupled_mm = network.decouple(resistances_ohm.select(Axis(0), &samples).view());
            for (&sample, row) in samples.iter().zip(decoupled_mm.rows()) {
                all_mm.row_mut(sample).assign(&row);
            }
        }
        all_mm
    }
}

impl Serialize for Networks {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.0[..] {
            [only] => only.serialize(serializer),
            all => all.serialize(serializer),
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
        DecouplingNetwork::deserialize(MapAccessDeserializer::new(map)).map(Networks::from)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Networks, A::Error> {
        let mut all = Vec::new();
        while let Some(network) = sequence.next_element()? {
            all.push(network);
        }
        if all.is_empty() {
            return Err(serde::de::Error::custom("there is no network in the list"));
        }
        Ok(Networks(all))
    }
}
