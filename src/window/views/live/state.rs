use std::{
    fs,
    path::{Path, PathBuf},
    sync::{
        Arc,
        mpsc::{Sender, channel},
    },
    time::Instant,
};

use decoupler_core::{dataset::Simulation, live::ZeroGains, scene::Noise};
use decoupler_files::{
    export::{NetworkFile, atomic_write},
    live::{Input, Recorded, RecordingFile, Replay, ReplayState, Session, SessionPlan, SourcePlan, Unit},
};

use super::{
    cards::{DropScale, FaultForm},
    engine::{Command, LiveEvent, LiveShown, run},
    source_form::{NetworkChoice, SourceForm, SourceKind},
};
use crate::window::{
    job::{Background, Wake},
    shared::{Effect, Matter, Notice, Shared},
};

/// Reason why a network of a recording has no simulated source.
const NOTHING_TO_SIMULATE: &str = "A network of a recording decodes a file, a serial port or a TCP address: there is no sensor \
                                   model to simulate. Choose one of them as the source.";

/// The Live view.
#[derive(Debug)]
pub struct LiveView {
    /// The latest frame, with the status of decoding; it stays on the screen after the end.
    pub shown: LiveShown,
    /// Decoding under way. It is dropped before the job, which then ends at once.
    pub running: Option<Running>,
    /// Gains of the unloaded state by which readings are divided.
    pub zero: Option<ZeroGains>,
    /// Reason why there are none.
    pub zero_problem: Option<String>,
    /// File of the recording under way.
    pub recording: Option<PathBuf>,
    /// The last finished recording.
    pub recorded: Option<Recorded>,
    pub(super) network: NetworkChoice,
    pub(super) sample: Sample,
    pub(super) source: SourceForm,
    pub(super) fault: FaultForm,
    pub(super) drops: DropScale,
    /// The node under the pointer, marked on both surfaces.
    pub(super) node: Option<usize>,
    /// The stream that has ended by itself, as it was requested.
    ended: Option<SourcePlan>,
    /// True if the window has received a frame and not yet reported to the thread that it was drawn.
    is_to_be_drawn: bool,
    job: Background<LiveEvent>,
}

/// Decoding under way.
#[derive(Debug)]
pub struct Running {
    /// Name of the network.
    pub network: String,
    /// Source of the frames.
    pub source: SourcePlan,
    /// Source as it was requested: a named pipe looks like a file until it is opened.
    asked: SourcePlan,
    commands: Sender<Command>,
}

impl Running {
    /// Returns the source as it was requested, if it is a stream.
    fn stream(&self) -> Option<SourcePlan> {
        matches!(self.source, SourcePlan::Stream(_)).then(|| self.asked.clone())
    }
}

impl LiveView {
    /// Creates the view without frames; `wake` is called when there are events.
    pub fn new(wake: Wake) -> Self {
        Self {
            shown: LiveShown::default(),
            running: None,
            zero: None,
            zero_problem: None,
            recording: None,
            recorded: None,
            network: NetworkChoice::new(Arc::clone(&wake)),
            sample: Sample::new(Arc::clone(&wake)),
            source: SourceForm::default(),
            fault: FaultForm::default(),
            drops: DropScale::default(),
            node: None,
            ended: None,
            is_to_be_drawn: false,
            job: Background::prompt("live", wake),
        }
    }

    /// Returns the plan for the current settings.
    ///
    /// # Errors
    /// If there is no network or a setting is missing, with what to do.
    fn plan(&self, shared: &Shared) -> Result<(String, SessionPlan), String> {
        let (name, network) = self
            .network
            .network(&shared.runs)
            .ok_or("Train a network, or open a network file.")?;
        let Some(simulation) = network.problem.sensor else {
            if self.source.kind == SourceKind::Simulated {
                return Err(NOTHING_TO_SIMULATE.to_owned());
            }
            let plan = SessionPlan {
                network: Arc::clone(network),
                source: self.source.plan()?,
                noise: Noise::default(),
                zero: None,
                unit: Unit::Frames,
            };
            return Ok((name.to_owned(), plan));
        };
        let scale = simulation.sensor.scale;
        let read = simulation.scene.rows.read(scale.rows()).unwrap_or_default();
        let plan = SessionPlan {
            network: Arc::clone(network),
            source: self.source.plan()?,
            noise: Noise {
                relative: self.source.noise(&simulation),
                ..simulation.scene.noise.in_test()
            },
            zero: self
                .zero
                .clone()
                .filter(|zero| zero.is_sound(read.len(), scale.columns())),
            unit: Unit::Frames,
        };
        Ok((name.to_owned(), plan))
    }

    /// Returns true if the network is that of an array, whose sensor model simulates, re-zeroes and finds faults.
    pub(super) fn has_sensor(&self, shared: &Shared) -> bool {
        let network = self.network.network(&shared.runs);
        network.is_none_or(|(_, file)| file.problem.sensor.is_some())
    }

    /// Returns the reason why decoding cannot begin, with what to do.
    pub(super) fn obstacle(&self, shared: &Shared) -> Option<String> {
        self.plan(shared).err()
    }

    /// Begins to decode.
    pub(super) fn start(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        let Ok((network, plan)) = self.plan(shared) else {
            return;
        };
        effects.push(Effect::Settle(Matter::Live));
        self.shown = LiveShown::default();
        self.begin(network, plan);
    }

    /// Writes the sample recording and its network to files, to be played as soon as they are ready.
    pub(super) fn ask_for_sample(&mut self, shared: &Shared) {
        self.sample.write(folder(shared).join("samples"));
    }

    /// Plays the sample once it is ready.
    pub(super) fn take_sample(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        match self.sample.next() {
            Some(Ok(sample)) => {
                self.network.take(sample.name, Arc::from(sample.network));
                self.source.kind = SourceKind::Replay;
                self.source.path = sample.recording.display().to_string();
                self.start(shared, effects);
            }
            Some(Err(reason)) => effects.push(Effect::Notify(Matter::Live, Notice::Failed(reason))),
            None => {}
        }
    }

    /// Returns true if a stream has ended by itself and is still the chosen source.
    pub fn can_retry(&self, shared: &Shared) -> bool {
        let is_same = |ended: &SourcePlan| self.plan(shared).is_ok_and(|(_, plan)| plan.source == *ended);
        self.running.is_none() && self.ended.as_ref().is_some_and(is_same)
    }

    /// Connects again to the stream that has ended.
    pub fn retry(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        if self.can_retry(shared) {
            self.start(shared, effects);
        }
    }

    /// Restarts with the network that is chosen now, from the current position of a replay.
    pub(super) fn restart(&mut self, shared: &Shared) {
        let Ok((network, plan)) = self.plan(shared) else { return };
        let replay = self
            .shown
            .replay
            .filter(|_| matches!(plan.source, SourcePlan::Replay(_)));
        if replay.is_none() {
            self.shown = LiveShown::default();
        }
        self.begin(network, plan);
        if let Some(ReplayState { at_s, is_playing, .. }) = replay {
            self.control(move |replay, now| {
                replay.seek(at_s, now);
                replay.play(is_playing, now);
            });
        }
    }

    fn begin(&mut self, network: String, plan: SessionPlan) {
        self.keep_recording();
        self.zero.clone_from(&plan.zero);
        self.zero_problem = None;
        self.drops = DropScale::default();
        self.node = None;
        (self.ended, self.is_to_be_drawn) = (None, false);
        let (commands, incoming) = channel();
        self.running = Some(Running {
            network,
            source: plan.source.clone(),
            asked: plan.source.clone(),
            commands,
        });
        let (simulation, speed) = (plan.network.problem.sensor, self.source.speed);
        self.simulate(simulation.as_ref());
        self.control(move |replay, now| replay.set_speed(speed, now));
        self.job.start(
            move |report| run(plan, &incoming, report),
            |ended| LiveEvent::Ended(ended.unwrap_or_else(|error| Err(error.to_string()))),
        );
    }

    /// Stops decoding; the last frame stays on the screen.
    pub(super) fn stop(&mut self) {
        // The thread ends once the sender of its commands is dropped.
        self.running = None;
    }

    fn command(&self, command: Command) {
        if let Some(running) = &self.running {
            // A thread that has just ended ignores commands.
            let _ = running.commands.send(command);
        }
    }

    /// Changes the session on its thread, if it is running; the event that `change` returns comes back.
    fn change(&self, change: impl FnOnce(&mut Session) -> Option<LiveEvent> + Send + 'static) {
        self.command(Command::Change(Box::new(change)));
    }

    /// Moves the indenter of a simulated source, and breaks its wires, as in the form.
    pub(super) fn simulate(&self, simulation: Option<&Simulation>) {
        let Some(simulation) = simulation else { return };
        let scale = simulation.sensor.scale;
        let read = simulation.scene.rows.read(scale.rows()).unwrap_or_default();
        let is_possible = self.fault.problem(scale, &read).is_none();
        let (motion, fault) = (self.source.motion, self.fault.fault(scale).filter(|_| is_possible));
        self.change(move |session| {
            let Input::Simulated(simulated, _) = &mut session.input else {
                return None;
            };
            simulated.motion = motion;
            let broken = simulated.set_fault(fault);
            broken.err().map(|error| LiveEvent::Failed(error.to_string()))
        });
    }

    /// Changes the replay, if there is one.
    pub(super) fn control(&self, change: impl FnOnce(&mut Replay, Instant) + Send + 'static) {
        self.change(|session| {
            if let Input::Replay(replay) = &mut session.input {
                change(replay, Instant::now());
            }
            None
        });
    }

    /// Takes the latest frames as the unloaded state.
    pub(super) fn re_zero(&mut self) {
        self.zero_problem = None;
        self.change(|session| {
            let zero = session.array.as_mut()?.take_zero();
            Some(LiveEvent::Zeroed(zero.map_err(|error| error.to_string())))
        });
    }

    /// Stops dividing readings by gains.
    pub(super) fn clear_zero(&mut self) {
        (self.zero, self.zero_problem) = (None, None);
        self.change(|session| {
            session.array.as_mut()?.zero = None;
            None
        });
    }

    /// Returns true if incoming frames can be recorded.
    pub(super) fn can_record(&self) -> bool {
        let is_replay = |running: &Running| matches!(running.source, SourcePlan::Replay(_));
        // Frames of an array are recorded; samples of other sensors have columns of their own.
        let is_array = self.shown.targets.is_none();
        is_array && self.running.as_ref().is_some_and(|running| !is_replay(running))
    }

    /// Begins a recording, or ends it.
    pub(super) fn toggle_recording(&self, shared: &Shared) {
        let folder = folder(shared).join("recordings");
        match self.recording {
            Some(_) => self.change(|session| Some(LiveEvent::Recorded(session.recording.take()?.recorded, None))),
            None => self.change(move |session| {
                let array = session.array.as_ref().filter(|_| session.recording.is_none())?;
                let created = RecordingFile::create(&folder, &array.rows, array.sensor.scale.columns());
                let begin = |file: RecordingFile| {
                    let path = file.recorded.path.clone();
                    session.recording = Some(file);
                    LiveEvent::Recording(path)
                };
                Some(created.map_or_else(LiveEvent::Failed, begin))
            }),
        }
    }

    /// Replays the last recording.
    pub(super) fn replay_recorded(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        if let Some(recorded) = &self.recorded {
            self.source.kind = SourceKind::Replay;
            self.source.path = recorded.path.display().to_string();
            self.start(shared, effects);
        }
    }

    /// Keeps the recording of a thread that has ended without reporting it.
    fn keep_recording(&mut self) {
        if self.recording.take().is_some() {
            self.recorded = self.shown.recording.clone();
        }
    }

    /// Takes the events of the thread.
    pub(super) fn follow(&mut self, effects: &mut Vec<Effect>) {
        let mut notify = |notice| effects.push(Effect::Notify(Matter::Live, notice));
        while let Some(event) = self.job.next_event() {
            match event {
                LiveEvent::Source(source) => {
                    if let Some(running) = &mut self.running {
                        running.source = source;
                    }
                }
                LiveEvent::Shown(shown) => {
                    if let Some(frame) = &shown.frame {
                        self.drops.take(frame);
                    }
                    self.shown = *shown;
                    self.is_to_be_drawn = true;
                }
                LiveEvent::Zeroed(Ok(gains)) => (self.zero, self.zero_problem) = (Some(gains), None),
                LiveEvent::Zeroed(Err(reason)) => self.zero_problem = Some(reason),
                LiveEvent::Recording(path) => self.recording = Some(path),
                LiveEvent::Failed(reason) => notify(Notice::Failed(reason)),
                LiveEvent::Recorded(recorded, reason) => {
                    (self.recording, self.recorded) = (None, Some(recorded));
                    if let Some(reason) = reason {
                        notify(Notice::Failed(reason));
                    }
                }
                LiveEvent::Ended(end) => {
                    let running = self.running.take();
                    self.keep_recording();
                    self.ended = running.as_ref().and_then(Running::stream);
                    match end {
                        Err(reason) => notify(Notice::Failed(reason)),
                        Ok(()) if running.is_some() => notify(Notice::Done("The source has ended.".to_owned())),
                        Ok(()) => {}
                    }
                }
            }
        }
    }

    /// Reports that the frame was drawn, so that the thread may send the next one.
    pub(super) fn report_drawn(&mut self) {
        if std::mem::take(&mut self.is_to_be_drawn) {
            self.command(Command::Drawn);
        }
    }
}

/// Returns the folder for files of this view: next to the runs, or a temporary one.
fn folder(shared: &Shared) -> PathBuf {
    let parent = shared.runs.path.as_ref().and_then(|runs| runs.parent());
    parent.map_or_else(std::env::temp_dir, PathBuf::from)
}

const NETWORK: (&str, &str) = (
    "sample network.json",
    include_str!("../../../../assets/samples/network.json"),
);
const RECORDING: (&str, &str) = (
    "sample recording.csv",
    include_str!("../../../../assets/samples/recording.csv"),
);

/// The sample recording, written to a file next to the user's recordings, and the network that decodes it.
#[derive(Debug)]
pub struct Sample {
    job: Background<Result<SampleFiles, String>>,
}

/// The sample on the disk.
#[derive(Debug)]
pub struct SampleFiles {
    /// The recording.
    pub recording: PathBuf,
    /// Name of the network.
    pub name: &'static str,
    /// The network.
    pub network: Box<NetworkFile>,
}

impl Sample {
    /// Creates a sample that is not written yet; `wake` is called when it is.
    pub(super) fn new(wake: Wake) -> Self {
        Self {
            job: Background::prompt("sample", wake),
        }
    }

    /// Writes the sample to `folder`.
    pub(super) fn write(&mut self, folder: PathBuf) {
        self.job.start(
            move |_| write(&folder),
            |files| files.unwrap_or_else(|error| Err(error.to_string())),
        );
    }

    /// Returns the sample once it is written, or the reason why it cannot be.
    pub(super) fn next(&mut self) -> Option<Result<SampleFiles, String>> {
        self.job.next_event()
    }
}

fn write(folder: &Path) -> Result<SampleFiles, String> {
    let refused = |error: &dyn std::fmt::Display| format!("the sample cannot be written: {error}");
    fs::create_dir_all(folder).map_err(|error| refused(&error))?;
    let write = |(name, text): (&str, &str)| {
        let path = folder.join(name);
        let written = atomic_write(&path, |file| file.write_all(text.as_bytes()));
        written.map(|()| path).map_err(|error| refused(&error))
    };
    let (network, recording) = (write(NETWORK)?, write(RECORDING)?);
    let network = NetworkFile::load(&network).map_err(|error| error.to_string())?;
    Ok(SampleFiles {
        recording,
        name: NETWORK.0,
        network: Box::new(network),
    })
}
