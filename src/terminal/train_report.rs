use std::io::{self, Write};

use serde_json::{Value, json};

use super::{
    failure::Failure,
    inspect::{RecordingReport, import_warnings},
    output::{joined, print, value},
};
use decoupler_core::{
    dataset::Simulation,
    evaluation::{
        Coverage, DecoderReport, Outlook, Run, RunError, TargetErrors, TestErrors,
        auto::AutoRecord,
        best_start,
        recorded::{Determination, HysteresisLoop, Undetermined, extrapolation},
    },
    problem::Channel,
    text::counted,
};
use decoupler_files::{
    export::{
        NetworkFile, TrainingRecord, describe_coverage, describe_half_widths, describe_samples, report::RunReport,
    },
    import::{Recording, Recordings, SetupSets},
};

/// A trained network and its measured errors.
pub(super) struct Trained<'a> {
    pub(super) run: &'a Run,
    pub(super) sets: &'a SetupSets,
    pub(super) report: RunReport<'a>,
    /// Warnings about how optimistic random test samples are.
    pub(super) optimism: &'a [String],
}

impl Trained<'_> {
    /// Prints the report, as JSON or as text.
    pub(super) fn print(&self) -> Result<(), Failure> {
        let object = self.object()?;
        print(|| object, |out| self.write(out))
    }

    /// Returns the object printed by `train --json`, without its warnings.
    pub(super) fn object(&self) -> Result<Value, Failure> {
        let file = self.report.file;
        let (settings, training) = (&file.settings, &file.training);
        let source = match (&self.sets.recordings, settings.simulation()) {
            (Some(recordings), _) => self.recording_object(recordings)?,
            (None, Some(simulation)) => self.array_object(simulation)?,
            (None, None) => unreachable!("sets are recorded or simulated"),
        };
        let mut object = json!({
            "hidden": settings.hidden,
            "method": settings.training.method.short_name(),
            "seed": settings.seed.0,
            "starts": training.starts,
            "combine": settings.combine,
            "epochs": epochs(training),
            "best_epoch": training.best_epoch,
            "stop_reason": training.stop_reason,
            "networks": file.network.values().len(),
            "weights": file.network.weights(),
        });
        // What was tried to choose the settings, if they were chosen.
        if let Some(search) = search(file) {
            object["search"] = value(search);
        }
        if file.problem.has_nodes() || !self.report.decoders.is_empty() {
            let decoders = self.report.decoders.iter();
            let decoders = decoders.map(|report| (report.name(), decoder_object(&file.problem.targets, report)));
            object["decoders"] = Value::Object(decoders.collect());
        }
        Ok(joined([source, object]))
    }

    fn recording_object(&self, recordings: &Recordings) -> Result<Value, Failure> {
        let NetworkFile { problem, scores, .. } = self.report.file;
        let recording = RecordingReport::new(&self.sets.sets, recordings).map_err(Failure::Output)?;
        let of_network = targets(&problem.targets, &scores.network, &self.determined(), &scores.coverage);
        let figures = json!({
            "seconds": self.run.wall_time().map(|time| time.as_secs_f64()),
            // Share of the test samples outside the range of the training samples.
            "test_outside_training": self.extrapolation().map_or(0.0, |(share, _)| share),
            "targets": of_network,
            "baselines": {
                "mean": targets(&problem.targets, &scores.baselines.mean, &[], &[]),
                "ridge": targets(&problem.targets, &scores.baselines.linear, &[], &[]),
            },
            // None for a target that does not rise and fall, or if the order in time is lost.
            "hysteresis": self.loops(),
        });
        Ok(joined([recording.object, figures]))
    }

    fn array_object(&self, source: &Simulation) -> Result<Value, Failure> {
        let (settings, training, scores) = (
            &self.report.file.settings,
            &self.report.file.training,
            &self.report.file.scores,
        );
        let (rows, scale) = (source.rows().map_err(RunError::from)?, source.sensor.scale);
        let best = training.history.get(training.best_epoch);
        let best_start = best_start(&training.starts).and_then(|number| training.starts.get(number));
        let (train_mse, validation_mse) = match (best_start, best) {
            (Some(start), _) => (start.train_mse, start.validation_mse),
            (None, best) => (
                best.map_or(f64::NAN, |record| record.training_mse),
                best.and_then(|record| record.validation_mse),
            ),
        };
        let nodes = |errors: &TestErrors| *errors.nodes().expect("the targets are nodes");
        let baselines = &scores.baselines;
        let model_based = baselines.model_based.as_ref().map(nodes);
        let published = settings.published();
        Ok(json!({
            "array": scale,
            "samples": source.samples,
            "validation_samples": source.validation_samples,
            "test_samples": source.test_samples,
            "stages": training.stages,
            "train_mse": train_mse,
            "validation_mse": validation_mse,
            "epoch_ms": 1e3 * epoch_seconds(training),
            "errors": nodes(&scores.network),
            "baselines": {
                "mean": nodes(&baselines.mean),
                "linear": nodes(&baselines.linear),
                "model_based": model_based,
            },
            "published": published.map(|row| {
                json!({"z_percent": row.z_percent, "x_percent": row.x_percent, "y_percent": row.y_percent})
            }),
            "scene": source.scene,
            "inputs": settings.inputs,
            "unknowns": rows * source.scene.unknowns_per_row(scale),
            "equations": rows * scale.columns(),
            "condition": condition(source),
            "model_based": model_based.map(|errors| json!({"z_percent": errors.z_percent, "z_mm": errors.z_mm})),
        }))
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
        let Recording { problem, .. } = &self.sets.recordings.as_ref()?.training;
        let (inputs, targets) = (&problem.features(), &problem.targets);
        let training = &self.sets.sets.split.training;
        Some(extrapolation(training, self.run.test(), inputs, targets))
    }

    /// Warnings of the source and of the training, and remarks on the figures.
    pub(super) fn warnings(&self) -> Vec<String> {
        let NetworkFile { problem, scores, .. } = self.report.file;
        let mut warnings = Vec::from_iter(self.sets.recordings.iter().flat_map(import_warnings));
        warnings.extend(self.extrapolation().and_then(|(_, warning)| warning));
        warnings.extend(describe_samples(self.sets));
        let search = search(self.report.file).into_iter();
        warnings.extend(search.flat_map(|record| record.remarks(&problem.targets)));
        warnings.extend(self.optimism.iter().cloned());
        warnings.extend(self.report.remarks());
        warnings.extend(describe_coverage(&problem.targets, &scores.coverage));
        warnings
    }

    fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let (file, targets) = (self.report.file, &self.report.file.problem.targets);
        if let Some(recordings) = &self.sets.recordings {
            out.write_all(&RecordingReport::new(&self.sets.sets, recordings)?.text)?;
        }
        write!(out, "{}", self.report.text())?;
        for (target, found) in targets.iter().zip(&self.loops()) {
            if let Some(found) = found {
                writeln!(out, "{}", found.sentence(&target.name))?;
            }
        }
        let intervals = file.intervals.as_ref();
        if let Some(sentence) = intervals.and_then(|intervals| describe_half_widths(targets, intervals)) {
            writeln!(out, "{sentence}")?;
        }
        if let Some(Ok((source, rows))) = file
            .problem
            .sensor
            .as_ref()
            .map(|source| source.rows().map(|rows| (source, rows)))
        {
            let scale = source.sensor.scale;
            writeln!(
                out,
                "A frame has {} and {}{}",
                counted(rows * source.scene.unknowns_per_row(scale), "unknown"),
                counted(rows * scale.columns(), "equation"),
                condition(source).map_or_else(String::new, |condition| format!(
                    "; condition number of the worst row {condition:.1e}"
                ))
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
fn condition(source: &Simulation) -> Option<f64> {
    let condition = Outlook::of(source).ok()?.worst_row.condition();
    Some(condition).filter(|condition| condition.is_finite())
}

/// Errors and times of a decoder; `residual` is the root mean square of m/R − 1, none if the decoded deformation has no valid
/// resistance, and `solved` is none for decoders that do not solve the equations of the sensor.
pub(super) fn decoder_object(channels: &[Channel], report: &DecoderReport) -> Value {
    let solved = &report.solved;
    let rows = || json!({"rows": solved.rows, "unsolved": solved.unsolved, "undetermined": solved.undetermined});
    let figures = json!({
        "frame_us": report.frame_us,
        "residual": report.residual,
        "fit_seconds": report.fit_seconds,
        "remarks": report.remarks,
        "solved": (solved.rows > 0).then(rows),
    });
    joined([errors_object(channels, &report.errors), figures])
}

/// Errors of a decoder: of the nodes of an array, or of each target with the mean absolute error in percent of the range.
fn errors_object(channels: &[Channel], errors: &TestErrors) -> Value {
    match errors {
        TestErrors::Nodes(errors) => json!({"z_percent": errors.z_percent, "z_mm": errors.z_mm}),
        TestErrors::Targets(_) => {
            json!({"percent_of_range": errors.percent(), "targets": targets(channels, errors, &[], &[])})
        }
    }
}

/// Returns the errors of the targets `channels`; `determined` are the coefficients of determination with their 95 %
/// confidence intervals, and `coverage` that of the 90 % prediction intervals, if they were measured.
pub(super) fn targets(
    channels: &[Channel],
    errors: &TestErrors,
    determined: &[Result<Determination, Undetermined>],
    coverage: &[Option<Coverage>],
) -> Value {
    let target = |(index, (channel, errors)): (usize, (&Channel, &TargetErrors))| {
        let mut target = joined([json!({"name": channel.name, "unit": channel.unit}), value(errors)]);
        if let Some(Ok(Determination { r2, .. })) = determined.get(index) {
            target["r2_interval"] = json!([r2.low, r2.high]);
        }
        if let Some(Some(coverage)) = coverage.get(index) {
            target["interval"] = value(coverage);
        }
        target
    };
    let channels = channels.iter().zip(errors.targets());
    channels.enumerate().map(target).collect()
}
