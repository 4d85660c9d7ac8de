use decoupler_core::{
    dataset::{Memory, Simulation},
    problem::{Channel, Problem, TargetPosition},
};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Layout of a [`Problem`] that is saved next to the settings of a run, which contain its sensor: it contains only whether there
/// is one. The sensor that is read is therefore the default one, to be replaced by that of the settings.
#[derive(Serialize, Deserialize)]
#[serde(remote = "Problem", deny_unknown_fields)]
pub struct SavedProblem {
    inputs: Vec<Channel>,
    targets: Vec<Channel>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    memory: Option<Memory>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    positions: Vec<TargetPosition>,
    #[serde(
        default,
        rename = "has_nodes",
        serialize_with = "is_known",
        deserialize_with = "default_if_known"
    )]
    sensor: Option<Simulation>,
}

fn is_known<S: Serializer>(sensor: &Option<Simulation>, serializer: S) -> Result<S::Ok, S::Error> {
    sensor.is_some().serialize(serializer)
}

fn default_if_known<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Simulation>, D::Error> {
    Ok(bool::deserialize(deserializer)?.then(Simulation::default))
}
