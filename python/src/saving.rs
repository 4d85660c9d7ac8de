//! Network files of networks trained in Python. A network file names the recording, so the samples are written next to it.

use std::{
    fmt::Display,
    io::{self, Write},
    path::{Path, PathBuf},
};

use decoupler_core::{
    dataset::{Dataset, Division, Split, SplitBy},
    decoupling::{Combined, ProgramDecoder},
    evaluation::{Intervals, Run, RunSettings, TestErrors},
    job::Job,
    network::Networks,
    problem::{Channel, Problem},
    training::{EpochRecord, Stage, StopReason},
};
use decoupler_files::{
    export::{AtomicFile, NetworkFile, TrainingRecord, WriteError},
    import::{Decimal, DialectChoice, FileSet, Plan, Recipe, Separator, Setup},
};
use serde::{Deserialize, Serialize};

/// What a network file contains besides the networks, so that a fitted network can be saved later.
#[derive(Clone, Serialize, Deserialize)]
pub struct Origin {
    stop_reason: Option<StopReason>,
    best_epoch: usize,
    seconds: f64,
    history: Vec<EpochRecord>,
    stages: Vec<Stage>,
    /// Division of the samples; `None` if the validation samples were given apart.
    pub division: Option<Division>,
    /// CRC-32 of the training samples.
    crc32: u32,
}

impl Origin {
    /// Describes a finished run whose training samples have this checksum.
    pub fn of(run: &Run, division: Option<Division>, crc32: u32) -> Self {
        let leader = run.leader();
        Self {
            stop_reason: run.stop_reason(),
            best_epoch: leader.best_epoch(),
            seconds: run.training_time().as_secs_f64(),
            history: leader.history().to_vec(),
            stages: leader.stages().to_vec(),
            division,
            crc32,
        }
    }

    fn training(&self) -> TrainingRecord {
        TrainingRecord {
            stop_reason: self.stop_reason,
            best_epoch: self.best_epoch,
            epochs: self.history.last().map_or(0, |record| record.epoch),
            seconds: self.seconds,
            history: self.history.clone(),
            stages: self.stages.clone(),
            starts: Vec::new(),
        }
    }
}

/// Returns the CRC-32 of readings and targets.
pub fn samples_crc32(set: &Dataset) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    let mut bytes = Vec::new();
    for sample in 0..set.samples() {
        bytes.clear();
        let values = set.sample_readings(sample).iter().chain(set.sample_targets(sample));
        values.for_each(|value| bytes.extend(value.to_le_bytes()));
        hasher.update(&bytes);
    }
    hasher.finalize()
}

/// A trained network to be saved.
pub struct Saved<'a> {
    pub networks: &'a Networks,
    pub combined: Option<&'a Combined>,
    pub settings: RunSettings,
    pub problem: &'a Problem,
    pub origin: &'a Origin,
    pub division: Division,
    pub intervals: Option<&'a Intervals>,
}

impl Saved<'_> {
    /// Writes the network file at `path` with its errors on `test`, and both sets of samples next to it as CSV.
    /// `training` are all samples of the fit, and `split` their division.
    ///
    /// # Errors
    /// A message if the samples are not those of the fit, or a file cannot be written or read back.
    pub fn save(&self, path: &Path, training: &Dataset, split: &Split, test: &Dataset) -> Result<(), String> {
        if samples_crc32(&split.training) != self.origin.crc32 {
            return Err("the samples are not those of fit: give X and y (and groups) as in fit".to_owned());
        }
        let columns = Columns::of(self.problem, training);
        let path_of = |part: &str| {
            let mut name = path.file_stem().unwrap_or_default().to_owned();
            name.push(format!(".{part}.csv"));
            path.with_file_name(name)
        };
        let (data, tested) = (path_of("training"), path_of("test"));
        columns.write(&data, training).map_err(text)?;
        columns.write(&tested, test).map_err(text)?;
        let mut plan = columns.plan(data, tested, self.division);
        plan.import.memory.clone_from(&self.problem.memory);
        let setup = Setup::recording(self.settings, plan);
        let sets = setup
            .sets(Path::new(""), &Job::UNINTERRUPTED, &mut |_| ())
            .map_err(text)?;
        if self.problem.memory.is_none() && samples_crc32(&sets.sets.split.training) != self.origin.crc32 {
            return Err("the files with the samples do not read back as the samples of fit".to_owned());
        }
        // Measures the baselines.
        let run = sets.run(&setup, None, &Job::UNINTERRUPTED).map_err(text)?;
        let mut file = NetworkFile::from_run(&run, sets.recorded()).map_err(text)?;
        file.drift = sets.drift_reference();
        file.network = self.networks.clone();
        if let Some(recorded) = &mut file.recorded {
            recorded.combined = self.combined.cloned();
        }
        let answers = file.decoder().answers_to(&sets.sets.test);
        file.scores.network = TestErrors::of_targets(&sets.sets.test, answers.view());
        let alone = self.combined.filter(|combined| !combined.others.is_empty());
        file.scores.network_alone = alone.map(|_| {
            let answers =
                ProgramDecoder::new(file.network.decoder_program(&file.problem, None)).answers_to(&sets.sets.test);
            TestErrors::of_targets(&sets.sets.test, answers.view())
        });
        if let Some(intervals) = self.intervals {
            file.scores.coverage = intervals.coverage(&sets.sets.test, answers.view());
            file.intervals = Some(intervals.clone());
        }
        file.training = self.origin.training();
        file.save(path).map_err(text)
    }
}

fn text(error: impl Display) -> String {
    error.to_string()
}

/// Names of the columns of the files with the samples.
struct Columns {
    inputs: Vec<String>,
    targets: Vec<String>,
    has_row_wires: bool,
    has_groups: bool,
}

const ROW_WIRE: &str = "row_wire";
const GROUP: &str = "group";

impl Columns {
    /// Uses the names of the channels if they are plain and all different, else numbers.
    fn of(problem: &Problem, set: &Dataset) -> Self {
        let names = |channels: &[Channel]| Vec::from_iter(channels.iter().map(|channel| channel.name.clone()));
        let is_plain = |name: &String| {
            name.chars()
                .all(|letter| letter.is_ascii_alphanumeric() || letter == '_')
                && name.starts_with(|first: char| first.is_ascii_alphabetic())
        };
        let (inputs, targets) = (names(&problem.inputs), names(&problem.targets));
        let mut all = Vec::from_iter(inputs.iter().chain(&targets).cloned());
        let count = all.len() + 2;
        all.extend([ROW_WIRE.to_owned(), GROUP.to_owned()]);
        let is_usable = all.iter().all(is_plain);
        all.sort();
        all.dedup();
        let unnamed = Problem::unnamed(inputs.len(), targets.len());
        let (inputs, targets) = if is_usable && all.len() == count {
            (inputs, targets)
        } else {
            (names(&unnamed.inputs), names(&unnamed.targets))
        };
        Self {
            inputs,
            targets,
            has_row_wires: set.row_wires_read().is_some(),
            has_groups: set.groups().iter().enumerate().any(|(sample, &group)| sample != group),
        }
    }

    fn write(&self, path: &Path, set: &Dataset) -> Result<(), WriteError> {
        let error = |source| WriteError::io(path, source);
        let mut file = AtomicFile::create(path)?;
        self.write_to(&mut file, set).map_err(error)?;
        file.commit()
    }

    fn write_to(&self, writer: &mut dyn Write, set: &Dataset) -> io::Result<()> {
        let mut header = self.inputs.clone();
        header.extend_from_slice(&self.targets);
        header.extend(self.has_row_wires.then(|| ROW_WIRE.to_owned()));
        header.extend(self.has_groups.then(|| GROUP.to_owned()));
        writeln!(writer, "{}", header.join(","))?;
        for sample in 0..set.samples() {
            let values = set.sample_readings(sample).iter().chain(set.sample_targets(sample));
            let mut line = Vec::from_iter(values.map(|value| format!("{value:?}")));
            if self.has_row_wires {
                // In files they are counted from 1.
                line.push((set.row_wire(sample).unwrap_or(0) + 1).to_string());
            }
            if self.has_groups {
                line.push(set.groups()[sample].to_string());
            }
            writeln!(writer, "{}", line.join(","))?;
        }
        Ok(())
    }

    fn plan(self, data: PathBuf, test: PathBuf, division: Division) -> Plan {
        Plan {
            import: Recipe {
                data,
                dialect: DialectChoice {
                    separator: Some(Separator::Comma),
                    decimal: Some(Decimal::Point),
                    header: Some(true),
                    ..DialectChoice::default()
                },
                inputs: self.inputs,
                targets: self.targets,
                row_wire: self.has_row_wires.then(|| ROW_WIRE.to_owned()),
                group: self.has_groups.then(|| GROUP.to_owned()),
                ..Recipe::default()
            },
            test: Some(FileSet {
                data: test,
                ..FileSet::default()
            }),
            division,
        }
    }
}

/// Division of samples of which a share is held out for validation.
pub fn division(by: SplitBy, validation_fraction: f64) -> Division {
    Division {
        by,
        validation_fraction: Some(validation_fraction),
        ..Division::default()
    }
}
