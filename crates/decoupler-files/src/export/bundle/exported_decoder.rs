use std::{path::PathBuf, sync::Arc};

use decoupler_core::{
    dataset::{Dataset, GAP, Memory, PerRow, Seed, Simulation, Stream},
    decoupling::{Combined, Decoder, Function, NodeId, Operation, Precision, Program, decode_set},
    evaluation::{DecoderSet, HalfWidth, RunError, RunSettings, TargetErrors, TestErrors},
    network::{MinMax, Networks, Quantity},
    problem::{Channel, Problem},
};
use rand::RngExt;
use serde_json::{Value, json};

use super::{
    BundleDecoder, BundleError, BundlePrecision,
    contents::Contents,
    exported_program::{ExportedProgram, Limits, are_positive},
    golden::{Golden, GoldenRow},
    meaning::Meaning,
    names::names,
};
use crate::{
    export::{NetworkFile, document::PROGRAM},
    import::{Plan, Setup, SetupSets},
};

/// A decoder to be exported, with the meaning of its readings and targets, and facts about the samples to which it was fitted.
pub struct ExportedDecoder {
    kind: BundleDecoder,
    program: Program,
    /// The program of a network without limits of the readings, for integers, which saturate.
    unlimited: Option<Program>,
    /// Ranges of the readings in training: one for all row-wires, or one for each if the row is an argument.
    reading_ranges: Vec<Option<MinMax>>,
    /// Ranges of the targets in training: one for all row-wires, or one for each if the row is an argument.
    target_ranges: Vec<MinMax>,
    /// Errors on the test samples.
    errors: TestErrors,
    /// Errors of the linear baseline on the test samples.
    errors_of_linear: TestErrors,
    /// 90 % prediction intervals of the answers, if every target has one.
    half_widths: Vec<HalfWidth>,
    /// Test samples, if they are known.
    test: Option<Arc<Dataset>>,
    /// Program and version that trained or fitted it.
    trained_by: String,
    settings: RunSettings,
    /// Names, units and positions of readings and targets.
    problem: Problem,
    /// Row-wires of the samples in ascending order, from 0, if they are known.
    row_wires: Option<Vec<usize>>,
    /// Names of the recordings without their folders; empty for a simulated array.
    files: Vec<String>,
}

impl From<&NetworkFile> for ExportedDecoder {
    /// Exports what a file answers with: the combination that a choice of settings found, or the network.
    fn from(file: &NetworkFile) -> Self {
        // Without the recording, readings are drawn from the range in training.
        let test = file.recorded.as_ref().and_then(|_| file.test_set().ok());
        Self::of_file(file, BundleDecoder::Chosen, test)
    }
}

impl ExportedDecoder {
    /// Fits a decoder to the training samples of the run of `file`; `sets` are its samples, drawn or read again. If the
    /// decoder contains the network, uses the network of the file.
    ///
    /// # Errors
    /// The recording has changed, the samples cannot be scaled or decoded, or no other program can compute what the decoder
    /// does.
    pub fn of_run(file: &NetworkFile, sets: SetupSets, decoder: BundleDecoder) -> Result<Self, BundleError> {
        sets.check_saved(file.recorded.as_ref())?;
        if decoder.is_network() {
            return Ok(Self::of_file(file, decoder, Some(sets.sets.test)));
        }
        Ok(Self {
            trained_by: file.program.clone(),
            ..Self::of_setup(&file.setup(), sets, decoder)?
        })
    }

    /// Fits a decoder that needs no network to the training samples of `setup`, which are `sets`, and measures it on the test
    /// samples.
    ///
    /// # Errors
    /// As [`Self::of_run`], or if the decoder needs a network.
    pub fn of_setup(setup: &Setup, sets: SetupSets, kind: BundleDecoder) -> Result<Self, BundleError> {
        kind.check()?;
        let (settings, sets) = (*setup.settings(), sets.sets);
        let (training, problem) = (sets.split.training, Problem::clone(&sets.problem));
        let of_row = |set: &Dataset| Ok::<_, BundleError>((MinMax::of(set.readings()), MinMax::of(set.targets())));
        let in_training = PerRow::fit(&training, settings.source.row_model(), of_row)?;
        let (reading_ranges, target_ranges): (_, Vec<_>) = in_training.values().iter().cloned().unzip();
        let set = DecoderSet::new(settings, training, None);
        let mut linear = set.linear().map_err(Box::new)?;
        let errors = |decoder: &mut dyn Decoder| {
            let answers = decode_set(decoder, &sets.test).map_err(|error| Box::new(RunError::from(error)))?;
            Ok::<_, BundleError>(TestErrors::measure(&problem, &sets.test, &answers))
        };
        let errors_of_linear = errors(&mut *linear)?;
        let decoder = match kind {
            BundleDecoder::Linear => Some(linear),
            BundleDecoder::Kind(kind) => set.decoder(kind, Precision::Double).map_err(Box::new)?,
            BundleDecoder::Chosen => None,
        };
        let no_network = || BundleError::Unsuitable(format!("{kind} needs a trained network: train one first"));
        let mut decoder = decoder.ok_or_else(no_network)?;
        Ok(Self {
            kind,
            program: decoder.program().expect("a decoder without a program is refused"),
            unlimited: None,
            reading_ranges,
            target_ranges: target_ranges.into_iter().flatten().collect(),
            errors: errors(&mut *decoder)?,
            errors_of_linear,
            half_widths: Vec::new(),
            trained_by: PROGRAM.to_owned(),
            settings,
            row_wires: sets.test.row_wires_read().map(<[usize]>::to_vec),
            files: file_names(setup.plan()),
            test: Some(sets.test),
            problem,
        })
    }

    /// Exports networks that were trained on samples in memory, with the description of their channels and the row-wires
    /// with a network each. Without test samples the bundle contains no errors.
    pub fn of_networks(
        networks: &Networks,
        combined: Option<&Combined>,
        settings: RunSettings,
        problem: Problem,
        row_wires: Option<Vec<usize>>,
    ) -> Self {
        let all = networks.values().iter();
        // A combination of the network alone differs from it only in the limits of the readings.
        let of_several = combined.filter(|combined| !combined.others.is_empty());
        Self {
            program: networks.decoder_program(&problem, combined),
            unlimited: of_several.is_none().then(|| networks.program(Precision::Double)),
            kind: of_several.map_or_else(BundleDecoder::default, |_| BundleDecoder::Chosen),
            target_ranges: all.clone().map(|network| network.outputs().clone()).collect(),
            reading_ranges: all.map(|network| network.inputs().range().cloned()).collect(),
            errors: TestErrors::Targets(Vec::new()),
            errors_of_linear: TestErrors::Targets(Vec::new()),
            half_widths: Vec::new(),
            test: None,
            trained_by: PROGRAM.to_owned(),
            settings,
            problem,
            row_wires,
            files: Vec::new(),
        }
    }

    /// Exports what a file answers with, or its network alone.
    fn of_file(file: &NetworkFile, decoder: BundleDecoder, test: Option<Arc<Dataset>>) -> Self {
        let is_wanted = |combined: &&Combined| decoder == BundleDecoder::Chosen || combined.others.is_empty();
        let combined = file.combined().filter(is_wanted);
        let (problem, row_wires) = (file.problem.clone(), file.row_wires.clone());
        let exported = Self::of_networks(&file.network, combined, file.settings, problem, row_wires);
        let alone = file.scores.network_alone.as_ref();
        let alone = alone.filter(|_| exported.kind != BundleDecoder::Chosen);
        // The intervals are those of what the file answers with.
        let intervals = file.intervals.as_ref().filter(|_| alone.is_none());
        let half_widths = intervals.and_then(|intervals| intervals.targets.iter().cloned().collect());
        Self {
            errors: alone.unwrap_or(&file.scores.network).clone(),
            errors_of_linear: file.scores.baselines.linear.clone(),
            half_widths: half_widths.unwrap_or_default(),
            test,
            trained_by: file.program.clone(),
            files: file_names(file.recorded.as_ref().map(|recorded| &recorded.plan)),
            ..exported
        }
    }

    /// Kind of decoder.
    pub fn kind(&self) -> BundleDecoder {
        self.kind
    }

    /// Number of row-wires that are distinguished; 1 if the row is not an argument.
    fn rows(&self) -> usize {
        self.reading_ranges.len().max(self.program.rows())
    }

    fn meaning(&self) -> Meaning {
        let Problem { inputs, targets, .. } = self.problem.clone();
        let is_array = self.problem.sensor.is_some();
        // Comments of C have no Ω.
        let in_ohm = |channel: Channel| match is_array {
            true => Channel::new(channel.name, Some("ohm")),
            false => channel,
        };
        Meaning {
            is_array,
            inputs: inputs.into_iter().map(in_ohm).collect(),
            targets,
            row_wires: self.row_wires.clone().filter(|_| self.rows() > 1).unwrap_or_default(),
        }
    }

    /// The memory of past readings, if the decoder takes any.
    fn memory(&self) -> Option<&Memory> {
        self.problem.memory.as_ref().filter(|memory| !memory.is_empty())
    }

    /// Limits of the readings, or of the features of a history, beyond which they count as outside: for all row-wires or for
    /// each; `None` if the range in training is not known.
    pub(super) fn limits(&self) -> Option<Limits> {
        let quantity = match are_positive(&self.program) {
            true => Quantity::Resistance,
            false => Quantity::Raw,
        };
        let of_row = |range: &Option<MinMax>| {
            let range = range.as_ref()?;
            let channels = 0..range.channels();
            Some(channels.map(|channel| range.limits(quantity, channel)).collect())
        };
        self.reading_ranges.iter().map(of_row).collect()
    }

    /// Collects what a bundle contains.
    ///
    /// # Errors
    /// No readings could be drawn, or one cannot be decoded.
    pub(super) fn contents(&self, name: &str, precision: BundlePrecision) -> Result<Contents, BundleError> {
        let (channels, meaning) = (self.problem.inputs.len(), self.meaning());
        let saturates = precision == BundlePrecision::Fixed16;
        let unlimited = self.unlimited.as_ref().filter(|_| saturates);
        let mut program = unlimited.unwrap_or(&self.program).clone();
        if let Some(memory) = self.memory() {
            let with_history = program.with_history(memory, channels);
            program = with_history.map_err(|error| Box::new(RunError::from(error)))?;
        }
        let exported = ExportedProgram::of(&program, &self.half_widths, self.limits().as_ref());
        let (rows, printed) = self.readings(channels)?;
        let outputs = exported.outputs();
        let scales = (0..outputs).map(|output| match meaning.is_array {
            true => scale(&self.target_ranges, 0..outputs),
            false => scale(&self.target_ranges, output..output + 1),
        });
        let is_drawn = self.test.is_none() && !meaning.is_array;
        let note = "the golden readings are drawn from the range in training, because the recording was not found";
        let mut contents = Contents {
            name: name.to_owned(),
            noun: self.kind.noun(),
            precision,
            names: names(&exported, &meaning),
            rows: self.rows(),
            golden: Golden::of(rows, printed, &program, outputs)?,
            scales: scales.collect(),
            meaning,
            exported,
            metadata: Value::Null,
            notes: is_drawn.then(|| note.to_owned()).into_iter().collect(),
        };
        contents.metadata = self.metadata(&contents);
        Ok(contents)
    }

    /// Readings of the caller, and the number of those for the bundle, which come first: of test samples, or drawn from the
    /// scene of a simulated sensor or from the range in training.
    ///
    /// # Errors
    /// The scene could not be drawn, or the range is not known.
    fn readings(&self, channels: usize) -> Result<(Vec<GoldenRow>, usize), BundleError> {
        /// Rows by which the accuracy is found, and those of them in the bundle.
        const ROWS: [usize; 2] = [200, 30];
        let takes_row = self.rows() > 1;
        let of_set = |set: &Dataset, sample: usize| {
            let row = if takes_row { set.row_index(sample) } else { 0 };
            GoldenRow::new(row, set.sample_readings(sample)[..channels].to_vec())
        };
        let memory = self.memory();
        let mut rows = match (&self.problem.sensor, &self.test) {
            (Some(simulation), _) => {
                let rows = simulation.rows().unwrap_or(1);
                let few = Simulation {
                    test_samples: ROWS[0].next_multiple_of(rows.max(1)),
                    ..*simulation
                };
                let set = few.draw_test(self.settings.seed).map_err(Box::new)?;
                let samples = 0..set.samples().min(2 * ROWS[0]);
                samples.map(|sample| of_set(&set, sample)).collect()
            }
            (None, Some(test)) => {
                let count = test.samples().min(ROWS[0]);
                // Readings with a history are successive.
                let sample = |place| match memory {
                    Some(_) => place,
                    None => place * test.samples() / count,
                };
                (0..count).map(|place| of_set(test, sample(place))).collect()
            }
            (None, None) => self.drawn(channels, ROWS[0])?,
        };
        match memory {
            Some(memory) => set_times(&mut rows, memory.interval_s.unwrap_or(1.0)),
            None => rows.splice(..0, self.corners()).for_each(drop),
        }
        Ok((rows, ROWS[1] + self.rows()))
    }

    /// The smallest, middle and largest readings of each range in training.
    fn corners(&self) -> Vec<GoldenRow> {
        let ranges = self.reading_ranges.iter().enumerate();
        let known = ranges.filter_map(|(row, range)| Some((row, range.as_ref()?)));
        let of_range = |(row, range): (usize, &MinMax)| {
            [0.0, 0.5, 1.0].map(|place| GoldenRow::new(row, readings_at(range, range.channels(), || place)))
        };
        known.flat_map(of_range).collect()
    }

    /// Readings that are uniform in their range in training.
    fn drawn(&self, channels: usize, count: usize) -> Result<Vec<GoldenRow>, BundleError> {
        let no_range = || {
            let cause = "the network file does not have the range of the readings in training, without which no bundle can be \
                         verified: train again";
            BundleError::Unsuitable(cause.to_owned())
        };
        let mut rng = Seed::default().rng(Stream::Test);
        let row = |place: usize| {
            let row = place % self.reading_ranges.len();
            let range = self.reading_ranges[row].as_ref().ok_or_else(no_range)?;
            let readings = readings_at(range, channels, || rng.random::<f64>());
            Ok(GoldenRow::new(row, readings))
        };
        (0..count).map(row).collect()
    }

    /// Collects the metadata of a bundle.
    fn metadata(&self, contents: &Contents) -> Value {
        let names = |channels: &[Channel]| Vec::from_iter(channels.iter().map(|channel| channel.name.clone()));
        let units = |channels: &[Channel]| Vec::from_iter(channels.iter().map(|channel| channel.unit.clone()));
        let (inputs, targets) = (&contents.meaning.inputs, &contents.meaning.targets);
        let named = |errors: &TestErrors| {
            let of = |(target, errors): (&Channel, &TargetErrors)| json!({ "name": target.name, "errors": errors });
            targets.iter().zip(errors.targets()).map(of).collect::<Vec<_>>()
        };
        let row_wires = self.row_wires.iter().flatten().map(|row_wire| row_wire + 1);
        let mut fields = match &self.problem.sensor {
            Some(Simulation {
                sensor, scene, samples, ..
            }) => json!({
                "array": sensor.scale.to_string(),
                "geometry": sensor.geometry,
                "scene": scene,
                "rows": scene.rows.to_string(),
                "row_numbers": contents.takes_row().then_some([1, contents.rows]),
                "inputs": { "names": names(inputs), "unit": "ohm" },
                "outputs": { "names": names(targets), "unit": "mm" },
                "training_samples": samples,
                "errors": self.errors.nodes(),
                "readings_in_training_ohm": self.ranges(),
                "output_range_mm": contents.scales[0],
            }),
            None => json!({
                "files": self.files,
                "row_numbers": contents.takes_row().then(|| row_wires.collect::<Vec<_>>()),
                "inputs": { "names": names(inputs), "units": units(inputs) },
                "memory": self.problem.memory,
                "outputs": { "names": names(targets), "units": units(targets) },
                "method": self.settings.training.method.short_name(),
                "errors": named(&self.errors),
                "errors_of_ridge": named(&self.errors_of_linear),
                "readings_in_training": self.ranges(),
                "output_ranges": contents.scales,
            }),
        };
        fields["program"] = json!(PROGRAM);
        fields["trained_by"] = json!(self.trained_by);
        fields["decoder"] = json!(self.kind.to_string());
        fields["takes_row"] = json!(contents.takes_row());
        fields["steps"] = json!(steps(contents));
        fields["precision"] = json!(contents.precision.to_string());
        fields["seed"] = json!(self.settings.seed);
        if self.kind == BundleDecoder::default() {
            let mut operations = contents.computed();
            let hidden = operations.find(|(_, operation)| matches!(operation, Operation::Map(Function::Tanh, _)));
            fields["hidden_nodes"] = json!(hidden.map(|(id, _)| contents.size(id)));
        }
        fields
    }

    /// Smallest and largest readings in training, row by row; with a history, of all features.
    fn ranges(&self) -> Vec<Option<Value>> {
        let range = |range: &MinMax| {
            let extremes = (0..range.channels()).map(|channel| range.extremes(channel));
            let (minimum, maximum): (Vec<f64>, Vec<f64>) = extremes.unzip();
            json!({ "minimum": minimum, "maximum": maximum })
        };
        let of_rows = self.reading_ranges.iter();
        of_rows.map(|of_row| of_row.as_ref().map(range)).collect()
    }
}

/// Readings at a place from 0 to 1 of the range of each channel.
fn readings_at(range: &MinMax, channels: usize, mut place: impl FnMut() -> f64) -> Vec<f64> {
    let mut between = |channel| {
        let ((low, high), place) = (range.extremes(channel), place());
        if place == 1.0 { high } else { low + place * (high - low) }
    };
    (0..channels).map(&mut between).collect()
}

/// Times at the usual interval with a pause and a step back, and a series that begins after half of the rows.
fn set_times(rows: &mut [GoldenRow], interval_s: f64) {
    let count = rows.len();
    let mut time_s = 0.0;
    for (place, row) in rows.iter_mut().enumerate() {
        // Within the rows of the bundle, too.
        match place {
            10 => time_s += 2.0 * GAP * interval_s,
            20 => time_s -= 5.0 * interval_s,
            _ => time_s += interval_s * [1.0, 0.5, 1.7][place % 3],
        }
        row.is_new_series = place == 0 || place == 15 || place == count / 2;
        row.time_s = Some(time_s);
    }
}

/// Widest range in training among these outputs of all rows.
fn scale(targets: &[MinMax], outputs: std::ops::Range<usize>) -> f64 {
    let extremes = targets
        .iter()
        .flat_map(|of_row| outputs.clone().map(|output| of_row.extremes(output)));
    let (width, largest) = extremes.fold((0.0_f64, 0.0_f64), |(width, largest), (low, high)| {
        (width.max(high - low), largest.max(low.abs()).max(high.abs()))
    });
    // Outputs that did not vary are constants, and deviations are relative to these.
    [width, largest].into_iter().find(|&scale| scale > 0.0).unwrap_or(1.0)
}

/// Describes the steps of the program with their sizes.
fn steps(contents: &Contents) -> Vec<String> {
    let step = |(id, operation): (NodeId, &Operation)| {
        let size = contents.size(id);
        Some(match operation {
            Operation::Affine { of, .. } => format!("affine, {} to {size}", contents.size(*of)),
            Operation::Map(Function::Tanh, _) => format!("hyperbolic tangent of {size}"),
            Operation::Map(Function::Gaussian, _) => format!("{size} Gaussians"),
            Operation::Map(..) => format!("logarithm of {size}"),
            Operation::Divide(..) => format!("relative changes of {size}"),
            Operation::History { of, .. } => format!("history, {} to {size}", contents.size(*of)),
            _ => return None,
        })
    };
    contents.computed().filter_map(step).collect()
}

fn file_names(plan: Option<&Plan>) -> Vec<String> {
    let paths = plan.into_iter().flat_map(Plan::files);
    let name = |path: PathBuf| Some(path.file_name()?.to_string_lossy().into_owned());
    paths.filter_map(name).collect()
}
