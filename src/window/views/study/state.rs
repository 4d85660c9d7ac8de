use std::{
    collections::HashMap,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use decoupler_core::{decoupling::DecoderKind, evaluation::RunSettings, text::counted};
use decoupler_files::{
    export::format_duration,
    figure::TradeOffLimits,
    import::{Plan, Progress, Setup},
};

use super::{Form, Outcome, Report, StudyEvent, Task, Topic, report::Look, sweep_folder::SweepFolder};
use crate::window::{
    job::{Background, Wake},
    shared::{DecoderSource, Effect, Matter, Notice, Phase, Shared, SourceKind, Unfinished},
};

/// The Study view.
#[derive(Debug)]
pub struct StudyView {
    pub(super) topic: Topic,
    pub(super) forms: HashMap<Topic, Form>,
    /// Limits for the recommended decoders.
    pub(super) limits: TradeOffLimits,
    /// The Train view when the form was last checked.
    pub(super) train: Option<Train>,
    /// The task of the form, or the reason why there is none.
    pub(super) checked: Result<Task, String>,
    /// The published figures of a table, shown before it is run.
    pub(super) preview: Option<Report>,
    pub(super) studies: HashMap<Topic, Study>,
    pub(super) running: Option<Running>,
    pub(super) look: Look,
    pub(super) folder: SweepFolder,
    job: Background<StudyEvent>,
    /// True while nothing else computes, which would distort times.
    is_quiet: Arc<AtomicBool>,
}

/// Results of a topic.
#[derive(Debug)]
pub struct Study {
    /// Results so far.
    pub outcome: Outcome,
    /// The same, ready to be shown.
    pub report: Report,
    /// Setup of the recording that was studied, if the topic is about one.
    setup: Option<Setup>,
    /// Time it took, once it has ended.
    took: Option<Duration>,
    /// True once a table of it has been saved.
    pub is_saved: Arc<AtomicBool>,
}

/// The task under way.
#[derive(Debug)]
pub struct Running {
    /// Its topic.
    pub topic: Topic,
    /// How much work it is.
    size: String,
    begun: Instant,
    /// Progress of reading a file.
    reading: Option<Progress>,
    /// Estimated time of the remaining trials, once there is one.
    pub time_left: Option<Duration>,
}

/// Source and settings of the Train view, as far as tasks depend on them.
#[derive(Debug)]
pub struct Train {
    source: SourceKind,
    settings: RunSettings,
    plan: Result<Arc<Plan>, String>,
    /// Setup of the next training, or what is missing.
    pub setup: Result<Setup, String>,
}

impl Train {
    fn settings_of(shared: &Shared) -> &RunSettings {
        match shared.source {
            SourceKind::Array => &shared.draft,
            SourceKind::Recording => &shared.recording.settings,
        }
    }

    fn of(shared: &Shared) -> Self {
        Self {
            source: shared.source,
            settings: *Self::settings_of(shared),
            plan: shared.recording.plan.clone(),
            setup: shared.setup(),
        }
    }

    /// Returns true if nothing has changed since; plans are not compared.
    fn is_of(&self, shared: &Shared) -> bool {
        let has_plan = match (&self.plan, &shared.recording.plan) {
            (Ok(one), Ok(other)) => Arc::ptr_eq(one, other),
            (one, other) => one.as_ref().err() == other.as_ref().err(),
        };
        has_plan && self.source == shared.source && self.settings == *Self::settings_of(shared)
    }
}

impl StudyView {
    /// Creates the view without results; `wake` is called when there are events.
    pub fn new(wake: Wake) -> Self {
        Self {
            topic: Topic::ALL[0],
            forms: Topic::ALL.map(|topic| (topic, Form::new(topic))).into(),
            limits: TradeOffLimits::default(),
            train: None,
            checked: Err(String::new()),
            preview: None,
            studies: HashMap::new(),
            running: None,
            look: Look::default(),
            folder: SweepFolder::new(&wake),
            job: Background::new("study", wake),
            is_quiet: Arc::new(AtomicBool::new(true)),
        }
    }

    /// Returns the task of the current form, or the reason why there is none.
    pub fn task(&self) -> &Result<Task, String> {
        &self.checked
    }

    /// Returns the results of the current topic.
    pub fn outcome(&self) -> Option<&Outcome> {
        self.studies.get(&self.topic).map(|study| &study.outcome)
    }

    /// Shows another topic.
    pub(super) fn choose(&mut self, topic: Topic, shared: &Shared) {
        (self.topic, self.look) = (topic, Look::default());
        self.check(shared);
    }

    /// Checks the form of the topic again, which or whose source has changed.
    pub(super) fn check(&mut self, shared: &Shared) {
        let train = Train::of(shared);
        self.checked = self.forms[&self.topic].task(&train.setup);
        self.preview = match &self.checked {
            Ok(task @ Task::Experiment(..)) => Some(Outcome::new(task).report(self.topic, &self.limits)),
            _ => None,
        };
        self.train = Some(train);
    }

    /// Shows the results of speed against accuracy with the present limits.
    pub(super) fn refresh(&mut self, topic: Topic) {
        if let Some(study) = self.studies.get_mut(&topic) {
            study.report = study.outcome.report(topic, &self.limits);
        }
    }

    pub(super) fn can_begin(&self) -> bool {
        self.running.is_none() && self.checked.is_ok()
    }

    /// Begins the task of the form.
    pub(super) fn begin(&mut self, effects: &mut Vec<Effect>) {
        let Some(task) = self.checked.clone().ok().filter(|_| self.running.is_none()) else {
            return;
        };
        effects.push(Effect::Settle(Matter::Study));
        if self.topic == Topic::Sweep {
            // The folder would be shown in place of the results.
            self.folder.close();
        }
        let outcome = Outcome::new(&task);
        let study = Study {
            report: outcome.report(self.topic, &self.limits),
            outcome,
            setup: match &task {
                Task::Readings(setup) | Task::Folds(setup, _) => Some(setup.clone()),
                _ => None,
            },
            took: None,
            is_saved: Arc::default(),
        };
        self.studies.insert(self.topic, study);
        self.running = Some(Running {
            topic: self.topic,
            size: task.size(),
            begun: Instant::now(),
            reading: None,
            time_left: None,
        });
        self.look.marked = None;
        let is_quiet = Arc::clone(&self.is_quiet);
        self.job.start(
            move |reporter| reporter.unless_cancelled(task.run(&is_quiet, reporter)),
            |ended| {
                let ended = ended.map_err(|error| format!("{error}; what has finished is kept"));
                StudyEvent::Ended(ended.and_then(|run| run))
            },
        );
    }

    /// Cancels the task under way; finished parts are kept.
    pub(super) fn cancel(&mut self) {
        self.job.abandon();
        self.end();
    }

    fn end(&mut self) {
        let Some(running) = self.running.take() else { return };
        self.refresh(running.topic);
        match self.studies.get_mut(&running.topic) {
            Some(study) if study.outcome.has_results() => study.took = Some(running.begun.elapsed()),
            _ => drop(self.studies.remove(&running.topic)),
        }
    }

    /// Takes the events of the job, and follows what the Train view has.
    pub(super) fn follow(&mut self, shared: &Shared, others_compute: bool, effects: &mut Vec<Effect>) {
        let trains = matches!(shared.phase, Phase::Preparing | Phase::Training | Phase::Calibrating);
        self.is_quiet.store(!trains && !others_compute, Ordering::Relaxed);
        if self.train.as_ref().is_none_or(|train| !train.is_of(shared)) {
            self.check(shared);
        }
        let mut has_changed = None;
        while let Some(event) = self.job.next_event() {
            let Some(running) = &mut self.running else { break };
            running.reading = None;
            match &event {
                StudyEvent::Reading(progress) => running.reading = Some(*progress),
                StudyEvent::Trial(finished) => running.time_left = finished.time_left,
                _ => {}
            }
            has_changed = Some(running.topic);
            if let StudyEvent::Ended(ended) = event {
                effects.extend(ended.err().map(|reason| Effect::Notify(Matter::Study, Notice::Failed(reason))));
                self.end();
            } else if let Some(study) = self.studies.get_mut(&running.topic) {
                study.outcome.take(event);
            }
        }
        if let Some(topic) = has_changed {
            self.refresh(topic);
        }
        self.folder.take_events();
    }

    /// Returns true while a measurement of times waits for other work.
    pub(super) fn is_waiting(&self) -> bool {
        let measures = self.running.as_ref().is_some_and(|running| running.topic == Topic::Speed);
        measures && !self.is_quiet.load(Ordering::Relaxed)
    }

    /// Returns true if the results shown are of another recording or other settings than the present ones.
    pub(super) fn is_outdated(&self) -> bool {
        let of = self.studies.get(&self.topic).and_then(|study| study.setup.as_ref());
        let now = self.train.as_ref().and_then(|train| train.setup.as_ref().ok());
        of.zip(now).is_some_and(|(of, now)| of != now)
    }

    /// Returns the report to show: a sweep folder, the results or, before there are any, the published figures.
    pub(super) fn shown(&self) -> Option<&Report> {
        let folder = self.folder.shown.as_ref().filter(|_| self.topic == Topic::Sweep);
        let study = self.studies.get(&self.topic).map(|study| &study.report);
        folder.or(study).or(self.preview.as_ref()).filter(|report| !report.pages.is_empty())
    }

    /// Opens an item of the displayed page in the Train view.
    pub(super) fn open(&self, item: usize, shared: &Shared, effects: &mut Vec<Effect>) {
        if shared.phase.is_busy() {
            return;
        }
        let opened = match self.outcome() {
            Some(Outcome::Experiment(outcome)) => outcome.open(item),
            Some(Outcome::Speed(outcome)) => {
                let setup = outcome.setup_of(self.look.page, item).map(Box::new);
                Vec::from_iter(setup.map(Effect::TakeSetup))
            }
            _ => return,
        };
        effects.extend(opened);
        effects.push(Effect::ShowTraining);
    }

    /// Returns the decoder of the marked point, and what it is exported from.
    pub(super) fn marked_decoder(&self) -> Option<(DecoderKind, DecoderSource)> {
        match self.outcome()? {
            Outcome::Speed(outcome) => outcome.decoder_of(self.look.page, self.look.marked?),
            _ => None,
        }
    }

    /// Returns how far the task under way is, as a share and in words.
    pub(super) fn progress(&self) -> Option<(f32, String)> {
        let running = self.running.as_ref()?;
        if let Some(Progress { bytes, of }) = running.reading {
            let share = of.filter(|of| *of > 0).map_or(0.0, |of| bytes as f32 / of as f32);
            return Some((share, format!("Reading the files… {:.0} %", 100.0 * share)));
        }
        let name = running.topic.words().name;
        let parts = self.studies.get(&running.topic).and_then(|study| study.outcome.parts());
        Some(match parts {
            Some((done, all, part)) => {
                let share = done as f32 / all.max(1) as f32;
                (share, format!("{name}: {done} of {}", counted(all, part)))
            }
            None => (0.0, format!("{name}…")),
        })
    }

    /// Returns how the results of the topic ended, and whether everything planned was done.
    pub(super) fn ending(&self) -> Option<(bool, String)> {
        let study = self.studies.get(&self.topic)?;
        let took = format_duration(study.took?);
        let name = self.topic.words().name;
        Some(match study.outcome.parts() {
            Some((done, all, part)) if done < all => {
                (false, format!("{name} ended early: {done} of {} in {took}", counted(all, part)))
            }
            Some((_, all, part)) => (true, format!("{name} finished: {} in {took}", counted(all, part))),
            None => (true, format!("{name} finished in {took}")),
        })
    }

    /// Returns the work that closing the window would cut short or discard.
    pub(super) fn to_be_discarded(&self) -> Vec<Unfinished> {
        let unfinished = |topic: Topic| {
            let running = self.running.as_ref().filter(|running| running.topic == topic);
            let study = self.studies.get(&topic)?;
            let progress = match (running, study.outcome.parts()) {
                (Some(running), None) => running.size.clone(),
                (Some(_), Some((done, all, part))) => format!("{done} of {} finished", counted(all, part)),
                (None, Some((done, all, part))) if done == all && !study.is_saved.load(Ordering::Relaxed) => {
                    format!("{} finished, not exported as a table", counted(all, part))
                }
                _ => return None,
            };
            Some(Unfinished::discarded(topic.words().name, progress))
        };
        Topic::ALL.into_iter().filter_map(unfinished).collect()
    }
}
