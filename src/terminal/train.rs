use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::ProgressBar;

use super::{
    cross_validation::optimism as optimism_of,
    failure::Failure,
    import_arguments::ImportArguments,
    interruption::{CheckpointArguments, Graceful, save_if_due},
    intervals::{WhenCalibrated, calibrate, note_unmonitored},
    output::{check_output, input, is_json, output, progress_bar, warn},
    samples::{announce, announce_recording, following, sets, working_folder},
    settings_arguments::{RARELY, TrainingArguments},
    train_report::Trained,
    within,
};
use decoupler_core::{
    decoupling::DecoderKind,
    evaluation::{
        DecoderReport, DecoderSet, Run, RunError,
        auto::{AutoFixed, DEFAULT_BUDGET_S},
    },
    job::Job,
    text::counted,
    training::TrainingSettings,
};
use decoupler_files::{
    export::{
        CheckpointFile, Checkpointing, NetworkFile, SensorFile, check_writable, format_number, is_same,
        report::{RunReport, quoted},
    },
    import::{ChoosingProgress, ImportError, Setup, SetupError, SetupSets},
};

/// Train a network and print its errors
///
/// Draws samples of the array, trains, and compares the network on its test samples with the mean of the training set,
/// with the best linear map, with other decoders, with the decoder that knows the sensor model (model-based), and
/// with the published figures, if any. With --data it trains on the samples of a recording, and compares the network with
/// the mean, with ridge regression and with other decoders, target by target; unless settings of the training are given,
/// they are first chosen by cross-validation on the training samples (--hidden auto), and the answer is the combination of ridge
/// regression, kernel ridge regression and networks that is best there. Ctrl-C stops after the epoch, keeps the
/// best network so far, and ends with status 130; a second Ctrl-C ends at once. SIGTERM (status 143) and SIGHUP (129) do the
/// same.
#[derive(Args)]
#[command(allow_negative_numbers = true)]
pub(super) struct Train {
    #[command(flatten)]
    pub(super) import: ImportArguments,
    /// Sensor model written by calibrate, instead of --array
    #[arg(long, value_name = "FILE", value_parser = input, conflicts_with_all = ["array", "resume", "data", "recipe"], hide_short_help = true, help_heading = "Simulated array")]
    sensor: Option<PathBuf>,
    /// File for the network, for use in the window or with decode
    #[arg(short, long, value_name = "FILE", value_parser = output, help_heading = "Output")]
    pub(super) out: Option<PathBuf>,
    /// File for a report with errors, figures, settings and the command that repeats the run, as one HTML page
    #[arg(long, value_name = "FILE", value_parser = output, help_heading = "Output")]
    pub(super) report: Option<PathBuf>,
    #[command(flatten)]
    pub(super) training: TrainingArguments,
    #[command(flatten)]
    pub(super) checkpoint: CheckpointArguments,
    /// Test on every sample by cross-validation with this many folds, divided by --split
    #[arg(long, value_name = "K", conflicts_with_all = ["test_data", "resume"], hide_short_help = true, help_heading = RARELY)]
    pub(super) folds: Option<usize>,
    /// Time on one core that a choice of settings (--hidden auto) and the training may take, estimated from their work, so
    /// that the choice is the same on every machine [default: 60]
    #[arg(long, value_name = "SECONDS", value_parser = within(1.0..=86_400.0, "seconds from 1 to 86400, for example 60"), hide_short_help = true, help_heading = RARELY)]
    budget: Option<f64>,
    /// When to calibrate the 90 % prediction intervals of a recording's targets. After a choice of settings (--hidden
    /// auto), this takes no time; otherwise the training samples are cross-validated, which takes four times as long as the
    /// training: auto if that is at most a minute. Simulated arrays have none: theirs would hold for the scene, not for a
    /// sensor, and the errors of each node already describe the scene
    #[arg(long, value_name = "WHEN", default_value = "auto", hide_short_help = true, help_heading = RARELY)]
    pub(super) intervals: WhenCalibrated,
}

impl Train {
    pub(super) fn run(self) -> Result<(), Failure> {
        self.checkpoint.check()?;
        self.check_paths()?;
        let resumed = self.checkpoint.checkpoint.as_ref().filter(|_| self.checkpoint.resume);
        let (mut run, sets) = match resumed {
            Some(path) => self.resume(path)?,
            None => {
                let setup = self.setup()?;
                if let Some(folds) = self.folds {
                    self.training
                        .refuse_auto("--folds measures the same settings in every fold")?;
                    return self.cross_validate(&setup, folds);
                }
                let (setup, sets) = match self.chooses(&setup)? {
                    true => self.choose(&setup)?,
                    false => {
                        let sets = sets(&setup)?;
                        (setup, sets)
                    }
                };
                announce_recording(&setup, &sets);
                let run = sets.run(&setup, None, &Job::UNINTERRUPTED)?;
                (run, sets)
            }
        };
        let end = self.train(&mut run, self.checkpoint.checkpointing(sets.recorded()));
        if end.is_ok() {
            calibrate(&mut run, &sets, self.intervals);
        }
        let mut file = NetworkFile::from_run(&run, sets.recorded())?;
        file.drift = sets.drift_reference();
        note_unmonitored(&file);
        // The figures are printed even if something fails from here on.
        let saved = self.out.as_ref().map_or(Ok(()), |path| file.save(path));
        let (mut decoders, mut optimism, mut measured) = (Vec::new(), Vec::new(), Ok(()));
        if !matches!(end, Err(Failure::Interrupted(_))) {
            measured = measure_decoders(&self.decoders(&run), &file, &sets, &mut decoders);
        }
        if let Some(recordings) = sets.recordings.as_ref().filter(|_| end.is_ok()) {
            let plan = &recordings.recorded.plan;
            if plan.test.is_none() {
                optimism = optimism_of(&recordings.training, run.settings(), plan.division.by);
            }
        }
        let defect = run.defect();
        let report = RunReport {
            name: None,
            file: &file,
            defect: defect.as_deref(),
            decoders: &decoders,
            test: run.test(),
        };
        let reported = self.report.as_ref().map_or(Ok(()), |path| report.save(path));
        let trained = Trained {
            run: &run,
            sets: &sets,
            report,
            optimism: &optimism,
        };
        trained.warnings().into_iter().for_each(warn);
        trained.print()?;
        measured?;
        first_failure([saved.map_err(Failure::from), reported.map_err(Failure::from), end])
    }

    /// Setup of a new run.
    fn setup(&self) -> Result<Setup, Failure> {
        let source = self.import.source(&self.training.scene.columns())?;
        let setup = self.training.setup(source)?;
        let mut settings = *setup.settings();
        if let (Some(path), Some(simulation)) = (&self.sensor, settings.simulation_mut()) {
            simulation.sensor = SensorFile::load(path)?;
        }
        Ok(setup.with_settings(settings))
    }

    /// Returns `true` if the settings of the run are to be chosen.
    ///
    /// # Errors
    /// If this is requested but not possible, or a budget is given for nothing.
    fn chooses(&self, setup: &Setup) -> Result<bool, Failure> {
        if !setup.can_choose() {
            self.training
                .refuse_auto("settings are chosen for a recording (--data) with one network for all rows")?;
        }
        let chooses = setup.can_choose() && self.training.is_auto();
        let refused = if chooses {
            None
        } else if self.budget.is_some() {
            Some("--budget: it is for a choice of settings; give --data and --hidden auto, or leave it out")
        } else if self.import.fixed_history()?.1 {
            Some("--history auto: it is for a choice of settings; give spans, or --hidden auto")
        } else {
            None
        };
        if let Some(message) = refused {
            return Err(Failure::Arguments(message.to_owned()));
        }
        Ok(chooses)
    }

    /// Chooses the settings of `setup`, with a progress bar of the budget.
    fn choose(&self, setup: &Setup) -> Result<(Setup, SetupSets), Failure> {
        let bar = progress_bar(100, "{bar:20} {msg}");
        let (memory, tries_memory) = self.import.fixed_history()?;
        let fixed = AutoFixed {
            memory,
            tries_memory,
            ..self.training.fixed(setup.settings())?
        };
        let chosen = setup.choose(
            &fixed,
            self.budget.unwrap_or(DEFAULT_BUDGET_S),
            working_folder(),
            &Job::UNINTERRUPTED,
            &mut |progress| match progress {
                ChoosingProgress::Reading(_) => bar.set_message("Reading the recording"),
                ChoosingProgress::Trying(progress) => {
                    bar.set_position((100.0 * progress.share) as u64);
                    bar.set_message(progress.text);
                }
            },
        );
        bar.finish_and_clear();
        Ok(chosen?)
    }

    /// Decoders to measure: those given, by default all for a simulated array and none for a recording.
    fn decoders(&self, run: &Run) -> Vec<DecoderKind> {
        if run.problem().sensor.is_some() {
            self.training.scene.decoders()
        } else {
            self.training.scene.decoder.clone()
        }
    }

    /// Checks that every file has a distinct path that can be written.
    fn check_paths(&self) -> Result<(), Failure> {
        let files = [
            ("--out", &self.out),
            ("--report", &self.report),
            ("--checkpoint", &self.checkpoint.checkpoint),
        ];
        let files: Vec<_> = files
            .iter()
            .filter_map(|(name, path)| Some((name, path.as_ref()?)))
            .collect();
        for (number, (name, path)) in files.iter().enumerate() {
            if let Some((other, _)) = files[number + 1..].iter().find(|(_, other)| is_same(path, other)) {
                let message = format!("{name} and {other} name the same file: give each its own");
                return Err(Failure::Arguments(message));
            }
        }
        let mut written = files.iter().filter(|(name, _)| **name != "--checkpoint");
        written.try_for_each(|(name, path)| check_output(name, path))?;
        let checkpoint = self.checkpoint.checkpoint.iter();
        checkpoint.into_iter().try_for_each(|path| Ok(check_writable(path)?))
    }

    /// Resumes the training of a checkpoint.
    fn resume(&self, path: &Path) -> Result<(Run, SetupSets), Failure> {
        let mut file = CheckpointFile::load(path)?;
        let saved = file.setup();
        match saved.plan() {
            Some(plan) => self.import.check_resumed(plan)?,
            None if self.import.is_given() => {
                let message = "--data: the checkpoint belongs to a simulated array; leave it out to resume";
                return Err(Failure::Arguments(message.to_owned()));
            }
            None => self.import.check_unused()?,
        }
        let training = self.training.resumed(&saved)?;
        if let Some(recorded) = &mut file.recorded {
            *recorded = self.import.relocated(recorded)?;
            if let Some(file) = recorded.plan.irregular().filter(|_| self.import.data.is_empty()) {
                return Err(ImportError::Irregular(file).into());
            }
            if let Some(missing) = recorded.missing().first() {
                let missing = missing.display();
                let message = format_args!("its recording '{missing}' is missing; give its new path with --data FILE");
                return Err(Failure::at(path, message));
            }
        }
        announce(&file.settings)?;
        let resumed = following(&saved, |on_progress| file.resume(&Job::UNINTERRUPTED, on_progress));
        let (mut run, mut sets) = resumed.map_err(|error| match error {
            SetupError::Run(source) => Failure::at(path, source),
            error => error.into(),
        })?;
        if training != saved.settings().training {
            sets.forget_choice();
            run.set_combined(None);
        }
        self.continue_run(&mut run, saved.settings().training, training)?;
        Ok((run, sets))
    }

    /// Applies the requested method and stopping rules to a resumed run, where they differ from those `saved`.
    fn continue_run(&self, run: &mut Run, saved: TrainingSettings, training: TrainingSettings) -> Result<(), Failure> {
        run.set_stopping(training.stopping)?;
        if training.method != saved.method {
            run.continue_with(training.method)?;
            if run.stop_reason().is_some() {
                let epochs = counted(training.stopping.epochs, "epoch");
                return Err(Failure::Arguments(format!(
                    "the checkpoint has run all of its {epochs}: give more with --epochs to continue with another method"
                )));
            }
        }
        Ok(())
    }

    /// Trains to the end, or to the first epoch after a request to stop. The progress bar is shown only if standard error is a
    /// terminal.
    fn train(&self, run: &mut Run, checkpointing: Option<Checkpointing>) -> Result<(), Failure> {
        let bar = progress_bar(
            run.settings().training.stopping.epochs,
            "{bar:30} epoch {pos} of {len}, {msg}, at most {eta} left",
        );
        bar.set_position(furthest(run) as u64);
        // The remaining time is estimated from the epochs of this session only.
        bar.reset_eta();
        let graceful = Graceful::begin();
        let mut checkpointing = checkpointing;
        while run.stop_reason().is_none() && !graceful.is_end_requested() {
            if let Some(checkpointing) = &mut checkpointing {
                save_if_due(checkpointing, run);
            }
            run.step();
            if !bar.is_hidden() {
                show(run, &bar);
            }
        }
        bar.finish_and_clear();
        let is_interrupted = run.stop_reason().is_none();
        run.stop();
        if let Some(checkpointing) = &checkpointing {
            checkpointing.save(run)?;
        }
        drop(graceful);
        if is_interrupted {
            let resume = match &self.checkpoint.checkpoint {
                Some(path) => format!("to resume: {}", self.resume_command(path)),
                None => "use --checkpoint FILE to be able to resume".to_owned(),
            };
            return Err(Failure::Interrupted(format!(
                " after epoch {}; {resume}",
                furthest(run)
            )));
        }
        Ok(())
    }

    /// Command that resumes the training.
    fn resume_command(&self, checkpoint: &Path) -> String {
        let mut command = format!("decoupler train --checkpoint {} --resume", quoted(checkpoint));
        for (name, path) in [("out", &self.out), ("report", &self.report)] {
            if let Some(path) = path {
                command += &format!(" --{name} {}", quoted(path));
            }
        }
        if self.out.is_some() || self.report.is_some() {
            command += " --force";
        }
        if is_json() {
            command += " --json";
        }
        command
    }
}

/// Returns the first failure, and prints the others.
fn first_failure(ends: impl IntoIterator<Item = Result<(), Failure>>) -> Result<(), Failure> {
    let mut failures = ends.into_iter().filter_map(Result::err);
    let Some(first) = failures.next() else { return Ok(()) };
    for other in failures {
        warn(other);
    }
    Err(first)
}

/// Measures decoders of these kinds on the test samples of `sets`, next to the network of `file`.
pub(super) fn measure_decoders(
    kinds: &[DecoderKind],
    file: &NetworkFile,
    sets: &SetupSets,
    reports: &mut Vec<DecoderReport>,
) -> Result<(), RunError> {
    if kinds.is_empty() {
        return Ok(());
    }
    let training = sets.sets.split.training.clone();
    let set = DecoderSet::new(file.settings, training, Some(file.network.clone()));
    for kind in kinds {
        for &precision in kind.precisions() {
            reports.extend(set.measure(*kind, precision, &sets.sets.test)?);
        }
    }
    Ok(())
}

/// Largest epoch among the starts.
fn furthest(run: &Run) -> usize {
    let epochs = run.trainers().iter().map(|trainer| trainer.latest().epoch);
    epochs.max().unwrap_or(0)
}

fn show(run: &Run, bar: &ProgressBar) {
    bar.set_position(furthest(run) as u64);
    let mse = format_number(run.leader().latest().training_mse);
    let ended = run.trainers().iter().filter(|trainer| trainer.stop_reason().is_some());
    let starts = match run.trainers().len() {
        1 => String::new(),
        starts => format!(", {} of {starts} restarts ended", ended.count()),
    };
    bar.set_message(format!("mse {mse}{starts}"));
}
