use std::{
    ops::ControlFlow,
    path::Path,
    sync::{
        Arc,
        mpsc::{Receiver, TryRecvError},
    },
    time::{Duration, Instant},
};

use super::{Command, Task, TrainingEvent, ValidationChoice};
use crate::{
    app::{
        job::Report,
        shared::Phase,
        training_worker::{continue_run, furthest_epoch},
        views::own_data::{
            model::{Positions, Tested, Trained, Validated},
            remarks::in_window,
        },
    },
    dataset::{Folds, Seed, SplitBy, Stream},
    evaluation::Channel,
    evaluation::{
        CrossValidated, Run, RunSettings,
        recorded::{Determination, NonlinearGain, SplitComparison},
    },
    export::{MeasuredCheckpointFile, MeasuredNetworkFile, describe_standings, describe_worse_than_ridge},
    import::{Plan, PlannedSets, Progress},
    training::TrainingSettings,
};

/// The shortest time between two reports of a training, as in the Train view.
const REPORT_INTERVAL: Duration = Duration::from_millis(100);

/// Does a task until there is nobody to command it.
pub(super) fn run(task: Task, commands: &Receiver<Command>, report: &Report<TrainingEvent>) -> Result<(), String> {
    match task {
        Task::Train(plan, settings) => {
            let sets = sets(&plan, settings.seed, report)?;
            let about = About::new(*plan, &sets);
            let PlannedSets { split, test, .. } = sets;
            let run = Run::on_sets(settings, split, test).map_err(|error| error.to_string())?;
            Training::new(run, about, false, report).train(commands);
        }
        Task::Resume(path, file) => {
            let refused = |reason: String| format!("'{}': {reason}", path.display());
            take_up(*file, commands, report, &refused)?;
        }
        Task::TakeUp(file) => take_up((*file).clone(), commands, report, &|reason| reason)?,
        Task::Validate(plan, settings, choice) => {
            if let Some(validated) = validate(&plan, &settings, choice, report)? {
                report.send(TrainingEvent::Validated(Box::new(validated)));
            }
        }
    }
    Ok(())
}

/// Reads the samples of a checkpoint again, and holds its training. `refused` says of what it is told that it cannot go on.
fn take_up(
    file: MeasuredCheckpointFile,
    commands: &Receiver<Command>,
    report: &Report<TrainingEvent>,
    refused: &dyn Fn(String) -> String,
) -> Result<(), String> {
    let plan = file.plan.clone();
    let sets = sets(&plan, file.settings.seed, report)?;
    let about = About::new(plan, &sets);
    if about.samples_crc32 != file.samples_crc32 {
        return Err(refused(format!(
            "'{}' has other samples than when the checkpoint was saved; use the files of that time, or train again",
            about.plan.import.data.display()
        )));
    }
    let run = file.resume(sets).map_err(|error| refused(error.to_string()))?;
    Training::new(run, about, true, report).train(commands);
    Ok(())
}

fn watch(progress: Progress, report: &Report<TrainingEvent>) -> ControlFlow<()> {
    report.progress(TrainingEvent::Reading(progress), |_, _| ());
    if report.is_cancelled() {
        ControlFlow::Break(())
    } else {
        ControlFlow::Continue(())
    }
}

fn sets(plan: &Plan, seed: Seed, report: &Report<TrainingEvent>) -> Result<PlannedSets, String> {
    let sets = plan.sets(Path::new(""), seed, &mut |progress| watch(progress, report));
    sets.map_err(|error| in_window(&error))
}

/// The contents of a network file beside the network.
struct About {
    plan: Plan,
    inputs: Vec<Channel>,
    targets: Vec<Channel>,
    positions: Positions,
    samples_crc32: String,
}

impl About {
    fn new(plan: Plan, sets: &PlannedSets) -> Self {
        Self {
            plan: plan.absolute(),
            inputs: sets.recording.inputs.clone(),
            targets: sets.recording.targets.clone(),
            positions: Positions::of(&sets.recording),
            samples_crc32: MeasuredCheckpointFile::checksum(sets),
        }
    }
}

/// A run under way.
struct Training<'a> {
    run: Run,
    about: About,
    is_paused: bool,
    report: &'a Report<TrainingEvent>,
    next_report: Instant,
}

impl<'a> Training<'a> {
    fn new(run: Run, about: About, is_paused: bool, report: &'a Report<TrainingEvent>) -> Self {
        Self {
            run,
            about,
            is_paused,
            report,
            next_report: Instant::now(),
        }
    }

    fn train(mut self, commands: &Receiver<Command>) {
        self.tell();
        while !self.report.is_cancelled() {
            let is_standing = self.is_paused || self.run.stop_reason().is_some();
            let command = if is_standing {
                commands.recv().map_err(TryRecvError::from)
            } else {
                commands.try_recv()
            };
            match command {
                Ok(command) => self.obey(command),
                Err(TryRecvError::Empty) => {
                    let has_ended = self.run.step().is_some();
                    if has_ended || Instant::now() >= self.next_report {
                        self.tell();
                    }
                }
                Err(TryRecvError::Disconnected) => return,
            }
        }
    }

    fn obey(&mut self, command: Command) {
        match command {
            Command::Pause => self.is_paused = true,
            Command::Resume => self.is_paused = false,
            Command::Stop => self.run.stop(),
            Command::Continue(training) => match self.go_on(training) {
                Ok(()) => self.is_paused = false,
                Err(reason) => self.report.send(TrainingEvent::Refused(reason)),
            },
            Command::Save(send) => {
                // Who asked waits for it.
                let _ = send.send(self.checkpoint());
                return;
            }
        }
        self.tell();
    }

    fn go_on(&mut self, training: TrainingSettings) -> Result<(), String> {
        continue_run(&mut self.run, training).map_err(|error| error.to_string())
    }

    fn checkpoint(&self) -> Result<MeasuredCheckpointFile, String> {
        let About {
            plan, samples_crc32, ..
        } = &self.about;
        MeasuredCheckpointFile::from_run(&self.run, plan, samples_crc32).map_err(|error| error.to_string())
    }

    /// Tells how the training stands.
    fn tell(&mut self) {
        let begun = Instant::now();
        let About {
            plan,
            inputs,
            targets,
            positions,
            ..
        } = &self.about;
        let file = match MeasuredNetworkFile::from_run(&self.run, plan.clone(), (inputs, targets)) {
            Ok(file) => file,
            Err(error) => return self.report.send(TrainingEvent::Refused(error.to_string())),
        };
        let phase = match self.run.stop_reason() {
            Some(reason) => Phase::Ended(reason),
            None if self.is_paused => Phase::Paused,
            None => Phase::Training,
        };
        let is_standing = phase != Phase::Training;
        let saved = is_standing.then(|| self.checkpoint());
        let answers = self.run.decouple_test();
        let tested = Tested::new(Arc::clone(self.run.test()), answers.clone(), positions.clone(), targets);
        let trained = Trained {
            name: String::new(),
            tested: Some(Arc::new(tested)),
            phase,
            epochs_run: furthest_epoch(&self.run),
            wall_time: self.run.wall_time(),
            flaw: self.run.flaw().map(|flaw| flaw.to_string()),
            remarks: if is_standing {
                let told = Determination::measure(self.run.test(), answers.view(), plan.division.by);
                let mut remarks = describe_standings(targets, &told);
                remarks.extend(describe_worse_than_ridge(&file));
                remarks
            } else {
                Vec::new()
            },
            checkpoint: saved.and_then(Result::ok).map(Arc::new),
            file: Arc::new(file),
        };
        let progressed = TrainingEvent::Progressed(Box::new(trained));
        if is_standing {
            self.report.send(progressed);
        } else {
            self.report.progress(progressed, |_, _| ());
        }
        // At most a fifth of the time.
        self.next_report = Instant::now() + REPORT_INTERVAL.max(4 * begun.elapsed());
    }
}

fn validate(
    plan: &Plan,
    settings: &RunSettings,
    ValidationChoice { folds, compares_random }: ValidationChoice,
    report: &Report<TrainingEvent>,
) -> Result<Option<Validated>, String> {
    let recording = plan.recording(Path::new(""), &mut |progress| watch(progress, report));
    let recording = recording.map_err(|error| in_window(&error))?;
    let (set, by) = (&recording.set, plan.division.by);
    let cross_validated = |by| -> Result<Option<CrossValidated>, String> {
        let dealt =
            Folds::by(set, folds, by, &mut settings.seed.rng(Stream::Split)).map_err(|error| error.to_string())?;
        let validated = CrossValidated::on_folds(settings, set, dealt, || report.is_cancelled());
        validated.map_err(|error| error.to_string())
    };
    let Some(validated) = cross_validated(by)? else {
        return Ok(None);
    };
    let table = validated.target_table(set);
    let comparison = if compares_random && by != SplitBy::Random {
        let compared = SplitComparison::complete(settings, set, folds, (by, &validated), &|| report.is_cancelled());
        let compared = compared.map_err(|error| error.to_string())?;
        if compared.is_none() {
            return Ok(None);
        }
        compared
    } else {
        None
    };
    let told = Determination::measure(set, validated.network.view(), by);
    let gains = NonlinearGain::of_validated(set, &validated, by);
    let mut remarks = Vec::new();
    for (target, channel) in recording.targets.iter().enumerate() {
        let name = &channel.name;
        remarks.push(match told[target] {
            Ok(told) => told.sentence(name),
            Err(cause) => format!("{name}: {cause}"),
        });
        remarks.extend(gains[target].and_then(|gain| gain.remark(name)));
        remarks.extend(comparison.as_ref().map(|comparison| comparison.sentence(target, name)));
    }
    Ok(Some(Validated {
        folds: format!("{folds} folds by {by}"),
        samples: set.samples(),
        table,
        targets: recording.targets,
        remarks,
    }))
}
