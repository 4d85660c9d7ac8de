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
    import::{Progress, Setup},
};

use eframe::egui::{Sense, Ui};

use super::{
    Form, Outcome, Report, StudyEvent, Task, Topic,
    report::Look,
    sweep_folder,
    view::{BEGIN, CANCEL},
};
use crate::window::{
    job::{Background, Jobs},
    shared::{
        Effect, Holdings, Matter, Notice, Offers, RecordingDraft, Shared, Shown, SourceKind, Status, Tone, Unfinished,
        View,
    },
    widgets::{card_ui, placeholder_ui, scrolled_ui},
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
}

/// Source and settings of the Train view.
type Basis = (SourceKind, RunSettings, RecordingDraft);

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
    /// Time that the work took, once it has ended.
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
    /// Creates the view without results.
    pub fn new(jobs: &Jobs) -> Self {
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
            job: Background::new("study", jobs),
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

    /// Checks the form if it, or what the Train view has, has changed.
    pub(super) fn check(&mut self, shared: &Shared) {
        let basis: Basis = (shared.source, shared.draft, shared.recording.clone());
        if self.checked_on.as_ref() == Some(&basis) {
            return;
        }
        self.train = shared.setup();
        let train = self.train.as_ref().ok().filter(|setup| setup.plan().is_some());
        if let Some(source) = train.map(Setup::source_name) {
            // Findings about another recording are not shown.
            let is_its = |of: &Setup| of.source_name() == source;
            self.studies
                .retain(|_, study| study.took.is_none() || study.setup.as_ref().is_none_or(is_its));
        }
        self.task = self.forms[&self.topic].task(&self.train);
        if let Ok(Task { study, .. }) = &mut self.task {
            study.report = study.outcome.report(&self.limits);
        }
        self.checked_on = Some(basis);
    }

    /// Returns the reason why the task of the form cannot begin now.
    fn obstacle(&self) -> Option<String> {
        let running = self.running.map(|topic| format!("{} is under way.", topic.name()));
        running.or_else(|| self.task.as_ref().err().cloned())
    }

    /// Begins the task of the form.
    fn begin(&mut self, effects: &mut Vec<Effect>) {
        // The form is checked again for the next one.
        self.checked_on = None;
        if let Ok(task) = std::mem::replace(&mut self.task, Err(String::new())) {
            effects.push(Effect::Settle(Matter::Study));
            self.start(task);
        }
    }

    fn start(&mut self, Task { study, run }: Task) {
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

    /// Cancels the task under way; finished parts are kept.
    fn cancel(&mut self) {
        self.job.abandon();
        self.end();
    }

    fn end(&mut self) {
        let Some(topic) = self.running.take() else { return };
        self.refresh(topic);
        let study = self.studies.get_mut(&topic);
        match study.filter(|study| study.outcome.parts().0 > 0) {
            Some(study) => study.took = (!study.size.is_empty()).then(|| study.begun.elapsed()),
            None => drop(self.studies.remove(&topic)),
        }
    }

    /// Makes the report of the outcome as it is now.
    pub(super) fn refresh(&mut self, topic: Topic) {
        if let Some(study) = self.studies.get_mut(&topic) {
            study.report = study.outcome.report(&self.limits);
        }
    }

    /// Returns the results of the topic.
    pub(super) fn study(&self) -> Option<&Study> {
        self.studies.get(&self.topic)
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

    /// Returns the progress of the task under way, or how the study of the topic has ended.
    fn status(&self) -> Status {
        let under_way = |topic| Some((topic, self.studies.get(&topic)?));
        let Some((topic, study)) = self.running.and_then(under_way) else {
            let Some((study, took)) = self.study().and_then(|study| Some((study, study.took?))) else {
                let text = if self.obstacle().is_none() {
                    "Ready: press Run"
                } else {
                    "Not ready"
                };
                return Status::new(Tone::Calm, text);
            };
            let (done, all, _) = study.outcome.parts();
            let (tone, ended) = match done < all {
                true => (Tone::Warning, "ended early"),
                false => (Tone::Good, "finished"),
            };
            let (name, took) = (self.topic.name(), format_duration(took));
            return Status::new(tone, format!("{name} {ended}: {} in {took}", study.standing()));
        };
        if let (Topic::Speed, Some(other)) = (topic, self.job.distorted_by()) {
            let text = format!("Waiting: {other} is under way and would distort the times.");
            return Status::new(Tone::Warning, text);
        }
        let (name, parts) = (topic.name(), study.outcome.parts());
        let (text, done) = match (study.reading, parts) {
            (Some(Progress { bytes, of }), _) => ("Reading the files…".to_owned(), of.map(|of| (bytes, of))),
            (None, (.., "")) => (format!("{name}…"), None),
            (None, (done, all, _)) => (format!("{name}: {}", study.standing()), Some((done as u64, all as u64))),
        };
        let mut status = Status::new(Tone::Busy, text);
        status.progress = done.map(|(done, all)| ("Study", done as f32 / all.max(1) as f32));
        if let Some(left) = study.time_left {
            status = status.with_note(format!("about {} left", format_duration(left)));
        }
        status
    }
}

impl View for StudyView {
    fn take_events(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
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
            && self.running.is_none()
        {
            self.choose(Topic::Sweep);
            self.start(sweep_folder::task(path));
        }
    }

    fn take_commands(&mut self, offers: &mut Offers<'_>, _shared: &Shared, effects: &mut Vec<Effect>) {
        if offers.offer_unless(BEGIN, self.obstacle()) {
            self.begin(effects);
        }
        let is_idle = self.running.is_none();
        if offers.offer_unless(CANCEL, is_idle.then_some("Nothing is under way.")) {
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
                true => standing,
                false => is_unsaved.then(|| format!("{standing} finished, not exported as a table"))?,
            };
            // Watching a folder is no work.
            (!progress.is_empty()).then(|| Unfinished::new("Study", topic.name(), progress))
        };
        Holdings {
            unfinished: Topic::ALL.into_iter().filter_map(unfinished).collect(),
            files: Vec::new(),
        }
    }

    fn shown<'a>(&'a self, shared: &'a Shared) -> Vec<Shown<'a>> {
        self.exports(shared.look.colours)
    }

    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        scrolled_ui(ui, "study form", |ui| self.fields_ui(ui, shared, effects));
    }

    fn body_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) -> Option<Status> {
        self.check(shared);
        let whole = ui.available_rect_before_wrap();
        let mut look = self.look;
        match (self.displayed(), &self.task) {
            (Some(report), _) => self.page_ui(ui, report, &mut look, shared, effects),
            (None, Err(problem)) if self.running.is_none() => card_ui(ui, whole, |ui| placeholder_ui(ui, problem)),
            _ => card_ui(ui, whole, |ui| placeholder_ui(ui, "The results appear here.")),
        }
        ui.allocate_rect(whole, Sense::hover());
        self.look = look;
        Some(self.status())
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
