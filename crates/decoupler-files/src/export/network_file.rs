use std::{fmt::Display, io::Write as _, path::Path, sync::Arc, time::Duration};

use decoupler_core::{
    dataset::{Dataset, DatasetError, Simulation},
    decoupling::{Combined, ProgramDecoder},
    evaluation::{ErrorTable, Intervals, Run, RunSettings, Scores, StartRecord, TestErrors},
    job::Job,
    live::{DriftReference, LiveError},
    network::{DecouplingNetwork, Networks},
    problem::{Problem, TargetPosition},
    scene::Rows,
};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use serde_json::value::{RawValue, to_raw_value};

use super::{
    AtomicFile, DocumentError, DocumentKind, SavedProblem, TrainingRecord, WriteError,
    atomic::{LARGEST_BYTES, too_large},
    document::PROGRAM,
    unfinished::folder_of,
};
use crate::import::{LineParser, Recipe, Recorded, Setup, SetupError};

const KIND: DocumentKind = DocumentKind::Network;

/// A trained network with its settings, the description of its channels, the record of its training, and its errors; for a
/// recording also the plan that reads it. The file is JSON; a network that is read back gives bit-identical results.
///
/// Paths of recordings are stored relative to the folder of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkFile {
    /// Program and version that wrote the file.
    pub program: String,
    /// Settings of the run: source, method, stopping rules, seed.
    pub settings: RunSettings,
    /// Origin of recorded samples, with absolute paths; `None` for a simulated array.
    pub recorded: Option<Recorded>,
    /// Names, units and positions of readings and targets.
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
    pub intervals: Option<Intervals>,
    /// Training readings of a recording, by which a later drift is detected, or the reason why they are not monitored.
    pub drift: Result<DriftReference, LiveError>,
}

/// The part of the file that the checksum covers.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    settings: RunSettings,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    recorded: Option<Recorded>,
    problem: SavedProblem,
    row_wires: Option<Vec<usize>>,
    network: Networks,
    training: TrainingRecord,
    scores: Scores,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    intervals: Option<Intervals>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    drift: Option<SavedDrift>,
}

const NODES_OF_RECORDING: &str = "problem: the targets of a recording are not nodes";

/// Description of the training readings as it is saved; older files have none if there were too few readings.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum SavedDrift {
    Monitored(DriftReference),
    NotMonitored {
        not_monitored: LiveError,
    },
    /// Description for the monitor of an older version.
    #[serde(skip_serializing)]
    Older(serde::de::IgnoredAny),
}

impl SavedDrift {
    fn of(drift: Result<DriftReference, LiveError>) -> Option<Self> {
        match drift {
            Ok(reference) => Some(Self::Monitored(reference)),
            Err(LiveError::NotDescribed) => None,
            Err(not_monitored) => Some(Self::NotMonitored { not_monitored }),
        }
    }

    fn read(saved: Option<Self>) -> Result<DriftReference, LiveError> {
        match saved {
            Some(Self::Monitored(reference)) => Ok(reference),
            Some(Self::NotMonitored { not_monitored }) => Err(not_monitored),
            Some(Self::Older(_)) | None => Err(LiveError::NotDescribed),
        }
    }
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
    /// Training time of that start up to that epoch, summed over all rows.
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
    pub(super) fn save_by(&self, path: &Path, commit: Commit) -> Result<(), DocumentError> {
        let run = self.run_record(path, |recorded| recorded.relative_to(folder_of(path)))?;
        Ok(Sealed::new(KIND, &self.program, &run).save(path, commit)?)
    }

    /// Text of the file with the paths as they are, for a program that stores it elsewhere than in a file.
    ///
    /// # Errors
    /// The network has values that could not be read back.
    pub fn to_text(&self) -> Result<String, DocumentError> {
        let place = Path::new(Self::TEXT);
        let run = self.run_record(place, Recorded::clone)?;
        serde_json::to_string(&Sealed::new(KIND, &self.program, &run)).map_err(|error| DocumentError::Unsound {
            path: place.to_owned(),
            defect: error.to_string(),
        })
    }

    /// Reads the text of [`Self::to_text`].
    ///
    /// # Errors
    /// The text is damaged.
    pub fn from_text(text: &str) -> Result<Self, DocumentError> {
        let read = Self::parse(text.as_bytes(), Path::new(""));
        let checked = read.and_then(|file| defect(&file).map_or(Ok(file), Err));
        checked.map_err(|defect| KIND.damaged(Path::new(Self::TEXT), defect))
    }

    /// Name of a network file that is only text, in messages.
    const TEXT: &str = "network in memory";

    /// Returns the part of the file that the checksum covers, with the paths of `located`.
    fn run_record(
        &self,
        path: &Path,
        located: impl FnOnce(&Recorded) -> Recorded,
    ) -> Result<Box<RawValue>, DocumentError> {
        let unsound = |defect: String| DocumentError::Unsound {
            path: path.to_owned(),
            defect,
        };
        if let Some(defect) = defect(self) {
            return Err(unsound(defect));
        }
        let Self {
            program: _,
            settings,
            recorded,
            problem,
            row_wires,
            network,
            training,
            scores,
            intervals,
            drift,
        } = self.clone();
        let document = Document {
            settings,
            recorded: recorded.as_ref().map(located),
            problem: problem.into(),
            row_wires,
            network,
            training,
            scores,
            intervals,
            drift: SavedDrift::of(drift),
        };
        to_raw_value(&document).map_err(|error| unsound(error.to_string()))
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or version, or is damaged.
    pub fn load(path: &Path) -> Result<Self, DocumentError> {
        let bytes = KIND.read(path)?;
        let read = Self::parse(&bytes, folder_of(path));
        let checked = read.and_then(|file| defect(&file).map_or(Ok(file), Err));
        checked.map_err(|defect| KIND.damaged(path, defect))
    }

    /// Describes the first defect that would keep the file from being read back.
    pub fn defect(&self) -> Option<String> {
        defect(self)
    }

    fn parse(bytes: &[u8], folder: &Path) -> Result<Self, String> {
        let Sealed { program, run, .. } = Sealed::read(bytes)?;
        let document: Document = serde_json::from_str(run.get()).map_err(|error| error.to_string())?;
        Ok(Self {
            program,
            settings: document.settings,
            recorded: document.recorded.map(|recorded| recorded.within(folder)),
            problem: (document.problem.with_sensor(document.settings.simulation())).ok_or(NODES_OF_RECORDING)?,
            row_wires: document.row_wires,
            network: document.network,
            training: document.training,
            scores: document.scores,
            intervals: document.intervals,
            drift: SavedDrift::read(document.drift),
        })
    }
}

/// Layout of a file with a checksum: a heading and the record of a run. The checksum detects any change to the record.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Sealed<'a> {
    format: String,
    pub(super) version: u64,
    pub(super) program: String,
    /// CRC-32 of the text of `run`, as hexadecimal digits.
    crc32: String,
    #[serde(borrow)]
    pub(super) run: &'a RawValue,
}

impl<'a> Sealed<'a> {
    pub(super) fn new(kind: DocumentKind, program: &str, run: &'a RawValue) -> Self {
        Self {
            format: kind.format().to_owned(),
            version: kind.version(),
            program: program.to_owned(),
            crc32: checksum(run),
            run,
        }
    }

    /// Reads a file and checks its checksum.
    ///
    /// # Errors
    /// A description of the damage.
    pub(super) fn read(bytes: &'a [u8]) -> Result<Self, String> {
        let sealed: Self = serde_json::from_slice(bytes).map_err(|error| error.to_string())?;
        if sealed.crc32 == checksum(sealed.run) {
            Ok(sealed)
        } else {
            Err("its checksum shows that something in it has changed".to_owned())
        }
    }

    /// Writes the file at `path`, whole or not at all; `commit` puts it in its place.
    ///
    /// # Errors
    /// The path cannot be written, or the file would be too large to be read again.
    pub(super) fn save(&self, path: &Path, commit: Commit) -> Result<(), WriteError> {
        /// Upper bound on the length of the heading.
        const HEADING: u64 = 1 << 10;
        let error = |source| WriteError::io(path, source);
        if self.run.get().len() as u64 + HEADING > LARGEST_BYTES {
            return Err(error(too_large()));
        }
        let mut file = AtomicFile::create(path)?;
        serde_json::to_writer(&mut file, self).map_err(|source| error(source.into()))?;
        writeln!(file).map_err(error)?;
        commit(file)
    }
}

/// Puts a written file in its place: [`AtomicFile::commit`] or [`AtomicFile::commit_new`].
pub(super) type Commit = fn(AtomicFile) -> Result<(), WriteError>;

fn checksum(run: &RawValue) -> String {
    format!("{:08x}", crc32fast::hash(run.get().as_bytes()))
}

/// Describes the first defect of a network file and its field. Checked before writing and after reading, so
/// that every file that is written can be read.
pub(super) fn defect(file: &NetworkFile) -> Option<String> {
    let NetworkFile {
        program: _,
        settings,
        recorded,
        problem,
        row_wires,
        network,
        training,
        scores:
            Scores {
                network: errors,
                network_alone: alone,
                baselines,
                coverage: _,
            },
        intervals,
        drift,
    } = file;
    let weight = |network: &DecouplingNetwork| {
        let weights = network.mlp().weights();
        weights.iter().position(|weight| !weight.is_finite())
    };
    let last_epoch = training.history.last().map(|record| record.epoch);
    let simulation = settings.simulation();
    let defects = [
        (network.values().iter().find_map(weight))
            .map(|index| format!("network: weight {index} is not a finite number")),
        number_defect(network, settings, row_wires.as_deref()),
        (network.values().iter()).find_map(|network| mismatch(network, problem, settings.network_hidden())),
        simulation.and_then(|simulation| place_defect(network, simulation)),
        last_epoch.is_none().then(|| "training.history: it is empty".to_owned()),
        last_epoch
            .filter(|&last| training.best_epoch > last)
            .map(|last| format!("training.best_epoch: {} is after the last, {last}", training.best_epoch)),
        (!(training.seconds >= 0.0 && training.seconds.is_finite()))
            .then(|| format!("training.seconds: {} is not a time", training.seconds)),
        starts_defect(file),
        (intervals.as_ref())
            .and_then(|intervals| intervals.check(problem.targets.len()).err())
            .map(|defect| format!("intervals: {defect}")),
        (drift.as_ref().ok())
            .filter(|drift| !drift.is_valid() || drift.channels() != problem.inputs.len())
            .map(|_| "drift: it does not match the inputs".to_owned()),
        file.combined()
            .and_then(|combined| combined.defect(problem.feature_count(), problem.targets.len()))
            .map(|defect| format!("recorded.combined: {defect}")),
        unmeasured("scores.network", errors, problem),
        alone
            .as_ref()
            .and_then(|errors| unmeasured("scores.network_alone", errors, problem)),
        unmeasured("scores.baselines.mean", &baselines.mean, problem),
        unmeasured("scores.baselines.linear", &baselines.linear, problem),
        (baselines.model_based.as_ref()).and_then(|errors| unmeasured("scores.baselines.model_based", errors, problem)),
    ];
    let is_placed = |position: &TargetPosition| position.target < problem.targets.len();
    let problem_defect = match simulation {
        Some(simulation) if *problem != simulation.problem() => Some("problem: it does not match the array"),
        None if problem.has_nodes() => Some(NODES_OF_RECORDING),
        None if problem
            .memory
            .as_ref()
            .is_some_and(|memory| memory.check(problem.inputs.len()).is_err()) =>
        {
            Some("problem.memory: it is not possible for these inputs")
        }
        None if !problem.positions.iter().all(is_placed) => Some("problem.positions: a target does not exist"),
        _ => None,
    };
    settings_defect(settings, recorded.as_ref())
        .or(problem_defect.map(str::to_owned))
        .or_else(|| defects.into_iter().flatten().next())
}

/// Describes the first invalid value of the settings in a file, and its field.
pub(super) fn settings_defect(settings: &RunSettings, recorded: Option<&Recorded>) -> Option<String> {
    let at = |field: &str, defect: &dyn Display| format!("{field}: {defect}");
    let training = settings
        .training
        .check()
        .map_err(|defect| at("settings.training", &defect));
    let counts = settings.check_counts().map_err(|defect| at("settings", &defect));
    let source = settings
        .simulation()
        .map_or(Ok(()), |Simulation { sensor, scene, .. }| {
            (sensor.check()).map_err(|defect| at("settings.source.sensor", &defect))?;
            (scene.check()).map_err(|defect| at("settings.source.scene", &defect))
        });
    let recorded = match (settings.simulation(), recorded) {
        (Some(_), Some(_)) => Err("recorded: the source is a simulated array".to_owned()),
        (None, None) => Err("recorded: it is missing".to_owned()),
        _ => Ok(()),
    };
    [counts, source, training, recorded].into_iter().find_map(Result::err)
}

fn starts_defect(file: &NetworkFile) -> Option<String> {
    let starts = &file.training.starts;
    if !starts.is_empty() && starts.len() != file.settings.starts {
        let (found, expected) = (starts.len(), file.settings.starts);
        return Some(format!(
            "training.starts: {found} of them, but the settings ask for {expected}"
        ));
    }
    let infinite = |start: &StartRecord| {
        let figures = [Some(start.train_mse), start.validation_mse, start.percent()];
        figures.into_iter().flatten().any(|figure| !figure.is_finite())
    };
    let place = starts.iter().position(infinite)?;
    Some(format!(
        "training.starts: an error of number {place} is not a finite number"
    ))
}

fn number_defect(network: &Networks, settings: &RunSettings, row_wires: Option<&[usize]>) -> Option<String> {
    let found = network.values().len();
    match settings.simulation() {
        Some(source) => match source.rows().map(|rows| source.scene.rows.model().decoders(rows)) {
            Ok(needed) if needed == found => None,
            Ok(needed) => Some(format!(
                "network: {found} of them, but rows {} of {} need {needed}",
                source.scene.rows, source.sensor.scale
            )),
            Err(defect) => Some(format!("settings.source.scene.rows: {defect}")),
        },
        None => {
            let rows = row_wires.map_or(1, <[usize]>::len);
            (found != 1 && found != rows).then(|| format!("network: {found} of them for {rows} row-wires"))
        }
    }
}

fn mismatch(network: &DecouplingNetwork, problem: &Problem, hidden: usize) -> Option<String> {
    let sizes = [
        (
            "reads",
            network.inputs().channels(),
            problem.feature_count(),
            "readings",
        ),
        ("gives", network.outputs().channels(), problem.targets.len(), "targets"),
        ("has", network.mlp().shape().hidden, hidden, "hidden nodes"),
    ];
    let (verb, found, expected, what) = sizes.into_iter().find(|(_, found, expected, _)| found != expected)?;
    Some(format!(
        "network: it {verb} {found} {what}, but the settings need {expected}"
    ))
}

/// Describes the first coordinate whose training range is out of reach of the nodes of the scene, even with a margin of
/// one stroke. Networks whose sizes or number do not match the settings are not checked.
fn place_defect(networks: &Networks, simulation: &Simulation) -> Option<String> {
    let Simulation { sensor, scene, .. } = simulation;
    let rows = scene.rows.read(sensor.scale.rows()).ok()?;
    let spare_mm = simulation.stroke_mm() + scene.movement.largest_shift_mm();
    for (index, network) in networks.values().iter().enumerate() {
        let outputs = network.outputs();
        let rows = match networks.only() {
            Some(_) => &rows[..],
            None => rows.get(index..=index)?,
        };
        if outputs.channels() != sensor.scale.coordinates_per_row() {
            return None;
        }
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
            if !(possible.contains(&min) && possible.contains(&max)) {
                return Some(format!(
                    "network: node {} was trained from {min:e} to {max:e} mm, but lies from {low} to {high} mm",
                    node + 1
                ));
            }
        }
    }
    None
}

fn unmeasured(place: &str, errors: &TestErrors, problem: &Problem) -> Option<String> {
    match errors {
        TestErrors::Nodes(_) if !problem.has_nodes() => return Some(format!("{place}: the targets are not nodes")),
        TestErrors::Targets(_) if problem.has_nodes() => return Some(format!("{place}: the targets are nodes")),
        TestErrors::Targets(targets) if targets.len() != problem.targets.len() => {
            let (found, expected) = (targets.len(), problem.targets.len());
            return Some(format!("{place}: {found} of them for {expected} targets"));
        }
        _ => {}
    }
    let name = errors.infinite_figure()?;
    Some(format!("{place}.{name}: it is not a finite number"))
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
            let found = SavedDrift::read(Some(serde_json::from_str(saved).unwrap()));
            assert_eq!(found, Err(expected));
        }
    }
}
