use std::{
    io::{Write, stderr},
    path::{Path, PathBuf},
};

use clap::Args;
use indicatif::ProgressBar;

use super::{
    announcement::announce,
    checkpointing::{CheckpointArguments, Checkpointing, Saving},
    failure::{Failure, Interruption},
    import_arguments::ImportArguments,
    interruption::Graceful,
    output::{print_object, progress_bar},
    train_report::{print_text, report},
    training_arguments::TrainingArguments,
};
use crate::{
    decoupling::DecoderKind,
    evaluation::{DecoderReport, DecoderSet, Run, RunError},
    export::{
        CheckpointFile, DocumentError, MeasuredCheckpointFile, NetworkFile, SensorFile, check_writable, format_number,
        is_same,
        report::{RunReport, quoted},
    },
    training::TrainingSettings,
};

/// Train a network and print its errors
///
/// Draws samples of the array, trains, and compares the network on its test samples with the mean of the training
/// set, with the best linear map, with other decoders, with the least error possible in the scene (the reference), and
/// with the published figures where there are any. With --data it trains on samples of a real sensor from files, and compares
/// the network with the mean and with ridge regression, target by target. Ctrl-C stops after the epoch,
/// keeps the best network so far, and ends with status 130; a second Ctrl-C ends at once.
#[derive(Args)]
#[command(allow_negative_numbers = true)]
pub(super) struct Train {
    #[command(flatten)]
    pub(super) training: TrainingArguments,
    #[command(flatten)]
    pub(super) import: ImportArguments,
    #[command(flatten)]
    pub(super) checkpoint: CheckpointArguments,
    /// Sensor model written by calibrate, in the place of --array
    #[arg(long, value_name = "FILE", conflicts_with_all = ["array", "resume", "data", "recipe"])]
    sensor: Option<PathBuf>,
    /// File for the network, to be opened in the window or given to decode
    #[arg(long, value_name = "FILE")]
    pub(super) out: Option<PathBuf>,
    /// File for a report with errors, figures, settings and the command that repeats the run, as one HTML page
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Print one JSON object instead of text and progress
    #[arg(long)]
    pub(super) json: bool,
}

impl Train {
    pub(super) fn run(self) -> Result<(), Failure> {
        self.checkpoint.check()?;
        self.check_paths()?;
        if let Some(path) = self.checkpoint.checkpoint.as_ref().filter(|_| self.checkpoint.resume) {
            match MeasuredCheckpointFile::load(path) {
                // It is of another kind.
                Err(DocumentError::Other { .. }) => {}
                file if self.import.is_given() => {
                    file?;
                    let message = "--data: the checkpoint names the files; leave it out to resume";
                    return Err(Failure::Arguments(message.to_owned()));
                }
                file => {
                    self.check_no_report()?;
                    return self.resume_measured(path, file?);
                }
            }
        }
        if self.import.is_given() {
            self.check_no_report()?;
            return self.run_measured();
        }
        self.import.check_unused()?;
        let mut run = match &self.checkpoint.checkpoint {
            Some(path) if self.checkpoint.resume => self.resume(path)?,
            _ => {
                let mut settings = self.training.settings()?;
                if let Some(path) = &self.sensor {
                    settings.source.sensor = SensorFile::load(path)?;
                }
                announce(&settings)?;
                Run::prepare(settings)?
            }
        };
        let end = self.train(&mut run, self.checkpoint.checkpointing(Saving::Simulated));
        let file = NetworkFile::from_run(&run)?;
        // Whatever fails now, the figures are printed.
        let saved = self.out.as_ref().map_or(Ok(()), |path| file.save(path));
        let mut decoders = Vec::new();
        let measured = match end {
            Err(Failure::Interrupted(_)) => Ok(()),
            _ => measure_decoders(&self.training.scene.decoders(), &file, &run, &mut decoders),
        };
        let flaw = run.flaw();
        let reported = self.report.as_ref().map_or(Ok(()), |path| {
            let report = RunReport {
                name: None,
                file: &file,
                flaw: flaw.as_ref(),
                decoders: &decoders,
                test: run.test(),
            };
            report.save(path)
        });
        if self.json {
            print_object(&report(&file, flaw.as_ref(), &decoders)?)?;
        } else {
            print_text(&file, flaw.as_ref(), &decoders)?;
        }
        measured?;
        let saved = saved.map_err(Failure::from);
        let reported = reported.map_err(Failure::from);
        first_failure([saved, reported, end])
    }

    /// Joins what saving the network and training came to.
    pub(super) fn end(&self, saved: Result<(), DocumentError>, end: Result<(), Failure>) -> Result<(), Failure> {
        first_failure([saved.map_err(Failure::from), end])
    }

    fn check_no_report(&self) -> Result<(), Failure> {
        if self.report.is_none() {
            return Ok(());
        }
        let message = "--report: reports are written of simulated sensors; leave it out, or use --json with --data";
        Err(Failure::Arguments(message.to_owned()))
    }

    /// Checks that every file has a path of its own that can be written.
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
        files.iter().try_for_each(|(_, path)| Ok(check_writable(path)?))
    }

    fn resume(&self, path: &Path) -> Result<Run, Failure> {
        let file = CheckpointFile::load(path)?;
        let saved = file.settings.training;
        let training = self.training.training_from(&file.settings)?;
        announce(&file.settings)?;
        let mut run = file.resume().map_err(|source| Failure::Resume {
            path: path.to_owned(),
            source,
        })?;
        self.continue_run(&mut run, saved, training)?;
        Ok(run)
    }

    /// Gives a resumed run the method and stopping rules asked for, where they differ from those `saved`.
    pub(super) fn continue_run(
        &self,
        run: &mut Run,
        saved: TrainingSettings,
        training: TrainingSettings,
    ) -> Result<(), Failure> {
        run.set_stopping(training.stopping)?;
        if training.method != saved.method {
            run.continue_with(training.method)?;
            if run.stop_reason().is_some() {
                let epochs = training.stopping.epochs;
                return Err(Failure::Arguments(format!(
                    "the checkpoint has run all of its {epochs} epochs: give more with --epochs to continue with another method"
                )));
            }
        }
        Ok(())
    }

    /// Trains to the end, or to the first epoch after Ctrl-C. The progress bar is shown only if standard error is a
    /// terminal.
    pub(super) fn train(&self, run: &mut Run, checkpointing: Option<Checkpointing>) -> Result<(), Failure> {
        let bar = progress_bar(
            self.json,
            run.settings().training.stopping.epochs,
            "{bar:30} epoch {pos} of {len}, {msg}, at most {eta} left",
        );
        bar.set_position(furthest(run) as u64);
        // The time left is reckoned from the epochs of this session only.
        bar.reset_eta();
        let graceful = Graceful::begin();
        let mut checkpointing = checkpointing;
        while run.stop_reason().is_none() && !graceful.is_end_requested() {
            if let Some(checkpointing) = &mut checkpointing {
                checkpointing.save_if_due(run);
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
            let resume = self
                .checkpoint
                .checkpoint
                .as_deref()
                .map(|path| self.resume_command(path));
            let epoch = furthest(run);
            return Err(Failure::Interrupted(Interruption { epoch, resume }));
        }
        Ok(())
    }

    /// Command that resumes the training.
    fn resume_command(&self, checkpoint: &Path) -> String {
        let mut command = format!("decoupler train --checkpoint {} --resume", quoted(checkpoint));
        if let Some(path) = &self.out {
            command += &format!(" --out {}", quoted(path));
        }
        if let Some(path) = &self.report {
            command += &format!(" --report {}", quoted(path));
        }
        if self.json {
            command += " --json";
        }
        command
    }
}

/// Returns the first failure, and tells the others.
fn first_failure(ends: impl IntoIterator<Item = Result<(), Failure>>) -> Result<(), Failure> {
    let mut failures = ends.into_iter().filter_map(Result::err);
    let Some(first) = failures.next() else { return Ok(()) };
    for other in failures {
        // Nobody is left to tell if this fails.
        let _ = writeln!(stderr(), "{other}");
    }
    Err(first)
}

/// Measures decoders of these kinds on the test samples of `run`, whose network is in `file`.
pub(super) fn measure_decoders(
    kinds: &[DecoderKind],
    file: &NetworkFile,
    run: &Run,
    reports: &mut Vec<DecoderReport>,
) -> Result<(), RunError> {
    let set = DecoderSet::new(&file.settings, Some(file.network.clone()))?;
    for kind in kinds {
        for &precision in kind.precisions() {
            reports.extend(set.measure(*kind, precision, run.test())?);
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
        starts => format!(", {} of {starts} starts ended", ended.count()),
    };
    bar.set_message(format!("mse {mse}{starts}"));
}
