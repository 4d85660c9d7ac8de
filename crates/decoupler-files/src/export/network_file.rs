use std::{path::Path, sync::Arc, time::Duration};

use decoupler_core::{
    dataset::{Dataset, DatasetError, Memory, Simulation},
    decoupling::{Combined, ProgramDecoder},
    evaluation::{ErrorTable, Intervals, Run, RunSettings, Scores, TestErrors},
    job::Job,
    live::{DriftReference, LiveError},
    network::Networks,
    problem::{Channel, Problem, TargetPosition},
    scene::Rows,
};
use glam::DVec3;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{
    AtomicFile, DocumentError, DocumentKind, TrainingRecord, WriteError, document::PROGRAM, unfinished::folder_of,
};
use crate::import::{InputTable, LineParser, Recipe, Recorded, Setup, SetupError, stored};

const KIND: DocumentKind = DocumentKind::Network;

/// A trained network with its settings, the description of its channels, the record of its training, and its errors; for a
/// recording also the plan that reads it. The file is JSON; a network that is read back gives bit-identical results.
///
/// Paths of recordings are stored relative to the folder of the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkFile {
    /// Program and version that wrote the file.
    #[serde(skip)]
    pub program: String,
    /// Settings of the run: source, method, stopping rules, seed.
    pub settings: RunSettings,
    /// Origin of recorded samples, with absolute paths; `None` for a simulated array.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recorded: Option<Recorded>,
    /// Names, units and positions of readings and targets.
    #[serde(with = "SavedProblem")]
    pub problem: Problem,
    /// Row-wires of the samples in ascending order, from 0, if they are known.
    pub row_wires: Option<Vec<usize>>,
    /// Best network of the training, or best network of each row-wire.
    pub network: Networks,
    /// Record of the training.
    pub training: TrainingRecord,
    /// Errors of the network and of the baselines on the test set.
    pub scores: Scores,
    /// Prediction intervals of the answers, if they were calibrated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intervals: Option<Intervals>,
    /// Training readings of a recording, by which a later drift is detected, or the reason why they are not monitored.
    #[serde(
        default = "not_described",
        skip_serializing_if = "is_not_described",
        serialize_with = "write_drift",
        deserialize_with = "read_drift"
    )]
    pub drift: Result<DriftReference, LiveError>,
}

const NODES_OF_RECORDING: &str = "problem: the targets of a recording are not nodes";

/// Older files have no description of the training readings if there were too few.
fn not_described() -> Result<DriftReference, LiveError> {
    Err(LiveError::NotDescribed)
}

fn is_not_described(drift: &Result<DriftReference, LiveError>) -> bool {
    *drift == not_described()
}

fn write_drift<S: Serializer>(drift: &Result<DriftReference, LiveError>, serializer: S) -> Result<S::Ok, S::Error> {
    match drift {
        Ok(reference) => reference.serialize(serializer),
        Err(error) => serializer.collect_map([("not_monitored", error)]),
    }
}

fn read_drift<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Result<DriftReference, LiveError>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Saved {
        Monitored(DriftReference),
        NotMonitored { not_monitored: LiveError },
        Older(serde::de::IgnoredAny),
    }
    Ok(match Saved::deserialize(deserializer)? {
        Saved::Monitored(reference) => Ok(reference),
        Saved::NotMonitored { not_monitored } => Err(not_monitored),
        // A description for the monitor of an older version.
        Saved::Older(_) => not_described(),
    })
}

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

/// Network that a run stopped at an epoch would have returned.
#[derive(Clone, Debug, PartialEq)]
pub struct PastNetwork {
    /// Epoch at which the run is assumed to stop.
    pub epoch: usize,
    /// Epoch of these weights: the best so far.
    pub best_epoch: usize,
    /// Index of the start that was the leader at that epoch.
    pub start: usize,
    /// Training time up to that epoch.
    pub elapsed: Duration,
    /// The shared network, or the network of each row-wire.
    pub networks: Networks,
}

impl NetworkFile {
    /// Captures the best network of `run` so far, with its record and errors; `recorded` is the origin of its samples
    /// if they are recorded.
    ///
    /// # Errors
    /// [`DocumentError::NoPlan`] if the samples are recorded and no plan is given.
    pub fn from_run(run: &Run, recorded: Option<&Recorded>) -> Result<Self, DocumentError> {
        let scores = run.scores().ok_or(DocumentError::NoPlan(KIND))?;
        let mut recorded = KIND.recorded_of(run, recorded)?;
        if let (Some(recorded), None) = (&mut recorded, run.combined()) {
            // The training was stopped, or has not ended.
            recorded.forget_choice();
        }
        Ok(Self {
            program: PROGRAM.to_owned(),
            settings: *run.settings(),
            recorded,
            problem: Problem::clone(run.problem()),
            row_wires: run.test().row_wires_read().map(<[usize]>::to_vec),
            network: run.network(),
            training: TrainingRecord::of(run),
            scores,
            intervals: run.intervals().cloned(),
            drift: Err(LiveError::NotDescribed),
        })
    }

    /// Captures the network that `run` would have kept if it had been stopped at a past epoch, with its record until
    /// then and its errors.
    ///
    /// # Errors
    /// As [`Self::from_run`].
    pub fn from_past(run: &Run, recorded: Option<&Recorded>, past: &PastNetwork) -> Result<Self, DocumentError> {
        let mut file = Self::from_run(run, recorded)?;
        file.network = past.networks.clone();
        // Intervals and combination belong to the latest network.
        file.intervals = None;
        file.scores.network_alone = None;
        if let Some(recorded) = &mut file.recorded {
            recorded.forget_choice();
        }
        file.scores.network = run.errors_of(&file.decoder().answers_to(run.test()));
        file.scores.coverage.clear();
        file.training = TrainingRecord::until(run, past);
        Ok(file)
    }

    /// Combination that the file answers with, if settings were chosen; otherwise the network alone.
    pub fn combined(&self) -> Option<&Combined> {
        self.recorded.as_ref()?.combined.as_ref()
    }

    /// Decoder of the answers: the combination if settings were chosen, otherwise the network. For a recording, readings are
    /// limited to their range in training, extended by a tenth.
    pub fn decoder(&self) -> ProgramDecoder {
        ProgramDecoder::new(self.network.decoder_program(&self.problem, self.combined()))
    }

    /// Returns a parser of lines with the readings of the network. `needs_rows` asks for the row-wire of each line of an array
    /// even if one network serves all; `is_complete` means that the input is read from its beginning and no line is lost.
    ///
    /// # Errors
    /// If the array does not have the row-wires of the scene, or the memory is invalid.
    pub fn line_parser(&self, needs_rows: bool, is_complete: bool) -> Result<LineParser, DatasetError> {
        if let Some(simulation) = &self.problem.sensor {
            let rows = match simulation.scene.rows {
                Rows::All if needs_rows => Rows::Known,
                rows => rows,
            };
            return Ok(LineParser::of_array(simulation.sensor.scale, rows, is_complete)?);
        }
        let plain = Recipe::default();
        let recipe = self.recorded.as_ref().map_or(&plain, |recorded| &recorded.plan.import);
        let has_rows = self.network.only().is_none();
        let row_wires = self.row_wires.clone().filter(|_| has_rows);
        LineParser::of_recording(&self.problem, recipe, row_wires)
    }

    /// Returns the index of the network of each line of `table`; 0 if one network reads all.
    ///
    /// # Errors
    /// If the row-wire of a line is not known or has no network, as a sentence about the file.
    pub fn row_indices(&self, table: &InputTable) -> Result<Vec<usize>, String> {
        if self.network.only().is_some() {
            return Ok(vec![0; table.lines.len()]);
        }
        let (recorded, read) = (self.recorded.as_ref(), self.row_wires.as_deref().unwrap_or_default());
        let Some(of_lines) = &table.row_wires else {
            let column = recorded.and_then(|recorded| recorded.plan.import.row_wire.as_deref());
            return Err(format!(
                "it has no column '{}' with the row number of each line, which is needed because each row has its own \
                 network; add it",
                column.unwrap_or_default()
            ));
        };
        let index = |(row_wire, line): (&usize, &u64)| {
            let unknown = |_| {
                let row = row_wire + 1;
                format!("line {line}: there is no network for row {row}; train with samples of it")
            };
            read.binary_search(row_wire).map_err(unknown)
        };
        of_lines.iter().zip(&table.lines).map(index).collect()
    }

    /// Setup of the run.
    pub fn setup(&self) -> Setup {
        let plan = self.recorded.as_ref().map(|recorded| recorded.plan.clone());
        let setup = Setup::of(self.settings, plan).expect("reading and writing check that a recording has its plan");
        setup.stored()
    }

    /// Returns the test set of the run, drawn or read again, as a report of it needs.
    ///
    /// # Errors
    /// The recording is missing or has changed, or the settings are invalid.
    pub fn test_set(&self) -> Result<Arc<Dataset>, SetupError> {
        if let Some(simulation) = self.settings.simulation() {
            return Ok(Arc::new(simulation.draw_test(self.settings.seed)?));
        }
        let sets = self.setup().sets(Path::new(""), &Job::UNINTERRUPTED, &mut |_| ())?;
        sets.check_saved(self.recorded.as_ref())?;
        Ok(sets.sets.test)
    }

    /// Name of the source: the array scale, or the stem of the first recording.
    pub fn source_name(&self) -> String {
        self.setup().source_name()
    }

    /// Errors of the network and of the baselines, next to the published ones if there are any.
    pub fn error_table(&self) -> Vec<ErrorTable> {
        ErrorTable::of_scores(&self.problem, &self.scores, self.settings.published().as_ref())
    }

    /// Writes the file whole or not at all.
    ///
    /// # Errors
    /// The network has values that could not be read back, or the path cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), DocumentError> {
        self.save_by(path, AtomicFile::commit)
    }

    /// As [`Self::save`]; `commit` puts the file in its place.
    pub(super) fn save_by<T>(
        &self,
        path: &Path,
        commit: fn(AtomicFile) -> Result<T, WriteError>,
    ) -> Result<T, DocumentError> {
        self.check().map_err(|defect| DocumentError::unsound(path, defect))?;
        let located = |recorded: &Recorded| recorded.with_paths(|file| stored(file, folder_of(path)));
        let file = Self {
            recorded: self.recorded.as_ref().map(located),
            ..self.clone()
        };
        Ok(KIND.save(&self.program, &file, path, commit)?)
    }

    /// Name of a network file that is only text, in messages.
    const TEXT: &str = "network in memory";

    /// Text of the file with the paths as they are, for a program that stores it elsewhere than in a file.
    ///
    /// # Errors
    /// The network has values that could not be read back.
    pub fn to_text(&self) -> Result<String, DocumentError> {
        let checked = self.check();
        let text = checked.and_then(|()| KIND.seal(&self.program, self).map_err(|error| error.to_string()));
        text.map_err(|defect| DocumentError::unsound(Path::new(Self::TEXT), defect))
    }

    /// Reads the text of [`Self::to_text`].
    ///
    /// # Errors
    /// The text is damaged.
    pub fn from_text(text: &str) -> Result<Self, DocumentError> {
        let read = KIND.unseal(text.as_bytes());
        let checked = read.and_then(|(program, file): (_, Self)| file.completed(program, Path::new("")));
        checked.map_err(|defect| KIND.damaged(Path::new(Self::TEXT), defect))
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or version, or is damaged.
    pub fn load(path: &Path) -> Result<Self, DocumentError> {
        let (program, file): (_, Self) = KIND.load(path)?;
        file.completed(program, folder_of(path))
            .map_err(|defect| KIND.damaged(path, defect))
    }

    /// Completes and checks the contents of a file in `folder`.
    fn completed(mut self, program: String, folder: &Path) -> Result<Self, String> {
        self.program = program;
        self.recorded = self.recorded.map(|recorded| recorded.within(folder));
        if let Some(sensor) = &mut self.problem.sensor {
            *sensor = *self.settings.simulation().ok_or(NODES_OF_RECORDING)?;
        }
        self.check().map(|()| self)
    }

    /// Checks that the file can be read back. Done before writing and after reading, so that every file that is written can be
    /// read.
    ///
    /// # Errors
    /// The first defect, with its field.
    pub fn check(&self) -> Result<(), String> {
        let (settings, problem, network, scores) = (&self.settings, &self.problem, &self.network, &self.scores);
        check_settings(settings, self.recorded.as_ref())?;
        let (simulation, targets) = (settings.simulation(), problem.targets.len());
        let is_impossible = |memory: &Memory| memory.check(problem.inputs.len()).is_err();
        let is_unplaced = |position: &TargetPosition| position.target >= targets;
        match simulation {
            Some(array) if *problem != array.problem() => Err("problem: it does not match the array"),
            None if problem.has_nodes() => Err(NODES_OF_RECORDING),
            None if problem.memory.as_ref().is_some_and(is_impossible) => {
                Err("problem.memory: it is not possible for these inputs")
            }
            None if problem.positions.iter().any(is_unplaced) => Err("problem.positions: a target does not exist"),
            _ => Ok(()),
        }?;
        let weights = network.values().iter().map(|network| network.mlp().weights());
        let infinite = weights.filter_map(|weights| weights.iter().position(|weight| !weight.is_finite()));
        refuse(infinite.map(|index| format!("network: weight {index} is not a finite number")))?;
        check_number(network, settings, self.row_wires.as_deref())?;
        let sizes = network.values().iter().flat_map(|network| {
            let (inputs, outputs) = (network.inputs().channels(), network.outputs().channels());
            let hidden = network.mlp().shape().hidden;
            [
                ("reads", inputs, problem.feature_count(), "readings"),
                ("gives", outputs, targets, "targets"),
                ("has", hidden, settings.network_hidden(), "hidden nodes"),
            ]
        });
        let wrong = sizes.filter(|(_, found, expected, _)| found != expected);
        refuse(wrong.map(|(verb, found, expected, what)| {
            format!("network: it {verb} {found} {what}, but the settings need {expected}")
        }))?;
        if let Some(simulation) = simulation {
            check_places(network, simulation)?;
        }
        self.check_training()?;
        if let Some(intervals) = &self.intervals {
            let checked = intervals.check(targets);
            checked.map_err(|defect| format!("intervals: {defect}"))?;
        }
        let is_other = |drift: &DriftReference| !drift.is_valid() || drift.channels() != problem.inputs.len();
        if self.drift.as_ref().is_ok_and(is_other) {
            return Err("drift: it does not match the inputs".to_owned());
        }
        let combined = self.combined();
        let defect = combined.and_then(|combined| combined.defect(problem.feature_count(), targets));
        refuse(defect.map(|defect| format!("recorded.combined: {defect}")))?;
        let errors = [
            ("network", Some(&scores.network)),
            ("network_alone", scores.network_alone.as_ref()),
            ("baselines.mean", Some(&scores.baselines.mean)),
            ("baselines.linear", Some(&scores.baselines.linear)),
            ("baselines.model_based", scores.baselines.model_based.as_ref()),
        ];
        let defects = errors.into_iter().filter_map(|(place, errors)| {
            let defect = defect_of_errors(errors?, problem)?;
            Some(format!("scores.{place}{defect}"))
        });
        refuse(defects)
    }

    fn check_training(&self) -> Result<(), String> {
        let (training, starts) = (&self.training, &self.training.starts);
        let (best_epoch, epochs, seconds) = (training.best_epoch, training.epochs, training.seconds);
        let last = training.history.last().ok_or("training.history: it is empty")?.epoch;
        let (found, expected) = (starts.len(), self.settings.starts);
        let infinite = starts.iter().position(|start| {
            let figures = [Some(start.train_mse), start.validation_mse, start.percent()];
            figures.into_iter().flatten().any(|figure| !figure.is_finite())
        });
        let defects = [
            (epochs != last).then(|| format!("epochs: it is {epochs}, but the history ends with epoch {last}")),
            (best_epoch > last).then(|| format!("best_epoch: {best_epoch} is after the last, {last}")),
            (!(0.0..f64::INFINITY).contains(&seconds)).then(|| format!("seconds: {seconds} is not a time")),
            (found != 0 && found != expected)
                .then(|| format!("starts: {found} of them, but the settings ask for {expected}")),
            infinite.map(|place| format!("starts: an error of number {place} is not a finite number")),
        ];
        refuse({ defects.into_iter().flatten() }.map(|defect| format!("training.{defect}")))
    }
}

/// Returns the first defect as an error.
fn refuse(defects: impl IntoIterator<Item = String>) -> Result<(), String> {
    defects.into_iter().next().map_or(Ok(()), Err)
}

/// Checks the settings in a file, and that a recording has its plan.
///
/// # Errors
/// The first invalid value, with its field.
pub(super) fn check_settings(settings: &RunSettings, recorded: Option<&Recorded>) -> Result<(), String> {
    (settings.check_counts()).map_err(|defect| format!("settings: {defect}"))?;
    if let Some(Simulation { sensor, scene, .. }) = settings.simulation() {
        (sensor.check()).map_err(|defect| format!("settings.source.sensor: {defect}"))?;
        (scene.check()).map_err(|defect| format!("settings.source.scene: {defect}"))?;
    }
    (settings.training.check()).map_err(|defect| format!("settings.training: {defect}"))?;
    match (settings.simulation(), recorded) {
        (Some(_), Some(_)) => Err("recorded: the source is a simulated array".to_owned()),
        (None, None) => Err("recorded: it is missing".to_owned()),
        _ => Ok(()),
    }
}

fn check_number(network: &Networks, settings: &RunSettings, row_wires: Option<&[usize]>) -> Result<(), String> {
    let found = network.values().len();
    let Some(source) = settings.simulation() else {
        let rows = row_wires.map_or(1, <[usize]>::len);
        let defect = || format!("network: {found} of them for {rows} row-wires");
        return refuse((found != 1 && found != rows).then(defect));
    };
    let rows = source.rows();
    let rows = rows.map_err(|defect| format!("settings.source.scene.rows: {defect}"))?;
    let needed = source.scene.rows.model().decoders(rows);
    let (rows, scale) = (source.scene.rows, source.sensor.scale);
    let defect = || format!("network: {found} of them, but rows {rows} of {scale} need {needed}");
    refuse((found != needed).then(defect))
}

/// Describes the first coordinate whose training range is out of reach of the nodes of the scene, even with a margin of
/// one stroke. Networks whose sizes or number do not match the settings are not checked.
fn check_places(networks: &Networks, simulation: &Simulation) -> Result<(), String> {
    let Simulation { sensor, scene, .. } = simulation;
    let Ok(rows) = scene.rows.read(sensor.scale.rows()) else {
        return Ok(());
    };
    let spare_mm = simulation.stroke_mm() + scene.movement.largest_shift_mm();
    for (index, network) in networks.values().iter().enumerate() {
        let outputs = network.outputs();
        let rows = match networks.only() {
            Some(_) => &rows[..],
            None => rows.get(index..=index).unwrap_or_default(),
        };
        for channel in 0..outputs.channels() {
            let (node, axis) = (channel / 3, channel % 3);
            let rest_mm = rows
                .iter()
                .map(|&row| sensor.displaced_mm(row, node, DVec3::ZERO).to_array()[axis]);
            let (low, high) = rest_mm.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), rest_mm| {
                (low.min(rest_mm), high.max(rest_mm))
            });
            let rounding_mm = 1e-9 * (low.abs().max(high.abs()) + spare_mm);
            let possible = low - spare_mm - rounding_mm..=high + spare_mm + rounding_mm;
            let (min, max) = outputs.extremes(channel);
            if !possible.contains(&min) || !possible.contains(&max) {
                let node = node + 1;
                return Err(format!(
                    "network: node {node} was trained from {min:e} to {max:e} mm, but lies from {low} to {high} mm"
                ));
            }
        }
    }
    Ok(())
}

/// Describes what is wrong with errors of these targets, if anything is.
fn defect_of_errors(errors: &TestErrors, problem: &Problem) -> Option<String> {
    let expected = problem.targets.len();
    match errors {
        TestErrors::Nodes(_) if !problem.has_nodes() => Some(": the targets are not nodes".to_owned()),
        TestErrors::Targets(_) if problem.has_nodes() => Some(": the targets are nodes".to_owned()),
        TestErrors::Targets(found) if found.len() != expected => {
            Some(format!(": {} of them for {expected} targets", found.len()))
        }
        _ => errors
            .infinite_figure()
            .map(|name| format!(".{name}: it is not a finite number")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_drift_reference_of_an_older_version_is_dropped() {
        let older =
            r#"{"metric":{"means":[0.0],"inverse_deviations":[1.0],"factor":[1.005]},"block":5,"distances":[1.0]}"#;
        for (saved, expected) in [
            (older, LiveError::NotDescribed),
            (r#"{"not_monitored":"constant"}"#, LiveError::Constant),
            (
                r#"{"not_monitored":{"too_few_readings":{"blocks":4,"block":5}}}"#,
                LiveError::TooFewReadings { blocks: 4, block: 5 },
            ),
        ] {
            let found = read_drift(&mut serde_json::Deserializer::from_str(saved)).unwrap();
            assert_eq!(found, Err(expected));
        }
    }
}
