use std::{
    collections::BTreeMap,
    io::{self, Write},
    time::Duration,
};

use serde::Serialize;

use super::{
    errors_report::{ErrorsReport, Target, targets, write_starts},
    failure::Failure,
    inspect::{RecordingReport, import_warnings, write_warnings},
    output::{print, print_object},
};
use decoupler_core::{
    dataset::Simulation,
    evaluation::{
        Combination, DecoderReport, ErrorTable, Errors, Outlook, Run, RunError, StartRecord, TestErrors,
        auto::AutoRecord,
        best_start, error_remarks,
        recorded::{Determination, HysteresisLoop, Undetermined, extrapolation},
    },
    network::InputChoice,
    problem::{Channel, Problem},
    scene::{Noise, NoisySets, Scene},
    sensor::{ArrayScale, Geometry},
    text::counted,
    training::{Stage, StopReason},
};
use decoupler_files::{
    export::{
        NetworkFile, TrainingRecord, decoder_table, describe_coverage, describe_determinacy, describe_half_widths,
        describe_samples, describe_search, describe_worse_than_ridge, error_table, format_duration, search_table,
    },
    import::{Recording, SetupSets},
};

/// A trained network and its measured errors.
pub(super) struct Trained<'a> {
    pub(super) run: &'a Run,
    pub(super) file: &'a NetworkFile,
    pub(super) sets: &'a SetupSets,
    pub(super) decoders: &'a [DecoderReport],
    /// Warnings about how optimistic random test samples are.
    pub(super) optimism: &'a [String],
}

/// The object printed by `train --json`.
#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    source: SourceReport<'a>,
    hidden: usize,
    method: &'static str,
    seed: u64,
    starts: &'a [StartRecord],
    combine: Combination,
    epochs: usize,
    best_epoch: usize,
    stop_reason: Option<StopReason>,
    networks: usize,
    weights: usize,
    warnings: Vec<String>,
    /// What was tried to choose the settings, if they were chosen.
    #[serde(skip_serializing_if = "Option::is_none")]
    search: Option<&'a AutoRecord>,
    /// Other decoders; absent for a recording if none was requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    decoders: Option<BTreeMap<String, Decoder<'a>>>,
}

/// Figures that depend on the kind of source.
#[derive(Serialize)]
#[serde(untagged)]
enum SourceReport<'a> {
    Array(Box<ArrayReport<'a>>),
    Recording(Box<RecordingFigures<'a>>),
}

#[derive(Serialize)]
struct ArrayBaselines {
    mean: Errors,
    linear: Errors,
    model_based: Option<Errors>,
}

#[derive(Serialize)]
struct ArrayReport<'a> {
    array: ArrayScale,
    samples: usize,
    validation_samples: usize,
    test_samples: usize,
    stages: &'a [Stage],
    train_mse: f64,
    validation_mse: Option<f64>,
    epoch_ms: f64,
    errors: Errors,
    baselines: ArrayBaselines,
    published: Option<Published>,
    scene: Scene,
    inputs: InputChoice,
    unknowns: usize,
    equations: usize,
    condition: Option<f64>,
    /// Remarks on the errors above, with cause and remedy.
    remarks: Vec<String>,
    model_based: Option<ModelBased>,
}

#[derive(Serialize)]
struct RecordingFigures<'a> {
    #[serde(flatten)]
    recording: RecordingReport,
    seconds: Option<f64>,
    /// Share of the test samples outside the range of the training samples.
    test_outside_training: f64,
    targets: Vec<Target<'a>>,
    baselines: BTreeMap<&'static str, Vec<Target<'a>>>,
    /// Errors of loading and unloading for each target; none if it does not rise and fall, or the order in time is lost.
    hysteresis: Vec<Option<HysteresisLoop>>,
}

#[derive(Serialize)]
struct Decoder<'a> {
    #[serde(flatten)]
    errors: ErrorsReport<'a>,
    frame_us: f64,
    /// Root mean square of m/R − 1; none if the decoded deformation has no valid resistance.
    residual: Option<f64>,
    fit_seconds: f64,
    /// Remarks on the errors, with cause and remedy.
    remarks: Vec<String>,
    /// None for decoders that do not solve the equations of the sensor.
    solved: Option<Solved>,
}

#[derive(Serialize)]
struct Solved {
    rows: usize,
    unsolved: usize,
    undetermined: usize,
}

#[derive(Serialize)]
struct ModelBased {
    z_percent: Option<f64>,
    z_mm: f64,
}

#[derive(Serialize)]
struct Published {
    z_percent: f64,
    x_percent: f64,
    y_percent: f64,
}

impl<'a> Decoder<'a> {
    fn new(channels: &'a [Channel], report: &DecoderReport) -> Self {
        Self {
            errors: ErrorsReport::new(channels, &report.errors),
            frame_us: report.frame_us,
            residual: report.residual.filter(|residual| residual.is_finite()),
            fit_seconds: report.fit_seconds,
            remarks: report.remarks.iter().map(ToString::to_string).collect(),
            solved: (report.solved.rows > 0).then_some(Solved {
                rows: report.solved.rows,
                unsolved: report.solved.unsolved,
                undetermined: report.solved.undetermined,
            }),
        }
    }
}

impl<'a> ArrayReport<'a> {
    fn new(file: &'a NetworkFile, source: &Simulation, remarks: Vec<String>) -> Result<Self, RunError> {
        let (settings, training) = (&file.settings, &file.training);
        let best = training.history.get(training.best_epoch);
        let (rows, scale) = (source.rows()?, source.sensor.scale);
        let best_start = best_start(&training.starts).and_then(|number| training.starts.get(number));
        let nodes = |errors: &TestErrors| *errors.nodes().expect("the targets are nodes");
        let baselines = &file.scores.baselines;
        let model_based = baselines.model_based.as_ref().map(nodes);
        Ok(Self {
            array: source.sensor.scale,
            samples: source.samples,
            validation_samples: source.validation_samples,
            test_samples: source.test_samples,
            stages: &training.stages,
            train_mse: best_start.map_or_else(
                || best.map_or(f64::NAN, |record| record.training_mse),
                |start| start.train_mse,
            ),
            validation_mse: best_start.map_or_else(
                || best.and_then(|record| record.validation_mse),
                |start| start.validation_mse,
            ),
            epoch_ms: 1e3 * epoch_seconds(training),
            errors: nodes(&file.scores.network),
            baselines: ArrayBaselines {
                mean: nodes(&baselines.mean),
                linear: nodes(&baselines.linear),
                model_based,
            },
            published: settings.published().map(|row| Published {
                z_percent: row.z_percent,
                x_percent: row.x_percent,
                y_percent: row.y_percent,
            }),
            scene: source.scene,
            inputs: settings.inputs,
            unknowns: rows * source.scene.unknowns_per_row(scale),
            equations: rows * scale.columns(),
            condition: condition(Outlook::of(source).ok().as_ref()),
            remarks,
            model_based: model_based.map(|errors| ModelBased {
                z_percent: errors.z_percent,
                z_mm: errors.z_mm,
            }),
        })
    }
}

impl<'a> Trained<'a> {
    /// Prints the report, as JSON or as text.
    pub(super) fn print(&self, is_json: bool) -> Result<(), Failure> {
        if is_json {
            print_object(&self.report()?)
        } else {
            print(|out| self.write(out))
        }
    }

    /// Returns the object printed by `train --json`.
    pub(super) fn report(&self) -> Result<impl Serialize + use<'a>, Failure> {
        let Self { file, .. } = *self;
        let (settings, training, scores) = (&file.settings, &file.training, &file.scores);
        let determined = self.determined();
        let source = match (&self.sets.recordings, settings.simulation()) {
            (Some(recordings), _) => SourceReport::Recording(Box::new(RecordingFigures {
                recording: RecordingReport::new(&self.sets.sets, recordings),
                test_outside_training: self.extrapolation().map_or(0.0, |(share, _)| share),
                seconds: self.run.wall_time().map(|time| time.as_secs_f64()),
                targets: targets(&file.problem.targets, &scores.network, &determined, &scores.coverage),
                baselines: BTreeMap::from([
                    ("mean", targets(&file.problem.targets, &scores.baselines.mean, &[], &[])),
                    (
                        "ridge",
                        targets(&file.problem.targets, &scores.baselines.linear, &[], &[]),
                    ),
                ]),
                hysteresis: self.loops(),
            })),
            (None, Some(simulation)) => {
                SourceReport::Array(Box::new(ArrayReport::new(file, simulation, self.remarks())?))
            }
            (None, None) => unreachable!("sets are recorded or simulated"),
        };
        let decoder = |report: &DecoderReport| (report.name(), Decoder::new(&file.problem.targets, report));
        let has_decoders = file.problem.has_nodes() || !self.decoders.is_empty();
        Ok(Report {
            source,
            hidden: settings.hidden,
            method: settings.training.method.short_name(),
            seed: settings.seed.0,
            starts: &training.starts,
            combine: settings.combine,
            epochs: epochs(training),
            best_epoch: training.best_epoch,
            stop_reason: training.stop_reason,
            networks: file.network.values().len(),
            weights: file.network.weights(),
            warnings: self.warnings(&determined),
            search: search(file),
            decoders: has_decoders.then(|| self.decoders.iter().map(decoder).collect()),
        })
    }

    /// Coefficient of determination of each target of a recording.
    fn determined(&self) -> Vec<Result<Determination, Undetermined>> {
        let Some(recordings) = &self.sets.recordings else {
            return Vec::new();
        };
        let by = recordings.recorded.plan.division.by;
        Determination::measure(self.run.test(), self.run.decouple_test().view(), by)
    }

    /// Errors of loading and unloading for each target of a recording.
    fn loops(&self) -> Vec<Option<HysteresisLoop>> {
        let Some(recordings) = &self.sets.recordings else {
            return Vec::new();
        };
        let by = recordings.recorded.plan.test_order();
        HysteresisLoop::of_test(self.run.test(), self.run.decouple_test().view(), by)
    }

    /// Share of the test samples of a recording outside the range of its training samples, with a warning.
    fn extrapolation(&self) -> Option<(f64, Option<String>)> {
        let Recording { inputs, targets, .. } = &self.sets.recordings.as_ref()?.training;
        let training = &self.sets.sets.split.training;
        Some(extrapolation(training, self.run.test(), inputs, targets))
    }

    /// Warnings of the source and of the training.
    fn warnings(&self, determined: &[Result<Determination, Undetermined>]) -> Vec<String> {
        let NetworkFile { problem, scores, .. } = self.file;
        let outlook = problem.sensor.as_ref().and_then(|sensor| Outlook::of(sensor).ok());
        let of_array = outlook.iter().flat_map(|outlook| &outlook.warnings);
        let of_import = self.sets.recordings.as_ref().map(import_warnings);
        of_array
            .map(ToString::to_string)
            .chain(of_import.into_iter().flatten())
            .chain(self.extrapolation().and_then(|(_, warning)| warning))
            .chain(describe_samples(self.sets))
            .chain(
                search(self.file)
                    .into_iter()
                    .flat_map(|record| record.remarks(&problem.targets)),
            )
            .chain(self.optimism.iter().cloned())
            .chain(self.run.defect())
            .chain(describe_determinacy(
                &self.file.problem.targets,
                determined,
                scores.network_alone.is_some(),
            ))
            .chain(describe_worse_than_ridge(problem, scores))
            .chain(describe_coverage(&problem.targets, &scores.coverage))
            .collect()
    }

    /// Remarks on the rows of the error table.
    fn remarks(&self) -> Vec<String> {
        let (file, baselines) = (self.file, &self.file.scores.baselines);
        let remarks = error_remarks(&file.settings, &file.scores, file.training.stop_reason);
        let remarks = remarks.iter().map(|(row, remark)| format!("{row}: {remark}"));
        remarks.chain(baselines.model_based_note().map(str::to_owned)).collect()
    }

    fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let Self { file, .. } = *self;
        let (settings, training) = (&file.settings, &file.training);
        match (&self.sets.recordings, settings.simulation()) {
            (Some(recordings), _) => RecordingReport::new(&self.sets.sets, recordings).write(out)?,
            (None, Some(simulation)) => write_array(file, simulation, out)?,
            (None, None) => unreachable!("sets are recorded or simulated"),
        }
        if let Some(record) = search(file) {
            writeln!(out, "\n{}\n{}", describe_search(record), search_table(record).aligned())?;
        }
        let first = training.stages.first();
        let method = first.map_or(settings.training.method, |stage| stage.method);
        writeln!(
            out,
            "{}, {}, {method}, {}, seed {}",
            inputs(&file.problem),
            counted(settings.hidden, "hidden node"),
            counted(settings.starts, "start"),
            settings.seed
        )?;
        for stage in training.stages.iter().skip(1) {
            writeln!(out, "From epoch {} {}", stage.first_epoch, stage.method)?;
        }
        let reason = training
            .stop_reason
            .map_or("not ended".to_owned(), |reason| reason.to_string());
        let time = |seconds| format_duration(Duration::try_from_secs_f64(seconds).unwrap_or_default());
        writeln!(
            out,
            "Ended after {}, {} on one thread ({} per epoch): {reason}",
            counted(epochs(training), "epoch"),
            time(training.seconds),
            time(epoch_seconds(training))
        )?;
        writeln!(out, "Weights kept from epoch {}\n", training.best_epoch)?;
        if training.starts.len() > 1 {
            write_starts(
                &training.starts,
                settings.combine,
                file.problem.test_percent_name(),
                out,
            )?;
            writeln!(out)?;
        }
        let loops = self.loops();
        let mut tables = file.error_table();
        ErrorTable::add_loops(&mut tables, &loops);
        write!(out, "{}", error_table(&tables).aligned())?;
        for (target, found) in file.problem.targets.iter().zip(&loops) {
            if let Some(found) = found {
                writeln!(out, "{}", found.sentence(&target.name))?;
            }
        }
        let half_widths =
            (file.intervals.as_ref()).and_then(|intervals| describe_half_widths(&file.problem.targets, intervals));
        if let Some(sentence) = half_widths {
            writeln!(out, "{sentence}")?;
        }
        write_warnings(&self.warnings(&self.determined()), out)?;
        write_warnings(&self.remarks(), out)?;
        self.write_decoders(out)?;
        if let Some(simulation) = &file.problem.sensor {
            writeln!(
                out,
                "\nErrors in % are relative to the coordinate, as in the paper, or to the stroke where stated."
            )?;
            let note = simulation.sensor.scale.note();
            for note in note.iter().map(String::as_str).chain([Geometry::ASSUMPTION]) {
                writeln!(out, "{note}")?;
            }
        }
        Ok(())
    }

    /// Writes the errors of each decoder and their ratio to the model-based one.
    fn write_decoders(&self, out: &mut dyn Write) -> io::Result<()> {
        let model_based = self.file.scores.baselines.model_based.as_ref();
        if model_based.and_then(TestErrors::nodes).is_some_and(Errors::is_rounding) {
            writeln!(
                out,
                "The model-based error is nothing but rounding: the readings determine the deformation, and no ratio to \
                 it is given."
            )?;
        }
        if self.decoders.is_empty() {
            return Ok(());
        }
        write!(
            out,
            "\n{}",
            decoder_table(&self.file.problem, self.decoders, model_based).aligned()
        )?;
        for report in self.decoders {
            let name = report.kind.name(report.precision);
            for remark in &report.remarks {
                writeln!(out, "Warning: {name}: {remark}")?;
            }
        }
        if self.file.problem.has_nodes() {
            writeln!(
                out,
                "The residual is the rms relative difference between the readings and those of the decoded deformation; it \
                 needs no ground truth."
            )?;
        }
        Ok(())
    }
}

/// Record of the choice of settings, if they were chosen.
fn search(file: &NetworkFile) -> Option<&AutoRecord> {
    file.recorded.as_ref()?.search.as_ref()
}

fn epochs(training: &TrainingRecord) -> usize {
    training.history.last().map_or(0, |record| record.epoch)
}

/// Mean time of an epoch.
fn epoch_seconds(training: &TrainingRecord) -> f64 {
    training.seconds / epochs(training).max(1) as f64
}

/// Condition number of the worst row; none if the Jacobian is singular.
/// Number of inputs of the network, with the memory if there is one.
fn inputs(problem: &Problem) -> String {
    let count = counted(problem.feature_count(), "input");
    match &problem.memory {
        Some(memory) => format!(
            "{count} ({} and their memory: {memory})",
            counted(problem.inputs.len(), "reading")
        ),
        None => count,
    }
}

fn condition(outlook: Option<&Outlook>) -> Option<f64> {
    let condition = outlook?.worst_row.condition();
    Some(condition).filter(|condition| condition.is_finite())
}

/// Writes the scene of an array, the size of its equations and of the network, and the numbers of samples.
fn write_array(file: &NetworkFile, source: &Simulation, out: &mut dyn Write) -> io::Result<()> {
    let (scene, inputs) = (&source.scene, &file.settings.inputs);
    let Noise {
        relative,
        additive_ohm,
        converter_bits,
        drift,
        sets,
    } = scene.noise;
    write!(
        out,
        "{}: rows {}, axes {}, loading {}, inputs {} ({})",
        source.sensor.scale, scene.rows, scene.movement, scene.loading, inputs.quantity, inputs.scaling
    )?;
    let noises = [
        (relative > 0.0).then(|| format!("noise {relative:e}")),
        (additive_ohm > 0.0).then(|| format!("noise {additive_ohm:e} ohm")),
        converter_bits.map(|bits| format!("{bits} bits")),
        (drift > 0.0).then(|| format!("drift {drift:e}")),
        (!scene.noise.is_none() && sets == NoisySets::Training).then(|| "in training only".to_owned()),
        (!scene.noise.is_none() && sets == NoisySets::Test).then(|| "in test only".to_owned()),
    ];
    for noise in noises.into_iter().flatten() {
        write!(out, ", {noise}")?;
    }
    writeln!(out)?;
    let (rows, scale) = (source.rows().ok(), source.sensor.scale);
    if let Some(rows) = rows {
        write!(
            out,
            "A frame has {} and {}; {} with {}",
            counted(rows * source.scene.unknowns_per_row(scale), "unknown"),
            counted(rows * scale.columns(), "equation"),
            counted(source.scene.rows.model().decoders(rows), "network"),
            counted(file.network.weights(), "weight")
        )?;
    }
    match condition(Outlook::of(source).ok().as_ref()) {
        Some(condition) => writeln!(out, "; condition number of the worst row {condition:.1e}")?,
        None => writeln!(out)?,
    }
    let rows = rows.unwrap_or(1);
    let whole = |samples: usize| samples.div_ceil(rows) * rows;
    writeln!(
        out,
        "{} for training, {} for validation, {} for testing",
        counted(whole(source.samples), "sample"),
        whole(source.validation_samples),
        whole(source.test_samples)
    )
}
