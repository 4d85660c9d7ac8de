use serde::{Deserialize, Serialize};

use super::{Precision, Program};
use crate::network::Networks;

/// What a choice of settings answers with: for each target a convex combination of decoders that were fitted to the training
/// samples, the network of the run among them. Its weights are those with the smallest held-out error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Combined {
    /// Weight of the network for each target.
    pub network: Vec<f64>,
    /// Other decoders, each with its weight for each target.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<(Program, Vec<f64>)>,
    /// Share of the range of each reading in training by which it is extended before readings are limited to it.
    pub margin: f64,
}

impl Combined {
    /// The combination with this network as a program. Its readings are limited to their range in training, extended by a
    /// margin.
    ///
    /// # Panics
    /// If the network has other channels or targets.
    pub(super) fn program(&self, networks: &Networks) -> Program {
        let network = self.network.iter().any(|weight| *weight > 0.0);
        let network = network.then(|| (networks.program(Precision::Double), self.network.clone()));
        let parts = Vec::from_iter(network.into_iter().chain(self.others.iter().cloned()));
        networks.clipped(self.margin, |_| Program::combination(&parts))
    }

    /// Describes the first part that does not match this number of readings and targets, for files.
    pub fn defect(&self, channels: usize, targets: usize) -> Option<String> {
        let weights = || std::iter::once(&self.network).chain(self.others.iter().map(|(_, weights)| weights));
        let is_sound = |weights: &Vec<f64>| {
            weights.len() == targets && weights.iter().all(|weight| *weight >= 0.0 && weight.is_finite())
        };
        if !(0.0..=10.0).contains(&self.margin) {
            return Some("the margin must be from 0 to 10".to_owned());
        }
        let has_answer = weights().flatten().any(|weight| *weight > 0.0);
        if !has_answer || !weights().all(is_sound) {
            return Some("there must be one weight of at least 0 for each target".to_owned());
        }
        self.others.iter().find_map(|(program, _)| {
            let sizes = (program.defect().is_none()).then(|| (program.channels(), program.outputs(), program.rows()));
            (sizes != Some((channels, targets, 1))).then(|| {
                program
                    .defect()
                    .unwrap_or("it has other readings or targets than the network".to_owned())
            })
        })
    }
}
