use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::SimulatedSettings;
use crate::{
    dataset::Memory,
    machine::node_pairs_per_row,
    network::{InputChoice, Quantity, ScalingChoice},
    scene::{Indenter, Loading, Noise, RowModel, Rows, Scene, SceneError},
    sensor::{ArrayScale, SensorModel},
    surface::Lattice,
    text::{cleaned, cleaned_if_any, escaped_if_any},
    training::{StoppingRules, TrainingSettings},
};

/// Source of the samples of a run.
#[expect(
    clippy::large_enum_variant,
    reason = "there is one per run, and with a box the settings would not be `Copy`"
)]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// Samples drawn from a model of the sensor.
    Simulated(Simulation),
    /// Sets of measured samples.
    Measured(Measured),
}

/// A simulated sensor, its scene, and the numbers of samples to draw.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Simulation {
    /// Model of the sensor.
    pub sensor: SensorModel,
    /// Scene: rows, axes, loading and noise.
    pub scene: Scene,
    /// Number of training samples, over all row-wires read.
    pub samples: usize,
    /// Number of validation samples, drawn in addition to select the best weights and to stop the training; 0 for none.
    pub validation_samples: usize,
    /// Number of test samples.
    pub test_samples: usize,
}

/// Measured samples; only the readings of the sensor are known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measured {
    /// One network shared by all row-wires or one per row-wire; without row-wires the two are the same.
    pub rows: RowModel,
}

/// Size of the model of a scene; coordinates that do not vary are not counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModelSize {
    /// Number of row-wires read.
    pub rows: usize,
    /// Number of unknown coordinates in a frame, over all rows.
    pub unknowns: usize,
    /// Number of resistances in a frame.
    pub equations: usize,
    /// Number of networks: one, or one per known row.
    pub networks: usize,
}

impl From<Simulation> for Source {
    fn from(simulation: Simulation) -> Self {
        Self::Simulated(simulation)
    }
}

impl From<Measured> for Source {
    fn from(measured: Measured) -> Self {
        Self::Measured(measured)
    }
}

impl Source {
    /// Returns the simulation, if there is one.
    pub fn simulation(&self) -> Option<&Simulation> {
        match self {
            Self::Simulated(simulation) => Some(simulation),
            Self::Measured(_) => None,
        }
    }

    /// Returns the row model: one network shared by all row-wires, or one per row-wire.
    pub fn row_model(&self) -> RowModel {
        match self {
            Self::Simulated(simulation) => simulation.scene.rows.model(),
            Self::Measured(measured) => measured.rows,
        }
    }
}

impl Default for Simulation {
    /// Returns the paper's main experiment: 10×10_5×30, 1000 training and 100 test samples.
    fn default() -> Self {
        Self {
            sensor: SensorModel::new(ArrayScale::default()),
            scene: Scene::default(),
            samples: 1000,
            validation_samples: 200,
            test_samples: 100,
        }
    }
}

impl Simulation {
    /// Counts the unknowns, equations and networks.
    ///
    /// # Errors
    /// If the array lacks a row of the scene.
    pub fn model_size(&self) -> Result<ModelSize, SceneError> {
        let scale = self.sensor.scale;
        let rows = self.scene.rows.read(scale.rows())?.len();
        Ok(ModelSize {
            rows,
            unknowns: rows * self.scene.unknowns_per_row(scale),
            equations: rows * scale.columns(),
            networks: match self.scene.rows.model() {
                RowModel::Shared => 1,
                RowModel::Each => rows,
            },
        })
    }

    /// Maximum travel of a node in millimetres, the full scale of its deformation.
    pub fn stroke_mm(&self) -> f64 {
        self.scene.stroke_mm(&self.sensor.geometry)
    }
}

/// Preset settings of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preset {
    /// As in the paper: one network for all rows, resistances scaled to [−1, 1].
    #[default]
    Paper,
    /// Best settings found in experiments: known rows, whitened conductances, more samples, and later early stopping.
    Best,
}

/// Error for an unknown preset.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("'{0}' is not a preset: give paper or best")]
pub struct PresetError(String);

impl Preset {
    /// All presets, in the order offered to the user.
    pub const ALL: [Self; 2] = [Self::Paper, Self::Best];

    /// Returns the settings of the preset, without noise.
    pub fn settings(self) -> SimulatedSettings {
        self.settings_in(Noise::default())
    }

    /// Returns the settings of the preset for readings with `noise`. Accuracy then depends on the number of samples,
    /// and few epochs are enough.
    pub fn settings_in(self, noise: Noise) -> SimulatedSettings {
        let mut paper = SimulatedSettings::default();
        paper.source.scene.noise = noise;
        let (samples, validation_samples, epochs) = if noise.is_none() {
            (5000, 1000, 1000)
        } else {
            (50_000, 5000, 100)
        };
        match self {
            Self::Paper => paper,
            Self::Best => SimulatedSettings {
                source: Simulation {
                    scene: Scene {
                        rows: Rows::Known,
                        ..paper.source.scene
                    },
                    samples,
                    validation_samples,
                    ..paper.source
                },
                inputs: InputChoice::BEST,
                training: TrainingSettings {
                    stopping: StoppingRules {
                        epochs,
                        max_fail: 30,
                        min_gradient: 0.0,
                        ..paper.training.stopping
                    },
                    ..paper.training
                },
                ..paper
            },
        }
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Paper => "paper",
            Self::Best => "best",
        })
    }
}

impl FromStr for Preset {
    type Err = PresetError;

    fn from_str(text: &str) -> Result<Self, PresetError> {
        let found = Self::ALL.into_iter().find(|preset| preset.to_string() == text.trim());
        found.ok_or_else(|| PresetError(text.to_owned()))
    }
}

/// Returns the settings of a small network that learns imprints of balls on the sensor of `source` in a fraction of a
/// second, with its rows, axes and stroke, and without noise; `None` for arrays for which training would take longer.
///
/// One network for each known row, with conductances scaled to [−1, 1], was the best choice for so few samples.
pub fn ready_settings(source: &Simulation) -> Option<SimulatedSettings> {
    /// Number of training samples per row.
    const SAMPLES: usize = 200;
    /// Maximum number of pairs of nodes in all samples: about a tenth of a second.
    const MAX_PAIRS: f64 = 5e7;
    /// Maximum number of unknowns and readings of all rows, with which the time of an epoch grows.
    const MAX_CHANNELS: usize = 2000;
    let rows = source.model_size().ok()?;
    let samples = SAMPLES * rows.rows;
    let channels = rows.unknowns + rows.equations;
    if samples as f64 * node_pairs_per_row(&source.sensor) > MAX_PAIRS || channels > MAX_CHANNELS {
        return None;
    }
    let scene = Scene {
        rows: match source.scene.rows {
            Rows::All | Rows::Known => Rows::Known,
            one @ Rows::One(_) => one,
        },
        loading: Loading::Indenter(Indenter::default()),
        noise: Noise::default(),
        ..source.scene
    };
    Some(SimulatedSettings {
        source: Simulation {
            sensor: source.sensor,
            scene,
            samples,
            validation_samples: 0,
            test_samples: rows.rows,
        },
        inputs: InputChoice {
            quantity: Quantity::Conductance,
            scaling: ScalingChoice::MinMax,
        },
        hidden: 6,
        training: TrainingSettings {
            stopping: StoppingRules {
                epochs: 30,
                ..StoppingRules::default()
            },
            ..TrainingSettings::default()
        },
        ..SimulatedSettings::default()
    })
}

/// Description of the readings and targets of a run, whether they are simulated or recorded.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Problem {
    /// Names and units of the readings, in their order.
    pub inputs: Vec<Channel>,
    /// Names and units of the targets, in their order.
    pub targets: Vec<Channel>,
    /// Memory: the inputs of a network are then the [features](Self::features) of the readings and of their past.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory: Option<Memory>,
    /// Positions of targets on the skin, for those that have one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub positions: Vec<TargetPosition>,
    /// `true` if the targets are the coordinates x, y and z of the nodes of a row-wire, in millimetres.
    #[serde(default)]
    pub has_nodes: bool,
}

/// Names and units of the features of these channels.
fn features(memory: &Memory, channels: &[Channel]) -> Vec<Channel> {
    let names = memory.names(channels.iter().map(|channel| channel.name.as_str()));
    let units = channels.iter().map(|channel| &channel.unit).cycle();
    names
        .into_iter()
        .zip(units)
        .map(|(name, unit)| Channel::new(name, unit.as_deref()))
        .collect()
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
        match &self.memory {
            Some(memory) => features(memory, &self.inputs),
            None => self.inputs.clone(),
        }
    }

    /// Number of inputs of a network.
    pub fn feature_count(&self) -> usize {
        let count = self.inputs.len();
        self.memory.as_ref().map_or(count, |memory| memory.features(count))
    }

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
            let channel = |number| Channel::new(format!("{letter}{number}"), None);
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
        let channel = |name: String, unit: &str| Channel::new(name, Some(unit));
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
            memory: None,
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
    /// Returns the lattice whose nodes are these positions; `None` if there are none or they do not form a lattice.
    pub fn lattice(positions: &[Self]) -> Option<Lattice> {
        Lattice::of(&Self::places_mm(positions))
    }

    /// Returns the positions (x, y) in millimetres.
    pub fn places_mm(positions: &[Self]) -> Vec<[f64; 2]> {
        positions
            .iter()
            .map(|position| [position.x_mm, position.y_mm])
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::{
        evaluation::{Pressed, Run},
        scene::{Print, Touch},
    };

    /// Returns the mean errors of the ready-made network, and of always answering the rest positions, for a ball
    /// pressed on the middle of the array.
    fn errors_mm(scale: &str) -> [f64; 2] {
        let mut source = Simulation::default();
        source.sensor.scale = scale.parse().unwrap();
        let settings = ready_settings(&source).unwrap();
        let mut run = Run::prepare(settings).unwrap();
        while run.step().is_none() {}
        let (sensor, rows) = (source.sensor, Vec::from_iter(0..source.sensor.scale.rows()));
        let corners = [(0, 0), (rows.len() - 1, sensor.scale.nodes_per_row() - 1)];
        let [first, last] = corners.map(|(row, node)| sensor.geometry.row_node_mm(sensor.scale, row, node));
        let print = Print {
            indenter: Indenter::default(),
            place_mm: DVec2::new(0.5 * (first.x + last.x), 0.5 * (first.y + last.y)),
            depth_mm: 0.8,
        };
        let touch = Touch {
            print: Some(print),
            ..Touch::default()
        };
        let pressed = Pressed::new(&sensor, &rows, &touch, 1.0).unwrap();
        let mut decoder = run.network().decoder();
        let answer = pressed.answer(&mut decoder, &|| false).unwrap().unwrap();
        let depths = pressed.nodes_mm().map(|node| sensor.geometry.height_mm - node.z);
        let nodes = pressed.nodes_mm().count() as f64;
        [answer.mean_mm, depths.sum::<f64>() / nodes]
    }

    #[test]
    fn the_ready_made_network_decodes_imprints_on_every_array_of_the_paper() {
        for scale in ["10x6_3x18", "10x8_4x24", "10x10_5x30", "4x4_2x12"] {
            let [network, rest] = errors_mm(scale);
            assert!(network < 0.25 * rest, "{scale}: {network} of {rest} mm");
        }
    }

    #[test]
    fn large_arrays_have_no_ready_made_network() {
        let mut source = Simulation::default();
        source.sensor.scale = "96x96_96x288".parse().unwrap();
        assert_eq!(ready_settings(&source), None);
        source.sensor.scale = "10x10_5x30".parse().unwrap();
        source.scene.rows = Rows::One(99);
        assert_eq!(ready_settings(&source), None, "a row that does not exist");
    }
}
