use std::{path::PathBuf, sync::Arc, time::Duration};

use ndarray::Array2;

use super::{
    decoders::DecodersState,
    experiments::ExperimentsState,
    export_kind::{ExportKind, file_name},
    file_task::FileTask,
    identifiability::IdentifiabilityState,
    runs::RunsState,
    surface_view::{OrbitCamera, ViewMode},
    test_view::{Frame, TestView},
    trade::TradeState,
    worker::{Began, Progress},
};
use crate::{
    evaluation::{Baselines, Errors, PublishedErrors, RunSettings, StartRecord, node_rms_mm},
    training::{EpochRecord, Stage, StopReason},
};

/// Everything the panels read.
#[derive(Debug)]
pub struct State {
    /// What the window shows.
    pub view: View,
    /// The Experiments view.
    pub experiments: ExperimentsState,
    /// The run list and the Compare view.
    pub runs: RunsState,
    /// The Identifiability view.
    pub identifiability: IdentifiabilityState,
    /// The Trade-off view.
    pub trade: TradeState,
    /// Settings of the next training.
    pub draft: RunSettings,
    /// What the worker is doing.
    pub phase: Phase,
    /// What is known about the draft before it is trained.
    pub preview: Option<Preview>,
    /// The present or last training.
    pub run: Option<RunView>,
    /// What other decoders make of its test set.
    pub decoders: DecodersState,
    /// How it is looked at.
    pub look: Look,
    /// The snapshot being drawn.
    pub frames: Frames,
    /// Something to tell the user, once.
    pub notice: Option<Notice>,
    /// A file waiting for its path.
    pub saving: Option<Saving>,
    /// The path last typed, offered again for the same task.
    pub typed: Option<Saving>,
}

/// What the window shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum View {
    /// One training and what it makes of the sensor.
    #[default]
    Train,
    /// The paper's tables and sweeps.
    Experiments,
    /// Two finished trainings side by side.
    Compare,
    /// What readings can tell at all.
    Identifiability,
    /// What each way of decoding costs and gains.
    TradeOff,
}

/// What the worker is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Waiting for the user.
    Idle,
    /// Drawing samples and starting the network.
    Preparing,
    /// Stepping.
    Training,
    /// Held.
    Paused,
    /// Ended, and why.
    Ended(StopReason),
    /// The worker is gone.
    Died,
}

impl Phase {
    /// Whether a training is under way, held or not; its settings cannot change then.
    pub fn is_busy(self) -> bool {
        matches!(self, Self::Preparing | Self::Training | Self::Paused)
    }
}

/// What is known about settings before a training.
#[derive(Debug)]
pub struct Preview {
    /// The settings.
    pub settings: RunSettings,
    /// Their test set.
    pub test: TestView,
    /// What will stand beside the network, once it is measured.
    pub baselines: Option<Baselines>,
}

/// A training as far as the window knows it.
#[derive(Debug)]
pub struct RunView {
    /// What it is trained with.
    pub settings: RunSettings,
    /// What stood on the left when it began or was continued: as [`Self::settings`], but the epochs are those asked
    /// for from where it stood.
    pub asked: RunSettings,
    /// Weights and biases of the network.
    pub weights: usize,
    /// Its test set.
    pub test: TestView,
    /// What stands beside the network.
    pub baselines: Baselines,
    /// What the paper reports for this configuration.
    pub published: Option<PublishedErrors>,
    /// Every epoch of the leader so far.
    pub history: Vec<EpochRecord>,
    /// The methods that the leader went through.
    pub stages: Vec<Stage>,
    /// How each start stood when last looked at; empty where there is one only.
    pub starts: Vec<StartRecord>,
    /// What the best network makes of the test set, and what that is worth.
    pub result: Option<RunResult>,
    /// Why it ended, if it has.
    pub stop_reason: Option<StopReason>,
}

/// What the best network so far makes of the test set.
#[derive(Clone, Debug)]
pub struct RunResult {
    /// Coordinates: samples × 3·M2.
    pub decoupled_mm: Arc<Array2<f64>>,
    /// Their errors.
    pub errors: Errors,
    /// The epoch of the network.
    pub best_epoch: usize,
    /// Epochs run by the start that is furthest.
    pub epochs_run: usize,
    /// How many starts have ended.
    pub starts_ended: usize,
    /// Time spent in training.
    pub elapsed: Duration,
    /// Time to decode one snapshot, where it was measured.
    pub frame_time: Option<Duration>,
}

impl RunView {
    /// A training that has just begun.
    pub fn new(began: Began) -> Self {
        let Began {
            settings,
            weights,
            test,
            baselines,
        } = began;
        Self {
            published: settings.published(),
            settings,
            asked: settings,
            weights,
            test,
            baselines,
            history: Vec::new(),
            stages: Vec::new(),
            starts: Vec::new(),
            result: None,
            stop_reason: None,
        }
    }

    /// Takes the worker's news.
    pub fn progress(&mut self, progress: Progress) {
        let Progress {
            epochs,
            stages,
            starts,
            decoupled_mm,
            errors,
            best_epoch,
            epochs_run,
            starts_ended,
            elapsed,
            frame_time,
            stop_reason,
        } = progress;
        self.stop_reason = stop_reason;
        // Another start may lead now; then all its epochs come.
        if let Some(first) = epochs.first() {
            self.history.truncate(first.epoch);
        }
        self.history.extend(epochs);
        self.stages = stages;
        if let Some(starts) = starts {
            self.starts = starts;
        }
        self.result = Some(RunResult {
            decoupled_mm,
            errors,
            best_epoch,
            epochs_run,
            starts_ended,
            elapsed,
            frame_time,
        });
    }

    /// The latest epoch.
    pub fn latest(&self) -> Option<&EpochRecord> {
        self.history.last()
    }
}

/// How the results are looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Snapshot of the test set.
    pub snapshot: usize,
    /// Shared by both surfaces.
    pub camera: OrbitCamera,
    /// In space or from above.
    pub mode: ViewMode,
    /// What the right-hand card shows.
    pub right: RightCard,
    /// The chart below.
    pub tab: BottomTab,
    /// The node under the pointer.
    pub node: Option<usize>,
    /// Whether each decoupled node has a bar that tells how far it is off in general.
    pub has_error_bars: bool,
    /// Dark or light.
    pub is_dark: bool,
}

/// What stands beside the actual surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RightCard {
    /// The surface that the network found.
    #[default]
    Decoupled,
    /// Its difference from the actual one.
    Error,
}

/// The charts below the surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BottomTab {
    /// Error against epoch.
    #[default]
    Loss,
    /// Gradient, damping or rate, and validation failures against epoch.
    TrainingState,
    /// How the errors of z are distributed.
    ErrorHistogram,
    /// Decoupled against actual z.
    Regression,
    /// The nodes of the snapshot: the paper's Fig. 6.
    Nodes,
}

/// The snapshot being drawn, made anew only when it changes.
#[derive(Debug, Default)]
pub struct Frames {
    /// As it is.
    pub actual: Frame,
    /// As the network finds it, and the difference (decoupled − actual).
    pub decoupled: Option<(Frame, Frame)>,
    /// How far each node is off in general, where that is asked for: [`node_rms_mm`].
    pub spread_mm: Option<Vec<f64>>,
}

/// Something to tell the user, once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Notice {
    /// It worked.
    Done(String),
    /// It did not, and what to do.
    Failed(String),
}

/// A file waiting for its path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Saving {
    /// What to do with it.
    pub task: FileTask,
    /// The path typed so far.
    pub path: String,
}

impl State {
    /// The state in which the window opens.
    pub fn new(is_dark: bool) -> Self {
        Self {
            view: View::default(),
            experiments: ExperimentsState::new(),
            runs: RunsState::default(),
            identifiability: IdentifiabilityState::new(&RunSettings::default()),
            trade: TradeState::default(),
            draft: RunSettings::default(),
            phase: Phase::Idle,
            preview: None,
            run: None,
            decoders: DecodersState::default(),
            look: Look {
                snapshot: 0,
                camera: OrbitCamera::default(),
                mode: ViewMode::ThreeD,
                right: RightCard::default(),
                tab: BottomTab::default(),
                node: None,
                has_error_bars: false,
                is_dark,
            },
            frames: Frames::default(),
            notice: None,
            saving: None,
            typed: None,
        }
    }

    /// The test set on show: the training's, or the draft's if that has moved on.
    pub fn test(&self) -> Option<&TestView> {
        match &self.preview {
            Some(preview) => Some(&preview.test),
            None => self.run.as_ref().map(|run| &run.test),
        }
    }

    /// The training on show: none if the draft has moved on to another test set.
    pub fn shown_run(&self) -> Option<&RunView> {
        if self.preview.is_some() {
            None
        } else {
            self.run.as_ref()
        }
    }

    /// What the worker is doing while it does nothing: it waits after the last training, or for the first.
    pub fn phase_at_rest(&self) -> Phase {
        let ended = self.run.as_ref().and_then(|run| run.stop_reason);
        ended.map_or(Phase::Idle, Phase::Ended)
    }

    /// Whether the training on show can go on from its present weights as the settings say: only what its sets and
    /// networks are made of must be as it was. What is held goes on by itself unless the method or the stopping change.
    pub fn can_continue(&self) -> bool {
        let Some(run) = self.shown_run() else { return false };
        let may_go_on = match self.phase {
            Phase::Paused => self.draft.training != run.asked.training,
            Phase::Ended(reason) => reason != StopReason::Diverged,
            _ => false,
        };
        let fixed = RunSettings {
            training: run.asked.training,
            ..self.draft
        };
        may_go_on && fixed == run.asked
    }

    /// The result on show.
    pub fn result(&self) -> Option<&RunResult> {
        self.shown_run().and_then(|run| run.result.as_ref())
    }

    /// Makes the frames of the snapshot on show.
    pub fn refresh_frames(&mut self) {
        let Some(test) = self.test().cloned() else { return };
        let snapshot = self.look.snapshot.min(test.set.snapshots().saturating_sub(1));
        let actual = test.frame(&test.set.coordinates_mm, snapshot);
        let decoupled = self.result().map(|result| test.frame(&result.decoupled_mm, snapshot));
        let spread_mm = self
            .result()
            .filter(|_| self.look.has_error_bars)
            .map(|result| node_rms_mm(&test.set, &result.decoupled_mm));
        self.frames = Frames {
            spread_mm,
            decoupled: decoupled.map(|decoupled| {
                let error = error_frame(&actual, &decoupled);
                (decoupled, error)
            }),
            actual,
        };
        self.look.snapshot = snapshot;
        self.look.node = self.look.node.filter(|&node| node < self.frames.actual.nodes_mm.len());
    }

    /// Where a file goes unless the user says otherwise.
    pub fn suggested_path(&self, task: FileTask) -> PathBuf {
        let settings = self.run.as_ref().map_or(&self.draft, |run| &run.settings);
        let name = match task {
            FileTask::Save(kind) => kind.file_name(settings),
            FileTask::SaveExperiment(topic, file) => ExperimentsState::file_name(topic, file),
            FileTask::SaveTrade(file) => file.file_name(),
            FileTask::SavePicture(picture) => file_name(picture.file_word(self), task.extension(), settings),
            FileTask::OpenCheckpoint => ExportKind::Checkpoint.file_name(settings),
        };
        std::env::current_dir().unwrap_or_default().join(name)
    }
}

/// Decoupled − actual: z of the nodes and of the grid.
pub(super) fn error_frame(actual: &Frame, decoupled: &Frame) -> Frame {
    let nodes = actual.nodes_mm.iter().zip(&decoupled.nodes_mm);
    let grid = actual.grid_mm.iter().zip(&decoupled.grid_mm);
    Frame {
        nodes_mm: nodes
            .map(|(actual, decoupled)| actual.with_z(decoupled.z - actual.z))
            .collect(),
        grid_mm: grid.map(|(actual, decoupled)| decoupled - actual).collect(),
    }
}
