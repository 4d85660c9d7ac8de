use std::path::Path;

use rand::RngExt;
use serde_json::{Map, Value, json};

use super::{
    BundleError, BundlePrecision,
    meaning::Meaning,
    portable::{ChannelRanges, Portable},
};
use crate::{
    dataset::{Seed, Stream},
    evaluation::Channel,
    evaluation::{SimulatedSettings, TargetErrors},
    export::{DocumentError, NetworkFile},
    network::Networks,
};

/// The network of a file, to be exported.
#[derive(Clone, Copy, Debug)]
pub enum ExportedNetwork<'a> {
    /// Of a simulated sensor.
    Simulated(&'a NetworkFile),
    /// Of own data.
    Measured(&'a NetworkFile),
}

/// Readings of one row with the index of their network.
pub(super) type Drawn = Vec<(usize, Vec<f64>)>;

/// Facts about a network, for people and programs that have only the bundle: names of fields and JSON values.
pub(super) type Metadata = Map<String, Value>;

impl<'a> From<&'a NetworkFile> for ExportedNetwork<'a> {
    fn from(file: &'a NetworkFile) -> Self {
        if file.recorded.is_none() {
            Self::Simulated(file)
        } else {
            Self::Measured(file)
        }
    }
}

impl ExportedNetwork<'_> {
    /// One for all row-wires, or one for each.
    pub(super) fn networks(&self) -> &Networks {
        match self {
            Self::Simulated(file) => &file.network,
            Self::Measured(file) => &file.network,
        }
    }

    pub(super) fn meaning(&self) -> Meaning {
        match self {
            Self::Simulated(file) => Meaning::Array(simulated(file).source.sensor.scale),
            Self::Measured(file) => Meaning::Own {
                inputs: file.problem.inputs.clone(),
                targets: file.problem.targets.clone(),
                row_wires: match (&file.row_wires, file.network.values().len()) {
                    (Some(row_wires), 2..) => row_wires.clone(),
                    _ => Vec::new(),
                },
            },
        }
    }

    /// Draws readings for the verification: the number of those that are golden vectors, which come first, and all. Those of
    /// a simulated sensor are of its scene; of own data nothing is known but their range, in which they are even.
    ///
    /// # Errors
    /// The scene could not be drawn, or the range is not known.
    pub(super) fn draw(&self, portable: &Portable) -> Result<(usize, Drawn), BundleError> {
        /// Snapshots drawn, and snapshots among them that are golden vectors.
        const SNAPSHOTS: [usize; 2] = [20, 1];
        /// Readings drawn for each network, and golden vectors among them.
        const EVEN: [usize; 2] = [100, 4];
        match self {
            Self::Simulated(file) => {
                let mut settings = simulated(file);
                let rows = settings.source.model_size().map_or(1, |size| size.rows);
                settings.source.test_samples = SNAPSHOTS[0] * rows;
                let set = settings.draw_test().map_err(Box::new)?;
                let network = |sample| if portable.takes_row() { set.row_index(sample) } else { 0 };
                let samples = 0..set.samples();
                let drawn = samples.map(|sample| (network(sample), set.sample_readings(sample).to_vec()));
                Ok((SNAPSHOTS[1] * rows, drawn.collect()))
            }
            Self::Measured(_) => {
                let mut rng = Seed::default().rng(Stream::Test);
                let mut drawn = Drawn::new();
                for _ in 0..EVEN[0] {
                    for (index, network) in portable.networks.iter().enumerate() {
                        let range = network.range.as_ref().ok_or(BundleError::NoRange)?;
                        let mut between = |&(low, high): &(f64, f64)| low + rng.random::<f64>() * (high - low);
                        drawn.push((index, range.extremes.iter().map(&mut between).collect()));
                    }
                }
                Ok((EVEN[1] * portable.networks.len(), drawn))
            }
        }
    }

    /// Writes the file of the network whole or not at all.
    ///
    /// # Errors
    /// It cannot be written.
    pub(super) fn save(&self, path: &Path) -> Result<(), DocumentError> {
        let (Self::Simulated(file) | Self::Measured(file)) = self;
        file.save(path)
    }

    /// Returns `true` if the file at `path` has this network.
    ///
    /// # Errors
    /// It cannot be read.
    pub(super) fn is_saved_at(&self, path: &Path) -> Result<bool, DocumentError> {
        let (Self::Simulated(file) | Self::Measured(file)) = self;
        let read = NetworkFile::load(path)?;
        Ok((&read.network, &read.settings) == (&file.network, &file.settings))
    }

    /// Collects the metadata of a bundle.
    pub(super) fn metadata(&self, portable: &Portable, precision: BundlePrecision) -> Metadata {
        let common = json!({
            "program": crate::export::document::PROGRAM,
            "takes_row": portable.takes_row(),
            "quantity": portable.quantity,
            "hidden_nodes": portable.hidden,
            "precision": precision.to_string(),
        });
        let own = match self {
            Self::Simulated(file) => of_array(file, portable),
            Self::Measured(file) => of_own_data(file, portable),
        };
        let mut fields = Metadata::new();
        for part in [common, own] {
            if let Value::Object(part) = part {
                fields.extend(part);
            }
        }
        fields
    }
}

/// Settings of the file of a simulated array.
fn simulated(file: &NetworkFile) -> SimulatedSettings {
    file.settings.simulated().expect("the file is of a simulated array")
}

fn of_array(file: &NetworkFile, portable: &Portable) -> Value {
    let settings = simulated(file);
    let sensor = &settings.source.sensor;
    let names = |channels: Vec<Channel>| channels.into_iter().map(|channel| channel.name).collect::<Vec<_>>();
    json!({
        "trained_by": file.program,
        "array": sensor.scale.to_string(),
        "geometry": sensor.geometry,
        "scene": settings.source.scene,
        "rows": settings.source.scene.rows.to_string(),
        "row_numbers": portable.takes_row().then_some([1, portable.networks.len()]),
        "inputs": { "names": names(portable.meaning.inputs()), "unit": "ohm" },
        "outputs": { "names": names(portable.meaning.targets()), "unit": "mm" },
        "training_samples": settings.source.samples,
        "seed": settings.seed,
        "errors": file.scores.network.nodes(),
        "readings_in_training_ohm": ranges(portable),
        "output_range_mm": portable.output_range_mm(),
    })
}

fn of_own_data(file: &NetworkFile, portable: &Portable) -> Value {
    let columns = |channels: &[Channel]| {
        let (names, units): (Vec<_>, Vec<_>) = channels.iter().map(|channel| (&channel.name, &channel.unit)).unzip();
        json!({ "names": names, "units": units })
    };
    // Without their folders, which are nobody's business.
    let paths = file.recorded.iter().flat_map(|recorded| recorded.plan.files());
    let files = paths.map(|path| path.file_name().map(|name| name.to_string_lossy().into_owned()));
    let errors = |errors: &[TargetErrors]| {
        let of = |(channel, errors): (&Channel, &TargetErrors)| json!({ "name": channel.name, "errors": errors });
        file.problem.targets.iter().zip(errors).map(of).collect::<Vec<_>>()
    };
    let row_wires = file.row_wires.iter().flatten().map(|row_wire| row_wire + 1);
    json!({
        "trained_by": file.program,
        "files": files.collect::<Vec<_>>(),
        "row_numbers": portable.takes_row().then(|| row_wires.collect::<Vec<_>>()),
        "inputs": columns(&file.problem.inputs),
        "outputs": columns(&file.problem.targets),
        "method": file.settings.training.method.short_name(),
        "seed": file.settings.seed,
        "errors": errors(file.scores.network.targets()),
        "errors_of_ridge": errors(file.scores.baselines.linear.targets()),
        "readings_in_training": ranges(portable),
        "output_ranges": portable.scales,
    })
}

/// Smallest and largest readings in training, network by network.
fn ranges(portable: &Portable) -> Vec<Option<Value>> {
    let range = |range: &ChannelRanges| {
        let (minimum, maximum): (Vec<f64>, Vec<f64>) = range.extremes.iter().copied().unzip();
        json!({ "minimum": minimum, "maximum": maximum })
    };
    let networks = portable.networks.iter();
    networks.map(|network| network.range.as_ref().map(range)).collect()
}
