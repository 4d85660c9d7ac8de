use std::{
    fs::{self, File},
    io,
    path::{Path, PathBuf},
    sync::{
        Arc,
        mpsc::{Receiver, Sender, channel},
    },
    time::Instant,
};

use decoupler_core::{problem::Channel, scene::Noise, text::counted};
use decoupler_files::{
    export::{Cell, NetworkFile, Table, TableColumn, atomic_write, is_same},
    live::{Input, LiveArray, Recorded, RecordingFile, Replay, ReplayState, Session, SessionPlan, SourcePlan, Unit},
};
use eframe::egui::Ui;

use super::{
    cards::{self, surface_figure},
    engine::{Answered, LiveEvent, Request, Snapshot, run},
    form::{Picked, SourceForm, SourceKind, form_ui},
};
use crate::window::{
    job::{Background, Jobs},
    plotting::{MAX_TRACKS, SeriesView},
    shared::{
        Command, Effect, FileInUse, FileTask, FileWords, Holdings, Matter, Notice, Offers, Shared, Shown, Status, Tone,
        View, command_button_ui,
    },
    widgets::{ghost_button, primary_button},
};

/// The Live view.
#[derive(Debug)]
pub struct LiveView {
    /// The latest state of the session, which stays on the screen after its end.
    pub shown: Snapshot,
    /// Decoding under way. Its thread ends once this is dropped.
    pub running: Option<Running>,
    /// The network that decodes; `None` for the newest run.
    pub(super) picked: Option<Picked>,
    /// Text by which runs are searched.
    pub(super) search: String,
    pub(super) source: SourceForm,
    /// Part of the values over time that is in view.
    pub(super) series: SeriesView,
    /// The node under the pointer, marked on all surfaces.
    pub(super) node: Option<usize>,
    /// Path of the file that the user is asked for.
    pub(super) chosen: Option<Receiver<PathBuf>>,
    /// True if the window has received a snapshot and not yet reported to the thread that it was drawn.
    is_to_be_drawn: bool,
    /// Reads a network, and the path of the recording that it shall decode.
    loading: Background<Result<(Picked, Option<PathBuf>), String>>,
    job: Background<LiveEvent>,
}

/// Decoding under way.
#[derive(Debug)]
pub struct Running {
    /// Name of the network.
    pub network: String,
    /// Source of the frames.
    pub source: SourcePlan,
    requests: Sender<Request>,
}

impl Running {
    /// Returns the source in a few words.
    pub fn source_text(&self) -> String {
        match &self.source {
            SourcePlan::Simulated(_) => "the simulated source".to_owned(),
            SourcePlan::Replay(path) => format!("'{}'", path.file_name().unwrap_or_default().display()),
            SourcePlan::Stream(source) => source.to_string(),
        }
    }
}

impl LiveView {
    /// Creates the view without frames.
    pub fn new(jobs: &Jobs) -> Self {
        Self {
            shown: Snapshot::default(),
            running: None,
            picked: None,
            search: String::new(),
            source: SourceForm::default(),
            series: SeriesView::default(),
            node: None,
            chosen: None,
            is_to_be_drawn: false,
            loading: Background::prompt("network file", jobs),
            job: Background::prompt("live decoding", jobs),
        }
    }

    /// Returns the network that decodes, and its name; `None` if there is none.
    pub(super) fn network<'a>(&'a self, shared: &'a Shared) -> Option<(&'a str, &'a Arc<NetworkFile>)> {
        let picked = self.picked.as_ref().map(|picked| (&*picked.name, &picked.file));
        picked.or_else(|| shared.runs.newest().map(|run| (run.name, run.file)))
    }

    /// Decodes with the run of this number once it is read, or with the newest.
    pub(super) fn pick(&mut self, run: Option<u64>, shared: &Shared) {
        let Some(run) = run.and_then(|id| shared.runs.run(id)).cloned() else {
            self.picked = None;
            return self.restart(shared);
        };
        let folder = shared.runs.path.clone().unwrap_or_default();
        self.load(move || {
            let file = run.load(&folder).map_err(|error| error.to_string())?;
            let (run, name) = (Some(run.id), run.name);
            Ok((Picked { run, name, file }, None))
        });
    }

    /// Returns the plan for the current settings.
    ///
    /// # Errors
    /// If there is no network or a setting is missing, with what to do.
    pub(super) fn plan(&self, shared: &Shared) -> Result<SessionPlan, String> {
        let network = self.network(shared);
        let (_, network) = network.ok_or("Train a network, or open a network file.")?;
        let simulation = network.problem.sensor.as_ref();
        let noise = simulation.map(|simulation| Noise {
            relative: self.source.noise(simulation),
            ..simulation.scene.noise.in_test()
        });
        Ok(SessionPlan {
            network: Arc::clone(network),
            source: self.source.plan()?,
            noise: noise.unwrap_or_default(),
            zero: self.shown.zero.clone(),
            unit: Unit::Frames,
        })
    }

    /// Returns true if the network is that of an array, whose sensor model simulates, re-zeroes and finds faults.
    pub(super) fn has_sensor(&self, shared: &Shared) -> bool {
        let network = self.network(shared);
        network.is_none_or(|(_, file)| file.problem.sensor.is_some())
    }

    /// Returns the name of what is decoded at a time.
    pub(super) fn unit(&self, shared: &Shared) -> &'static str {
        if self.has_sensor(shared) { "frame" } else { "sample" }
    }

    /// Returns true while frames are recorded.
    pub(super) fn is_recording(&self) -> bool {
        self.running.is_some() && self.shown.is_recording
    }

    /// Begins to decode.
    pub fn start(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        effects.push(Effect::Settle(Matter::Live));
        self.begin(shared, None);
    }

    /// Restarts with the network that is chosen now if a source is running, from the current position of a replay.
    pub(super) fn restart(&mut self, shared: &Shared) {
        if self.running.is_some() {
            self.begin(shared, self.shown.replay);
        }
    }

    /// Removes the answers from the screen.
    fn clear(&mut self) {
        let before = std::mem::take(&mut self.shown);
        self.shown = Snapshot {
            recorded: before.recorded,
            zero: before.zero,
            ..Snapshot::default()
        };
    }

    fn begin(&mut self, shared: &Shared, replay: Option<ReplayState>) {
        let (Some((name, _)), Ok(plan)) = (self.network(shared), self.plan(shared)) else {
            return;
        };
        let network = name.to_owned();
        // A replay continues without a gap on the screen.
        let answer = self.shown.answer.take().filter(|_| replay.is_some());
        self.clear();
        (self.shown.answer, self.shown.replay) = (answer, replay);
        (self.node, self.is_to_be_drawn) = (None, false);
        let (requests, incoming) = channel();
        self.running = Some(Running {
            network,
            source: plan.source.clone(),
            requests,
        });
        self.steer();
        if let Some(replay) = replay {
            self.control(move |control, now| {
                control.seek(replay.at_s, now);
                control.play(replay.is_playing, now);
            });
        }
        let shown = self.shown.clone();
        self.job.start(
            move |report| run(plan, shown, &incoming, report),
            |ended| LiveEvent::Ended(ended.unwrap_or_else(|error| Err(error.to_string()))),
        );
    }

    fn ask(&self, request: Request) {
        if let Some(running) = &self.running {
            // A thread that has just ended ignores requests.
            let _ = running.requests.send(request);
        }
    }

    /// Changes the session on its thread, if it is running; the reason of a failure is shown.
    pub(super) fn change(&self, change: impl FnOnce(&mut Session) -> Result<(), String> + Send + 'static) {
        self.ask(Request::Change(Box::new(change)));
    }

    /// Changes the replay, if there is one.
    pub(super) fn control(&self, change: impl FnOnce(&mut Replay, Instant) + Send + 'static) {
        self.change(|session| {
            if let Input::Replay(replay) = &mut session.input {
                change(replay, Instant::now());
            }
            Ok(())
        });
    }

    /// Applies the speed to the replay.
    pub(super) fn steer(&self) {
        let speed = self.source.speed;
        self.control(move |control, now| control.set_speed(speed, now));
    }

    /// Takes the latest frames as the unloaded state.
    pub(super) fn re_zero(&self) {
        self.change(|session| {
            let taken = session.array.as_mut().map(LiveArray::take_zero).transpose();
            taken.map(drop).map_err(|error| format!("Not re-zeroed: {error}."))
        });
    }

    /// Stops dividing readings by gains.
    pub(super) fn clear_zero(&mut self) {
        self.shown.zero = None;
        self.change(|session| {
            session.array.iter_mut().for_each(|array| array.zero = None);
            Ok(())
        });
    }

    /// Begins a recording, or ends it.
    pub(super) fn record(&self, shared: &Shared) {
        let (folder, begins) = (folder(shared).join("recordings"), !self.is_recording());
        self.change(move |session| {
            let array = session.array.as_ref().filter(|_| begins);
            let file = array.map(|array| RecordingFile::create(&folder, &array.rows, array.sensor.scale.columns()));
            session.recording = file.transpose()?;
            Ok(())
        });
    }

    /// Plays a file.
    pub(super) fn replay(&mut self, path: &Path, shared: &Shared, effects: &mut Vec<Effect>) {
        self.source.kind = SourceKind::Replay;
        self.source.path = path.display().to_string();
        self.start(shared, effects);
    }

    /// Reads a network in the background.
    pub(super) fn load(&mut self, read: impl FnOnce() -> Result<(Picked, Option<PathBuf>), String> + Send + 'static) {
        self.loading.start(
            move |_| read(),
            |read| read.unwrap_or_else(|error| Err(error.to_string())),
        );
    }

    /// Writes the sample recording and its network to files, to be played as soon as they are ready.
    pub(super) fn play_sample(&mut self, shared: &Shared) {
        let folder = folder(shared).join("samples");
        self.load(move || write_sample(&folder));
    }

    /// Returns the state of the stream, its network and source, and its rate.
    fn status(&self, shared: &Shared) -> Status {
        let (counts, replay) = (&self.shown.counts, &self.shown.replay);
        let unit = self.unit(shared);
        let Some(running) = &self.running else {
            let text = match (self.plan(shared), counts.decoded) {
                (Err(obstacle), _) => obstacle,
                (Ok(_), 0) => "Ready: press Start".to_owned(),
                (Ok(_), decoded) => format!("Stopped after {}", counted(decoded, unit)),
            };
            return Status::new(Tone::Calm, text);
        };
        let fault = self.shown.answer.as_ref().map(|answer| &answer.fault);
        let mut status = match (fault, replay) {
            _ if self.shown.lost.is_some() => Status::new(Tone::Warning, "Connection lost: trying again"),
            (None, _) => Status::new(Tone::Busy, format!("Waiting for the first {unit}")),
            _ if counts.is_waiting => Status::new(Tone::Warning, format!("No {unit} for two seconds")),
            (Some(Some((fault, _))), _) => Status::new(Tone::Warning, format!("Fault: {fault}")),
            (_, Some(replay)) if !replay.is_playing && replay.at_s >= replay.length_s => {
                Status::new(Tone::Calm, "Replay ended: press Play to see it again")
            }
            (_, Some(replay)) if !replay.is_playing => Status::new(Tone::Calm, "Replay paused"),
            (_, Some(_)) => Status::new(Tone::Good, "Replaying"),
            (_, None) => Status::new(Tone::Good, "Live"),
        };
        status = status.with_note(format!("{}, {}", running.network, running.source_text()));
        if let Some(reason) = &self.shown.lost {
            status = status.with_note(reason);
        }
        if counts.decoded > 0 {
            status = status.with_note(format!("{:.0} {unit}s per second", counts.frames_per_second));
        }
        if let Some(recorded) = self.shown.recorded.as_ref().filter(|_| self.is_recording()) {
            let (frames, seconds) = (counted(recorded.frames, "frame"), recorded.seconds);
            status = status.with_note(format!("● Recording: {frames}, {seconds:.1} s"));
        }
        status
    }
}

impl View for LiveView {
    fn take_events(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        let notify = |notice| Effect::Notify(Matter::Live, notice);
        while let Some(event) = self.job.next_event() {
            match event {
                LiveEvent::Shown(shown) => (self.shown, self.is_to_be_drawn) = (*shown, true),
                LiveEvent::Failed(reason) => effects.push(notify(Notice::Failed(reason))),
                LiveEvent::Ended(end) => {
                    if self.running.take().is_none() {
                        continue;
                    }
                    effects.push(notify(match end {
                        Err(reason) => Notice::Failed(reason),
                        Ok(()) => Notice::Done("The source has ended.".to_owned()),
                    }));
                }
            }
        }
        if let Some(Ok(path)) = self.chosen.as_ref().map(Receiver::try_recv) {
            self.source.path = path.display().to_string();
            self.chosen = None;
        }
        match self.loading.next_event() {
            Some(Ok((picked, recording))) => {
                self.picked = Some(picked);
                match recording {
                    Some(recording) => self.replay(&recording, shared, effects),
                    None => self.restart(shared),
                }
            }
            Some(Err(reason)) => effects.push(notify(Notice::Failed(reason))),
            None => {}
        }
        if self.source.kind == SourceKind::Simulated && !self.has_sensor(shared) {
            // A network of a recording has no model to simulate.
            self.source.kind = SourceKind::Replay;
        }
        let network = self.network(shared).map(|(_, file)| file);
        let decoded_by = self.shown.answer.as_ref().map(|answer| &answer.network);
        if let (None, Some(network), Some(decoded_by)) = (&self.running, network, decoded_by)
            && !Arc::ptr_eq(network, decoded_by)
        {
            self.clear();
        }
    }

    fn holdings(&self, _shared: &Shared) -> Holdings {
        let replayed = self.running.as_ref().and_then(|running| match &running.source {
            SourcePlan::Replay(path) => Some(FileInUse::Recording(path.clone())),
            _ => None,
        });
        let recorded = self.shown.recorded.as_ref().filter(|_| self.is_recording());
        let recorded = recorded.map(|recorded| FileInUse::Recorded(recorded.path.clone()));
        Holdings {
            files: replayed.into_iter().chain(recorded).collect(),
            ..Holdings::default()
        }
    }

    fn take_commands(&mut self, offers: &mut Offers<'_>, shared: &Shared, effects: &mut Vec<Effect>) {
        for command in [STOP, START, Command::Record, Command::ReZero, Command::PlayReplay] {
            if !offers.offer_unless(command.clone(), obstacle(&command, self, shared)) {
                continue;
            }
            match command {
                // The thread ends once the sender of its requests is dropped; the last frame stays on the screen.
                Command::Cancel(_) => self.running = None,
                Command::Begin(_) => self.start(shared, effects),
                Command::Record => self.record(shared),
                Command::ReZero => self.re_zero(),
                _ => {
                    let plays = self.shown.replay.is_some_and(|replay| !replay.is_playing);
                    self.control(move |control, now| control.play(plays, now));
                }
            }
        }
    }

    fn tools_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        if self.has_sensor(shared) {
            command_button_ui(ui, shared, Command::ReZero, ghost_button("Re-zero"), None, effects);
            let text = if self.is_recording() {
                "■ End recording"
            } else {
                "● Record"
            };
            let record = ghost_button(text).selected(self.is_recording());
            command_button_ui(ui, shared, Command::Record, record, None, effects);
        }
        match self.running {
            Some(_) => command_button_ui(ui, shared, STOP, ghost_button("■ Stop"), None, effects),
            None => command_button_ui(ui, shared, START, primary_button("▶ Start"), None, effects),
        }
    }

    fn shown<'a>(&'a self, shared: &'a Shared) -> Vec<Shown<'a>> {
        let recorded = self.shown.recorded.as_ref().map(save_recording);
        let recorded = recorded.ok_or_else(|| "Nothing is recorded: press Record while a source runs.".to_owned());
        let mut shown = Vec::from_iter(self.has_sensor(shared).then(|| Shown::file("Recording", recorded)));
        let Some(answer) = &self.shown.answer else { return shown };
        if !answer.surfaces.is_empty() {
            let surface = Ok(|| surface_figure(answer, None, shared.look).into());
            shown.push(Shown::figure("Surface", "live-surface".to_owned(), surface));
        }
        if let Some(readings) = &answer.readings {
            let readings = Ok(|| readings.clone().coloured(shared.look.colours).into());
            shown.push(Shown::figure("Readings", "live-readings".to_owned(), readings));
        }
        if let Some(series) = answer.series() {
            let figure = move || SeriesView::default().figure(&series, MAX_TRACKS, None).into();
            let (name, stem) = ("Decoded values", "live-values".to_owned());
            shown.push(Shown::figure(name, stem.clone(), Ok(figure)));
            shown.push(Shown::table(name, stem, Ok(|| values_table(answer))));
        }
        shown
    }

    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        form_ui(ui, self, shared, effects);
    }

    fn body_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) -> Option<Status> {
        cards::body_ui(ui, self, shared, effects);
        // The thread may send the next snapshot.
        if std::mem::take(&mut self.is_to_be_drawn) {
            self.ask(Request::Drawn);
        }
        Some(self.status(shared))
    }
}

/// Ends decoding.
const STOP: Command = Command::Cancel("Stop live decoding");

/// Begins decoding.
const START: Command = Command::Begin("Start live decoding");

/// Returns the reason why a command is not available now: whether a source runs, and which, only this view knows.
fn obstacle(command: &Command, view: &LiveView, shared: &Shared) -> Option<String> {
    let (is_running, is_replay) = (view.running.is_some(), view.shown.replay.is_some());
    let reason = match command {
        Command::Begin(_) if is_running => "Frames are being decoded.",
        Command::Begin(_) => return view.plan(shared).err(),
        _ if !is_running => "Start a source first.",
        Command::PlayReplay if !is_replay => "There is no replay.",
        Command::Record | Command::ReZero if !view.has_sensor(shared) => "This needs the sensor model of an array.",
        Command::Record if is_replay => "A replay cannot be recorded.",
        _ => return None,
    };
    Some(reason.to_owned())
}

fn values_table(answer: &Answered) -> Table {
    let names = answer.network.problem.targets.iter().map(Channel::title);
    let columns = std::iter::once("time_s".to_owned()).chain(names);
    let row = |(time_s, values): &(f64, Arc<[f64]>)| {
        let values = std::iter::once(time_s).chain(values.iter());
        values.map(|&value| Cell::from(value)).collect()
    };
    Table {
        columns: columns.map(TableColumn::field).collect(),
        rows: answer.history.all().iter().map(row).collect(),
    }
}

/// Saves a copy of a recording.
fn save_recording(recorded: &Recorded) -> FileTask {
    let words = FileWords {
        kind: "recording",
        description: "Every frame with its time, as CSV: a line for each row-wire. It can be replayed here, and the terminal \
                      command decode reads it.",
        extensions: &["csv"],
    };
    let from = recorded.path.clone();
    FileTask::save(words, "recording", move |path| match is_same(path, &from) {
        true => Ok(()),
        false => atomic_write(path, |file| io::copy(&mut File::open(&from)?, file).map(drop)),
    })
}

/// Returns the folder for files of this view: next to the runs, or a temporary one.
fn folder(shared: &Shared) -> PathBuf {
    let parent = shared.runs.path.as_ref().and_then(|runs| runs.parent());
    parent.map_or_else(std::env::temp_dir, PathBuf::from)
}

/// Writes the sample recording to a file, and returns the network that decodes it.
fn write_sample(folder: &Path) -> Result<(Picked, Option<PathBuf>), String> {
    let failed = |error: &dyn std::fmt::Display| format!("the sample cannot be written: {error}");
    let text = include_str!("../../../../assets/samples/network.json");
    let file = NetworkFile::from_text(text).map_err(|error| error.to_string())?;
    let text = include_str!("../../../../assets/samples/recording.csv");
    let path = folder.join("sample recording.csv");
    fs::create_dir_all(folder).map_err(|error| failed(&error))?;
    atomic_write(&path, |writer| writer.write_all(text.as_bytes())).map_err(|error| failed(&error))?;
    let (run, name, file) = (None, "sample network.json".to_owned(), Arc::new(file));
    Ok((Picked { run, name, file }, Some(path)))
}
