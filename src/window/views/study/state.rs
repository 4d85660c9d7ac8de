use std::{
    collections::HashMap,
    fmt,
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc::{Receiver, Sender, channel},
    },
    time::{Duration, Instant},
};

use decoupler_core::{evaluation::RunSettings, text::counted};
use decoupler_files::{
    export::format_duration,
    figure::TradeOffLimits,
    import::{Plan, Progress, Setup},
};

use eframe::egui::{Sense, Ui};

use super::{
    Form, Outcome, Report, StudyEvent, Task, Topic,
    report::Look,
    sweep_folder,
    view::{exports, form_ui, invited_ui, report_ui},
};
use crate::window::{
    job::{Background, Wake},
    shared::{
        Command, Effect, Holdings, Matter, Notice, Offers, Phase, Shared, Shown, SourceKind, Status, Tone, Unfinished,
        View, ViewKind,
    },
    widgets::{card_ui, scrolled_ui},
};

/// The Study view.
pub struct StudyView {
    pub(super) topic: Topic,
    pub(super) forms: HashMap<Topic, Form>,
    /// Limits for the recommended decoders.
    pub(super) limits: TradeOffLimits,
    /// What the Train view had when the form was last checked; `None` if the form has changed since.
    checked_on: Option<Basis>,
    /// The setup of the Train view.
    pub(super) train: Result<Setup, String>,
    /// The task of the form, or the reason why there is none.
    pub(super) task: Result<Task, String>,
    pub(super) studies: HashMap<Topic, Study>,
    /// The topic whose task is under way.
    pub(super) running: Option<Topic>,
    pub(super) look: Look,
    /// Folders of sweeps that were chosen.
    pub(super) folders: (Sender<PathBuf>, Receiver<PathBuf>),
    job: Background<StudyEvent>,
    /// True while nothing else computes, which would distort times.
    is_quiet: Arc<AtomicBool>,
}

/// Source and settings of the Train view.
type Basis = (SourceKind, RunSettings, Result<Arc<Plan>, String>);

/// Results of a topic.
pub struct Study {
    pub(super) outcome: Box<dyn Outcome>,
    /// The outcome, ready to be shown.
    pub(super) report: Report,
    /// Setup of the recording that is studied, if it is that of the Train view.
    pub(super) setup: Option<Setup>,
    /// How much work it is; empty for a sweep folder, which is no work of this program.
    pub(super) size: String,
    begun: Instant,
    /// Progress of reading a file.
    reading: Option<Progress>,
    /// Estimated time of the remaining trials, once there is one.
    pub(super) time_left: Option<Duration>,
    /// Time it took, once it has ended.
    took: Option<Duration>,
    /// True once a table of it has been saved.
    pub(super) is_saved: Arc<AtomicBool>,
}

impl fmt::Debug for StudyView {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StudyView")
            .field("topic", &self.topic)
            .finish_non_exhaustive()
    }
}

impl StudyView {
    /// Creates the view without results; `wake` is called when there are events.
    pub fn new(wake: Wake) -> Self {
        Self {
            topic: Topic::ALL[0],
            forms: Topic::ALL.map(|topic| (topic, Form::new(topic))).into(),
            limits: TradeOffLimits::default(),
            checked_on: None,
            train: Err(String::new()),
            task: Err(String::new()),
            studies: HashMap::new(),
            running: None,
            look: Look::default(),
            folders: channel(),
            job: Background::new("study", wake),
            is_quiet: Arc::new(AtomicBool::new(true)),
        }
    }

    /// Shows another topic.
    pub(super) fn choose(&mut self, topic: Topic) {
        (self.topic, self.look, self.checked_on) = (topic, Look::default(), None);
    }

    /// Replaces the form of the topic.
    pub(super) fn edit(&mut self, form: Form) {
        self.forms.insert(self.topic, form);
        self.checked_on = None;
    }

    /// Checks the form if it, or what the Train view has, has changed. Plans are not compared.
    pub(super) fn check(&mut self, shared: &Shared) {
        let settings = match shared.source {
            SourceKind::Array => shared.draft,
            SourceKind::Recording => shared.recording.settings,
        };
        let plan = shared.recording.plan.clone().map(|plan| plan.0);
        let basis: Basis = (shared.source, settings, plan);
        let plan = |basis: &Basis| basis.2.as_ref().map(Arc::as_ptr).map_err(String::clone);
        let is_same = |on: &Basis| (on.0, on.1, plan(on)) == (basis.0, basis.1, plan(&basis));
        if self.checked_on.as_ref().is_some_and(is_same) {
            return;
        }
        self.train = shared.setup();
        self.task = self.forms[&self.topic].task(&self.train, &self.is_quiet);
        if let Ok(Task { study, .. }) = &mut self.task {
            study.report = study.outcome.report(&self.limits);
        }
        self.checked_on = Some(basis);
    }

    /// Returns true while nothing is computed.
    pub(super) fn is_idle(&self) -> bool {
        self.running.is_none() || self.is_folder()
    }

    pub(super) fn can_begin(&self) -> bool {
        self.is_idle() && self.task.is_ok()
    }

    /// Begins the task of the form.
    pub(super) fn begin(&mut self, effects: &mut Vec<Effect>) {
        if !self.can_begin() {
            return;
        }
        // The form is checked again for the next one.
        self.checked_on = None;
        if let Ok(task) = std::mem::replace(&mut self.task, Err(String::new())) {
            effects.push(Effect::Settle(Matter::Study));
            self.start(task);
        }
    }

    fn start(&mut self, Task { study, run }: Task) {
        if self.is_folder() {
            self.cancel();
        }
        let begun = Instant::now();
        self.studies.insert(self.topic, Study { begun, ..study });
        self.running = Some(self.topic);
        self.refresh(self.topic);
        self.look.marked = None;
        self.job.start(
            move |reporter| reporter.unless_cancelled(run(reporter)),
            |ended| {
                let ended = ended.map_err(|error| format!("{error}; what has finished is kept"));
                StudyEvent::Ended(ended.and_then(|run| run))
            },
        );
    }

    /// Cancels the task under way; finished parts are kept. A sweep folder is closed.
    pub(super) fn cancel(&mut self) {
        if self.is_folder() {
            self.studies.remove(&Topic::Sweep);
        }
        self.job.abandon();
        self.end();
    }

    fn end(&mut self) {
        let Some(topic) = self.running.take() else { return };
        self.refresh(topic);
        let study = self.studies.get_mut(&topic);
        match study.filter(|study| study.outcome.parts().0 > 0) {
            Some(study) => study.took = Some(study.begun.elapsed()),
            None => drop(self.studies.remove(&topic)),
        }
    }

    /// Makes the report of the outcome as it is now.
    pub(super) fn refresh(&mut self, topic: Topic) {
        if let Some(study) = self.studies.get_mut(&topic) {
            study.report = study.outcome.report(&self.limits);
        }
    }

    /// Returns true while a measurement of times waits for other work.
    pub(super) fn is_waiting(&self) -> bool {
        self.running == Some(Topic::Speed) && !self.is_quiet.load(Ordering::Relaxed)
    }

    /// Returns the results of the task under way.
    pub(super) fn under_way(&self) -> Option<&Study> {
        self.studies.get(&self.running?)
    }

    /// Returns the results of the topic.
    pub(super) fn study(&self) -> Option<&Study> {
        self.studies.get(&self.topic)
    }

    /// Returns true while a sweep folder is shown.
    pub(super) fn is_folder(&self) -> bool {
        self.under_way().is_some_and(|study| study.size.is_empty())
    }

    /// Returns true if the results are of another recording or other settings than the Train view has now.
    pub(super) fn is_outdated(&self) -> bool {
        let setup = self.study().and_then(|study| study.setup.as_ref());
        setup.is_some_and(|setup| self.train.as_ref() != Ok(setup))
    }

    /// Returns the report to show: the results or, before there are any, the published figures.
    fn displayed(&self) -> Option<&Report> {
        let has_rows = |study: &&Study| study.report.pages.iter().any(|page| !page.rows.is_empty());
        let preview = self.task.as_ref().ok().map(|task| &task.study).filter(has_rows);
        let report = self.study().or(preview).map(|study| &study.report);
        report.filter(|report| !report.pages.is_empty())
    }

    /// Returns how far the task under way is, as a share and in words.
    pub(super) fn progress(&self) -> Option<(f32, String)> {
        let (topic, study) = (self.running?, self.under_way()?);
        if let Some(Progress { bytes, of }) = study.reading {
            let share = of.filter(|of| *of > 0).map_or(0.0, |of| bytes as f32 / of as f32);
            return Some((share, format!("Reading the files… {:.0} %", 100.0 * share)));
        }
        Some(match study.outcome.parts() {
            _ if self.is_folder() => (1.0, study.report.headline.clone()),
            (.., "") => (0.0, format!("{}…", topic.name())),
            (done, all, _) => {
                let share = done as f32 / all.max(1) as f32;
                (share, format!("{}: {}", topic.name(), study.standing()))
            }
        })
    }
}

impl View for StudyView {
    fn take_events(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        let trains = matches!(shared.phase, Phase::Preparing | Phase::Training | Phase::Calibrating);
        let is_alone = shared.working.iter().all(|view| *view == ViewKind::Study);
        self.is_quiet.store(is_alone && !trains, Ordering::Relaxed);
        self.check(shared);
        let mut changed = None;
        while let Some(event) = self.job.next_event() {
            changed = self.running;
            let Some(study) = changed.and_then(|topic| self.studies.get_mut(&topic)) else {
                break;
            };
            study.reading = None;
            match event {
                StudyEvent::Reading(progress) => study.reading = Some(progress),
                StudyEvent::Ended(ended) => {
                    let failure = ended.err().map(Notice::Failed);
                    effects.extend(failure.map(|failure| Effect::Notify(Matter::Study, failure)));
                    self.end();
                }
                event => {
                    if let StudyEvent::Trial(finished) = &event {
                        study.time_left = finished.time_left;
                    }
                    study.outcome.take(event);
                }
            }
        }
        if let Some(topic) = changed {
            self.refresh(topic);
        }
        if let Ok(path) = self.folders.1.try_recv()
            && self.is_idle()
        {
            self.choose(Topic::Sweep);
            self.start(sweep_folder::task(path));
        }
    }

    fn take_commands(&mut self, offers: &mut Offers<'_>, _shared: &Shared, effects: &mut Vec<Effect>) {
        if offers.offer(Command::Begin("Begin the study"), self.can_begin()) {
            self.begin(effects);
        }
        if offers.offer(Command::Cancel("Cancel the study"), self.running.is_some()) {
            self.cancel();
        }
    }

    fn holdings(&self, _shared: &Shared) -> Holdings {
        let unfinished = |topic: Topic| {
            let study = self.studies.get(&topic)?;
            let is_running = self.running == Some(topic);
            let (done, all, part) = study.outcome.parts();
            let is_unsaved = done == all && !part.is_empty() && !study.is_saved.load(Ordering::Relaxed);
            let standing = study.standing();
            let progress = match is_running {
                true if self.is_folder() => return None,
                true => standing,
                false => is_unsaved.then(|| format!("{standing} finished, not exported as a table"))?,
            };
            Some(Unfinished::new(topic.name(), progress))
        };
        Holdings {
            is_computing: !self.is_idle(),
            unfinished: Topic::ALL.into_iter().filter_map(unfinished).collect(),
            files: Vec::new(),
        }
    }

    fn shown<'a>(&'a self, shared: &'a Shared) -> Vec<Shown<'a>> {
        exports(self, shared.look.colours)
    }

    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        scrolled_ui(ui, "study form", |ui| form_ui(ui, self, effects));
        self.check(shared);
    }

    fn body_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) -> Option<Status> {
        let whole = ui.available_rect_before_wrap();
        let (mut look, mut is_wanted) = (self.look, false);
        match self.displayed() {
            Some(report) => is_wanted = report_ui(ui, self, report, &mut look, shared, effects),
            None => card_ui(ui, whole, |ui| is_wanted = invited_ui(ui, self)),
        }
        ui.allocate_rect(whole, Sense::hover());
        self.look = look;
        if is_wanted {
            self.begin(effects);
        }
        let ended = self.study().and_then(|study| Some((study, study.took?)));
        Some(match (self.progress(), ended) {
            (Some((_, text)), _) => Status::new(Tone::Busy, text),
            (None, Some((study, took))) => {
                let (done, all, _) = study.outcome.parts();
                let (tone, ended) = match done < all {
                    true => (Tone::Warning, "ended early"),
                    false => (Tone::Good, "finished"),
                };
                let (name, took) = (self.topic.name(), format_duration(took));
                Status::new(tone, format!("{name} {ended}: {} in {took}", study.standing()))
            }
            (None, None) => Status::new(Tone::Calm, format!("Ready: press {}", self.topic.words()[1])),
        })
    }
}

impl Study {
    pub(super) fn new(size: String, outcome: Box<dyn Outcome>) -> Self {
        Self {
            outcome,
            report: Report::default(),
            setup: None,
            size,
            begun: Instant::now(),
            reading: None,
            time_left: None,
            took: None,
            is_saved: Arc::default(),
        }
    }

    /// Returns how much is done: "2 of 800 trials".
    fn standing(&self) -> String {
        match self.outcome.parts() {
            (.., "") => self.size.clone(),
            (done, all, part) if done < all => format!("{done} of {}", counted(all, part)),
            (_, all, part) => counted(all, part),
        }
    }
}
