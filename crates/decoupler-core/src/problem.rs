//! What is known about the readings and targets of a run.

use serde::{Deserialize, Serialize};

use crate::{
    dataset::{Dataset, Memory, Simulation},
    surface::lattice,
    text::{cleaned, cleaned_if_any, escaped_if_any},
};

/// Description of the readings and targets of a run, and of everything else that is known about them. Consumers ask
/// it what there is: names, units, a memory, positions, nodes, a sensor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Problem {
    /// Names and units of the readings, in their order.
    pub inputs: Vec<Channel>,
    /// Names and units of the targets, in their order.
    pub targets: Vec<Channel>,
    /// Memory: the inputs of a network are then the [features](Self::features) of the readings and of their past.
    pub memory: Option<Memory>,
    /// Positions of targets on the skin, for those that have one.
    pub positions: Vec<TargetPosition>,
    /// Sensor whose resistances the readings are, with its scene, if it is known. The targets are then the coordinates
    /// x, y and z of the nodes of a row-wire, in millimetres.
    pub sensor: Option<Simulation>,
}

/// Name and unit of a reading or target.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Channel {
    /// Full name, as in the header of a file.
    #[serde(deserialize_with = "cleaned")]
    pub name: String,
    /// Unit, if it is known.
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "cleaned_if_any"
    )]
    pub unit: Option<String>,
    /// Header of the column in the file with unprintable characters escaped, if they were removed from `name`, or it was cut.
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "escaped_if_any"
    )]
    pub original: Option<String>,
}

/// Position of a target that is measured at a known place of the skin.
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
    /// Names and units of the inputs of a network: the readings and, with a memory, the values computed from their past.
    pub fn features(&self) -> Vec<Channel> {
        let Some(memory) = &self.memory else {
            return self.inputs.clone();
        };
        let names = memory.names(self.inputs.iter().map(|channel| channel.name.as_str()));
        let units = self.inputs.iter().map(|channel| channel.unit.as_deref()).cycle();
        names
            .into_iter()
            .zip(units)
            .map(|(name, unit)| Channel::new(name, unit))
            .collect()
    }

    /// Number of inputs of a network.
    pub fn feature_count(&self) -> usize {
        let count = self.inputs.len();
        self.memory.as_ref().map_or(count, |memory| memory.features(count))
    }

    /// Returns `true` if the targets are coordinates of nodes.
    pub fn has_nodes(&self) -> bool {
        self.sensor.is_some()
    }

    /// Maximum travel of a node in millimetres; `None` if the targets are not nodes.
    pub fn stroke_mm(&self) -> Option<f64> {
        self.sensor.as_ref().map(Simulation::stroke_mm)
    }

    /// Name of the [error in percent](crate::evaluation::TestErrors::percent) on the test set.
    pub fn test_percent_name(&self) -> &'static str {
        if self.has_nodes() {
            "test Z %"
        } else {
            "test error, % of range"
        }
    }

    /// Returns the description of samples of `sensor`, or of the unnamed channels of `set` if there is none.
    pub fn of(sensor: Option<&Simulation>, set: &Dataset) -> Self {
        match sensor {
            Some(sensor) => sensor.problem(),
            None => Self::unnamed(set.channels(), set.outputs()),
        }
    }

    /// Returns the description of channels without names: readings `c1`, `c2`, … and targets `t1`, `t2`, ….
    pub fn unnamed(inputs: usize, targets: usize) -> Self {
        let channels = |letter: &str, count: usize| {
            let names = (1..=count).map(|number| format!("{letter}{number}"));
            names.map(|name| Channel::new(name, None)).collect()
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
    /// Returns `true` if exact readings of a row-wire determine its deformation: there are more of them than unknowns, or
    /// one unknown, in which a resistance is monotonic.
    pub(crate) fn is_determined(&self) -> bool {
        let unknowns = self.scene.unknowns_per_row(self.sensor.scale);
        self.sensor.scale.columns() > unknowns || unknowns == 1
    }

    /// Returns the description of the channels of a row-wire: its resistances and the coordinates of its nodes.
    pub fn problem(&self) -> Problem {
        let scale = self.sensor.scale;
        let nodes = 1..=scale.nodes_per_row();
        let coordinates = nodes.flat_map(|node| ["x", "y", "z"].map(|axis| format!("{axis}_{node}")));
        let resistances = (1..=scale.columns()).map(|column| format!("r_{column}"));
        Problem {
            inputs: resistances.map(|name| Channel::new(name, Some("Ω"))).collect(),
            targets: coordinates.map(|name| Channel::new(name, Some("mm"))).collect(),
            sensor: Some(*self),
            ..Problem::default()
        }
    }
}

impl Channel {
    /// Returns a channel whose name is as it was in its file.
    pub fn new(name: impl Into<String>, unit: Option<&str>) -> Self {
        Self {
            name: name.into(),
            unit: unit.map(str::to_owned),
            original: None,
        }
    }

    /// Returns the name, followed by the unit in parentheses if it is known.
    pub fn title(&self) -> String {
        match &self.unit {
            Some(unit) => format!("{} ({unit})", self.name),
            None => self.name.clone(),
        }
    }
}

impl TargetPosition {
    /// Returns the lattice whose nodes are these positions: its lines along x and along y in millimetres, ascending, and the
    /// index of the position at each node, in the order of the values of a [`SurfaceMap`](crate::surface::SurfaceMap).
    /// `None` if there are none or they do not form a lattice.
    pub fn lattice(positions: &[Self]) -> Option<([Vec<f64>; 2], Vec<usize>)> {
        lattice(&Self::places_mm(positions))
    }

    /// Returns the positions (x, y) in millimetres.
    pub fn places_mm(positions: &[Self]) -> Vec<[f64; 2]> {
        positions
            .iter()
            .map(|position| [position.x_mm, position.y_mm])
            .collect()
    }
}
