use decoupler_core::{
    dataset::{Memory, Simulation},
    problem::{Channel, Problem, TargetPosition},
};
use serde::{Deserialize, Serialize};

/// A [`Problem`] as it is saved next to the settings of a run, which contain its sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SavedProblem {
    inputs: Vec<Channel>,
    targets: Vec<Channel>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    memory: Option<Memory>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    positions: Vec<TargetPosition>,
    #[serde(default)]
    has_nodes: bool,
}

impl From<Problem> for SavedProblem {
    fn from(problem: Problem) -> Self {
        Self {
            has_nodes: problem.has_nodes(),
            inputs: problem.inputs,
            targets: problem.targets,
            memory: problem.memory,
            positions: problem.positions,
        }
    }
}

impl SavedProblem {
    /// Returns the problem with this sensor, if its targets are nodes; `None` if there is no sensor for them.
    pub fn with_sensor(self, sensor: Option<&Simulation>) -> Option<Problem> {
        Some(Problem {
            sensor: if self.has_nodes { Some(*sensor?) } else { None },
            inputs: self.inputs,
            targets: self.targets,
            memory: self.memory,
            positions: self.positions,
        })
    }
}
