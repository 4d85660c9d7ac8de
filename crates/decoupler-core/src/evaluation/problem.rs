use serde::{Deserialize, Serialize};

use super::Simulation;
use crate::{
    surface::Lattice,
    text::{cleaned, cleaned_if_any},
};

/// Description of the readings and targets of a run, whether they are simulated or recorded.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Problem {
    /// Names and units of the readings, in their order.
    pub inputs: Vec<Channel>,
    /// Names and units of the targets, in their order.
    pub targets: Vec<Channel>,
    /// Positions of targets on the skin, for those that have one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub positions: Vec<TargetPosition>,
    /// `true` if the targets are the coordinates x, y and z of the nodes of a row-wire, in millimetres.
    #[serde(default)]
    pub has_nodes: bool,
}

/// Name and unit of a reading or target.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Channel {
    /// Full name: that of the column in a file.
    #[serde(deserialize_with = "cleaned")]
    pub name: String,
    /// Unit, if it is known.
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "cleaned_if_any"
    )]
    pub unit: Option<String>,
}

/// A target that is measured at a known place of the skin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TargetPosition {
    /// Index of the target.
    pub target: usize,
    /// x in millimetres.
    pub x_mm: f64,
    /// y in millimetres.
    pub y_mm: f64,
}

impl Problem {
    /// Name of the [error in percent](super::TestErrors::percent) on the test set.
    pub fn test_percent_name(&self) -> &'static str {
        if self.has_nodes {
            "test Z %"
        } else {
            "test error, % of range"
        }
    }

    /// Returns the description of channels without names: readings `c1`, `c2`, … and targets `t1`, `t2`, ….
    pub fn unnamed(inputs: usize, targets: usize) -> Self {
        let channels = |letter: &str, count: usize| {
            let numbers = 1..=count;
            let channel = |number| Channel {
                name: format!("{letter}{number}"),
                unit: None,
            };
            numbers.map(channel).collect()
        };
        Self {
            inputs: channels("c", inputs),
            targets: channels("t", targets),
            ..Self::default()
        }
    }

    /// Returns the unit of all targets, if they share one.
    pub fn shared_unit(&self) -> Option<&str> {
        let first = self.targets.first()?.unit.as_deref()?;
        let is_shared = self.targets.iter().all(|target| target.unit.as_deref() == Some(first));
        is_shared.then_some(first)
    }
}

impl Simulation {
    /// Returns the description of the channels of a row-wire: its resistances and the coordinates of its nodes.
    pub fn problem(&self) -> Problem {
        let scale = self.sensor.scale;
        let channel = |name: String, unit: &str| Channel {
            name,
            unit: Some(unit.to_owned()),
        };
        let nodes = 1..=scale.nodes_per_row();
        Problem {
            inputs: (1..=scale.columns())
                .map(|column| channel(format!("r_{column}"), "Ω"))
                .collect(),
            targets: nodes
                .flat_map(|node| ["x", "y", "z"].map(|axis| channel(format!("{axis}_{node}"), "mm")))
                .collect(),
            positions: Vec::new(),
            has_nodes: true,
        }
    }
}

impl Channel {
    /// Name, with the unit in brackets if it is known.
    pub fn title(&self) -> String {
        match &self.unit {
            Some(unit) => format!("{} ({unit})", self.name),
            None => self.name.clone(),
        }
    }
}

impl TargetPosition {
    /// The lattice whose nodes are these positions; `None` if they are none, or no lattice.
    pub fn lattice(positions: &[Self]) -> Option<Lattice> {
        Lattice::of(&Self::places_mm(positions))
    }

    /// The positions (x, y), in millimetres.
    pub fn places_mm(positions: &[Self]) -> Vec<[f64; 2]> {
        positions
            .iter()
            .map(|position| [position.x_mm, position.y_mm])
            .collect()
    }
}
