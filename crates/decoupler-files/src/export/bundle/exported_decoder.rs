use decoupler_core::{
    dataset::{Dataset, Memory, PerRow, Seed, Simulation, Stream},
    decoupling::{Decoder, DecoderKind, NotDescribed, Precision, Program, decode_set},
    evaluation::{DecoderSet, RunError, RunSets, RunSettings, TargetErrors, TestErrors},
    network::{MinMax, Networks},
    problem::{Channel, Problem},
};
use rand::RngExt;
use serde_json::{Map, Value, json};

use super::{
    BundleDecoder, BundleError, BundlePrecision, ChoiceError,
    layers::Layer,
    meaning::Meaning,
    portable::{ChannelRanges, Portable},
};
use crate::{
    export::{NetworkFile, document::PROGRAM},
    import::{Plan, Setup, SetupSets},
};

/// A decoder to be exported, with the meaning of its readings and targets.
pub struct ExportedDecoder<'a> {
    /// Network file of the run, if a network was trained.
    file: Option<&'a NetworkFile>,
    origin: Origin,
    fitted: FittedDecoder,
}

/// Readings of one row with the index of the row-wire, 0 if it is not an argument.
pub(super) type Drawn = Vec<(usize, Vec<f64>)>;

/// Facts about a decoder, for users and programs that have only the bundle: names of fields and JSON values.
pub(super) type Metadata = Map<String, Value>;

impl<'a> From<&'a NetworkFile> for ExportedDecoder<'a> {
    /// Exports the network of a file.
    fn from(file: &'a NetworkFile) -> Self {
        Self {
            fitted: FittedDecoder::of_networks(&file.network, file.scores.network.clone()),
            origin: Origin::of_file(file),
            file: Some(file),
        }
    }
}

impl<'a> ExportedDecoder<'a> {
    /// Fits a decoder to the training samples of the run of `file`; `sets` are its samples, drawn or read again. If the
    /// decoder is the network, uses the network of the file.
    ///
    /// # Errors
    /// The recording has changed, the samples cannot be scaled or decoded, or no other program can compute what the decoder
    /// does.
    pub fn of_run(file: &'a NetworkFile, sets: SetupSets, decoder: BundleDecoder) -> Result<Self, BundleError> {
        sets.check_saved(file.recorded.as_ref())?;
        if decoder.is_network() {
            return Ok(file.into());
        }
        Ok(Self {
            origin: Origin::of_file(file),
            fitted: FittedDecoder::fit(file.settings, sets.sets, Some(file.network.clone()), decoder)?,
            file: Some(file),
        })
    }

    /// Fits a decoder that needs no network to the training samples of `setup`, which are `sets`.
    ///
    /// # Errors
    /// As [`Self::of_run`], or if the decoder needs a network.
    pub fn of_setup(setup: &Setup, sets: SetupSets, decoder: BundleDecoder) -> Result<Self, BundleError> {
        Ok(Self {
            origin: Origin::of_sets(setup, &sets)?,
            fitted: FittedDecoder::fit(*setup.settings(), sets.sets, None, decoder)?,
            file: None,
        })
    }

    /// Exports networks that were trained on samples in memory, with the description of their channels and the row-wires
    /// with a network each. Without test samples the bundle contains no errors.
    pub fn of_networks(
        networks: &Networks,
        settings: RunSettings,
        problem: Problem,
        row_wires: Option<Vec<usize>>,
    ) -> Self {
        let none = TestErrors::Targets(Vec::new());
        Self {
            file: None,
            origin: Origin {
                program: PROGRAM.to_owned(),
                settings,
                problem,
                row_wires,
                files: Vec::new(),
                errors_of_linear: none.clone(),
            },
            fitted: FittedDecoder::of_networks(networks, none),
        }
    }

    /// Kind of decoder.
    pub fn kind(&self) -> BundleDecoder {
        self.fitted.kind
    }

    /// Network file of the run, if a network was trained.
    pub(super) fn file(&self) -> Option<&'a NetworkFile> {
        self.file
    }

    pub(super) fn program(&self) -> &Program {
        &self.fitted.program
    }

    /// Memory whose features the decoder takes, if it has one.
    pub(super) fn memory(&self) -> Option<&Memory> {
        self.origin.problem.memory.as_ref()
    }

    pub(super) fn meaning(&self) -> Meaning {
        match &self.origin.problem.sensor {
            Some(simulation) => Meaning::Array(simulation.sensor.scale),
            None => Meaning::Own {
                inputs: self.origin.problem.features(),
                has_memory: self.memory().is_some(),
                targets: self.origin.problem.targets.clone(),
                row_wires: match (&self.origin.row_wires, self.fitted.reading_ranges.len()) {
                    (Some(row_wires), 2..) => row_wires.clone(),
                    _ => Vec::new(),
                },
                half_widths: self.half_widths(),
            },
        }
    }

    /// Half-width of the 90 % prediction interval of each target of the network, as far as they were calibrated.
    fn half_widths(&self) -> Vec<Option<f64>> {
        let file = self.file.filter(|_| self.fitted.kind.is_network());
        let intervals = file.and_then(|file| file.intervals.as_ref());
        let targets = intervals.iter().flat_map(|intervals| &intervals.targets);
        targets.map(|target| Some(target.as_ref()?.constant)).collect()
    }

    /// Ranges of the readings in training: one for all row-wires, or one for each if the row is an argument.
    pub(super) fn reading_ranges(&self) -> &[Option<MinMax>] {
        &self.fitted.reading_ranges
    }

    /// Ranges of the targets in training: one for all row-wires, or one for each if the row is an argument.
    pub(super) fn target_extremes(&self) -> &[Vec<(f64, f64)>] {
        &self.fitted.target_extremes
    }

    /// Answer of this program to the readings of a row-wire.
    ///
    /// # Errors
    /// A reading cannot be decoded.
    pub(super) fn decode(&mut self, row: usize, readings: &[f64]) -> Result<Vec<f64>, BundleError> {
        let mut answer = vec![0.0; self.fitted.decoder.outputs()];
        let decoded = self.fitted.decoder.decode_row(row, readings, &mut answer);
        decoded.map_err(|error| Box::new(RunError::from(error)))?;
        Ok(answer)
    }

    /// Draws readings for the verification. Returns the number of golden vectors, which come first, and all readings.
    /// Readings of a simulated sensor are drawn from its scene; readings of a recording are uniform in their range in
    /// training.
    ///
    /// # Errors
    /// The scene could not be drawn, or the range is not known.
    pub(super) fn draw(&self, portable: &Portable) -> Result<(usize, Drawn), BundleError> {
        /// Snapshots drawn, and snapshots among them that are golden vectors.
        const SNAPSHOTS: [usize; 2] = [20, 1];
        /// Readings drawn for each network, and golden vectors among them.
        const EVEN: [usize; 2] = [100, 4];
        match self.origin.problem.sensor {
            Some(simulation) => {
                let rows = simulation.model_size().map_or(1, |size| size.rows);
                let few = Simulation {
                    test_samples: SNAPSHOTS[0] * rows,
                    ..simulation
                };
                let set = few.draw_test(self.origin.settings.seed).map_err(Box::new)?;
                let network = |sample| if portable.takes_row() { set.row_index(sample) } else { 0 };
                let samples = 0..set.samples();
                let drawn = samples.map(|sample| (network(sample), set.sample_readings(sample).to_vec()));
                Ok((SNAPSHOTS[1] * rows, drawn.collect()))
            }
            None => {
                let mut rng = Seed::default().rng(Stream::Test);
                let mut drawn = Drawn::new();
                for _ in 0..EVEN[0] {
                    for (index, range) in portable.ranges.iter().enumerate() {
                        let range = range.as_ref().ok_or(BundleError::NoRange)?;
                        let mut between = |&(low, high): &(f64, f64)| low + rng.random::<f64>() * (high - low);
                        drawn.push((index, range.extremes.iter().map(&mut between).collect()));
                    }
                }
                Ok((EVEN[1] * portable.rows(), drawn))
            }
        }
    }

    /// Collects the metadata of a bundle.
    pub(super) fn metadata(&self, portable: &Portable, precision: BundlePrecision) -> Metadata {
        let common = json!({
            "program": crate::export::document::PROGRAM,
            "decoder": self.fitted.kind.to_string(),
            "takes_row": portable.takes_row(),
            "quantity": portable.quantity,
            "layers": layers(portable),
            "precision": precision.to_string(),
        });
        let network = self
            .fitted
            .kind
            .is_network()
            .then(|| json!({ "hidden_nodes": portable.widest() }));
        let errors = &self.fitted.errors;
        let own = match &self.origin.problem.sensor {
            Some(simulation) => of_array(&self.origin, simulation, portable, errors),
            None => of_recording(&self.origin, portable, errors),
        };
        let half_widths = self.half_widths();
        let intervals = (!half_widths.is_empty()).then(|| json!({ "half_widths_90": half_widths }));
        let mut fields = Metadata::new();
        for part in [Some(common), network, Some(own), intervals] {
            if let Some(Value::Object(part)) = part {
                fields.extend(part);
            }
        }
        fields
    }
}

/// Describes the steps of the decoder with their sizes.
fn layers(portable: &Portable) -> Vec<String> {
    let mut inputs = portable.channels;
    let layers = portable.layers().iter().map(|layer| {
        let outputs = layer.outputs(inputs);
        let text = match layer {
            Layer::Affine(_) => format!("affine, {inputs} to {outputs}"),
            Layer::Tanh => "hyperbolic tangent".to_owned(),
            Layer::Gaussians { .. } => format!("{outputs} Gaussians of {inputs} values"),
        };
        inputs = outputs;
        text
    });
    layers.collect()
}

fn of_array(origin: &Origin, simulation: &Simulation, portable: &Portable, errors: &TestErrors) -> Value {
    let Simulation { sensor, scene, .. } = simulation;
    let names = |channels: Vec<Channel>| channels.into_iter().map(|channel| channel.name).collect::<Vec<_>>();
    json!({
        "trained_by": origin.program,
        "array": sensor.scale.to_string(),
        "geometry": sensor.geometry,
        "scene": scene,
        "rows": scene.rows.to_string(),
        "row_numbers": portable.takes_row().then_some([1, portable.rows()]),
        "inputs": { "names": names(portable.meaning.inputs()), "unit": "ohm" },
        "outputs": { "names": names(portable.meaning.targets()), "unit": "mm" },
        "training_samples": simulation.samples,
        "seed": origin.settings.seed,
        "errors": errors.nodes(),
        "readings_in_training_ohm": ranges(portable),
        "output_range_mm": portable.output_range_mm(),
    })
}

fn of_recording(origin: &Origin, portable: &Portable, errors: &TestErrors) -> Value {
    let columns = |channels: &[Channel]| {
        let (names, units): (Vec<_>, Vec<_>) = channels.iter().map(|channel| (&channel.name, &channel.unit)).unzip();
        json!({ "names": names, "units": units })
    };
    let named = |errors: &TestErrors| {
        let of = |(channel, errors): (&Channel, &TargetErrors)| json!({ "name": channel.name, "errors": errors });
        let targets = origin.problem.targets.iter();
        targets.zip(errors.targets()).map(of).collect::<Vec<_>>()
    };
    let row_wires = origin.row_wires.iter().flatten().map(|row_wire| row_wire + 1);
    json!({
        "trained_by": origin.program,
        "files": origin.files,
        "row_numbers": portable.takes_row().then(|| row_wires.collect::<Vec<_>>()),
        "inputs": columns(&origin.problem.features()),
        "memory": origin.problem.memory,
        "outputs": columns(&origin.problem.targets),
        "method": origin.settings.training.method.short_name(),
        "seed": origin.settings.seed,
        "errors": named(errors),
        "errors_of_ridge": named(&origin.errors_of_linear),
        "readings_in_training": ranges(portable),
        "output_ranges": portable.scales,
    })
}

/// Smallest and largest readings in training, row by row.
fn ranges(portable: &Portable) -> Vec<Option<Value>> {
    let range = |range: &ChannelRanges| {
        let (minimum, maximum): (Vec<f64>, Vec<f64>) = range.extremes.iter().copied().unzip();
        json!({ "minimum": minimum, "maximum": maximum })
    };
    portable
        .ranges
        .iter()
        .map(|of_row| of_row.as_ref().map(range))
        .collect()
}

/// A decoder fitted to training samples, with the facts about them that a bundle contains.
pub(super) struct FittedDecoder {
    pub(super) kind: BundleDecoder,
    pub(super) decoder: Box<dyn Decoder>,
    pub(super) program: Program,
    /// Ranges of the readings in training: one for all row-wires, or one for each if the row is an argument.
    pub(super) reading_ranges: Vec<Option<MinMax>>,
    /// Ranges of the targets in training: one for all row-wires, or one for each if the row is an argument.
    pub(super) target_extremes: Vec<Vec<(f64, f64)>>,
    /// Errors on the test samples.
    pub(super) errors: TestErrors,
}

impl FittedDecoder {
    /// Wraps trained networks, which contain the range of their readings, and their errors on the test samples.
    pub(super) fn of_networks(networks: &Networks, errors: TestErrors) -> Self {
        let all = networks.values().iter();
        let extremes = all.clone().map(|network| {
            let outputs = network.outputs();
            (0..outputs.channels()).map(|output| outputs.extremes(output)).collect()
        });
        let decoder = networks.decoder();
        Self {
            kind: BundleDecoder::Kind(DecoderKind::Network),
            program: decoder.program().clone(),
            decoder: Box::new(decoder),
            reading_ranges: all.map(|network| network.inputs().range().cloned()).collect(),
            target_extremes: extremes.collect(),
            errors,
        }
    }

    /// Fits a decoder to the training samples of `sets` by these settings and measures it on the test samples; `networks` are
    /// those trained with these settings, for the decoders that need them.
    ///
    /// # Errors
    /// The samples cannot be scaled or decoded, or no other program can compute what the decoder does.
    pub(super) fn fit(
        settings: RunSettings,
        sets: RunSets,
        networks: Option<Networks>,
        kind: BundleDecoder,
    ) -> Result<Self, BundleError> {
        if kind.needs_network() && networks.is_none() {
            return Err(BundleError::NoNetwork(kind));
        }
        let (training, test, problem) = (sets.split.training, sets.test, sets.problem);
        let of_row = |set: &Dataset| {
            let targets = set.targets();
            let extremes = targets.columns().into_iter().map(|column| {
                let both = |(low, high): (f64, f64), &value: &f64| (low.min(value), high.max(value));
                column.iter().fold((f64::INFINITY, f64::NEG_INFINITY), both)
            });
            Ok::<_, BundleError>((MinMax::of(set.readings()), extremes.collect::<Vec<_>>()))
        };
        let in_training = PerRow::fit(&training, settings.source.row_model(), of_row)?;
        let (reading_ranges, target_extremes) = in_training.values().iter().cloned().unzip();
        let set = DecoderSet::new(settings, training, networks);
        let decoder = match kind {
            BundleDecoder::Linear => Some(set.linear().map_err(Box::new)?),
            BundleDecoder::Kind(kind) => set.decoder(kind, Precision::Double).map_err(Box::new)?,
        };
        let not_described = |reason| ChoiceError::NotDescribed { decoder: kind, reason };
        let mut decoder = decoder.ok_or_else(|| not_described(NotDescribed::Equations))?;
        let program = decoder.program().map_err(not_described)?;
        let answers = decode_set(&mut *decoder, &test).map_err(|error| Box::new(RunError::from(error)))?;
        Ok(Self {
            kind,
            decoder,
            program,
            reading_ranges,
            target_extremes,
            errors: TestErrors::measure(&problem, &test, &answers),
        })
    }
}

/// Facts about the samples to which an exported decoder was fitted, for the metadata of its bundle.
pub(super) struct Origin {
    /// Program and version that trained or fitted it.
    pub(super) program: String,
    pub(super) settings: RunSettings,
    /// Names, units and positions of readings and targets.
    pub(super) problem: Problem,
    /// Row-wires of the samples in ascending order, from 0, if they are known.
    pub(super) row_wires: Option<Vec<usize>>,
    /// Names of the recordings without their folders; empty for a simulated array.
    pub(super) files: Vec<String>,
    /// Errors of the linear baseline on the test samples.
    pub(super) errors_of_linear: TestErrors,
}

impl Origin {
    /// Returns the facts from the file of a trained network.
    pub(super) fn of_file(file: &NetworkFile) -> Self {
        Self {
            program: file.program.clone(),
            settings: file.settings,
            problem: file.problem.clone(),
            row_wires: file.row_wires.clone(),
            files: names(file.recorded.as_ref().map(|recorded| &recorded.plan)),
            errors_of_linear: file.scores.baselines.linear.clone(),
        }
    }

    /// Returns the facts from the samples of `setup`, for a decoder without a network.
    ///
    /// # Errors
    /// The samples cannot be scaled or decoded.
    pub(super) fn of_sets(setup: &Setup, sets: &SetupSets) -> Result<Self, BundleError> {
        let (settings, samples) = (*setup.settings(), &sets.sets);
        let set = DecoderSet::new(settings, samples.split.training.clone(), None);
        let mut linear = set.linear().map_err(Box::new)?;
        let answers = decode_set(&mut *linear, &samples.test).map_err(|error| Box::new(RunError::from(error)))?;
        Ok(Self {
            program: PROGRAM.to_owned(),
            problem: Problem::clone(&samples.problem),
            row_wires: samples.test.row_wires_read().map(<[usize]>::to_vec),
            files: names(setup.plan()),
            errors_of_linear: TestErrors::measure(&samples.problem, &samples.test, &answers),
            settings,
        })
    }
}

fn names(plan: Option<&Plan>) -> Vec<String> {
    let paths = plan.into_iter().flat_map(Plan::files);
    let names = paths.filter_map(|path| path.file_name());
    names.map(|name| name.to_string_lossy().into_owned()).collect()
}
