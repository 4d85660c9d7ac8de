use std::path::PathBuf;

use super::{BottomTab, Frames, Look, RightCard, RunResult, RunView, error_frame, run_list::RunsState};
use crate::{
    app::{
        file_task::FileTask,
        test_view::TestView,
        training_worker::{ExportKind, file_name},
        views::{
            experiments::ExperimentsState, identifiability::IdentifiabilityState, trade_off::TradeState,
            train::decoders::DecodersState,
        },
    },
    evaluation::{Baselines, SimulatedSettings, node_rms_mm},
    figure::surface::{OrbitCamera, ViewMode},
    training::StopReason,
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
    pub draft: SimulatedSettings,
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
    pub settings: SimulatedSettings,
    /// Their test set.
    pub test: TestView,
    /// What will stand beside the network, once it is measured.
    pub baselines: Option<Baselines>,
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
            identifiability: IdentifiabilityState::new(&SimulatedSettings::default()),
            trade: TradeState::default(),
            draft: SimulatedSettings::default(),
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
        let fixed = SimulatedSettings {
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
        let snapshot = test.nearest_snapshot(self.look.snapshot);
        let actual = test.frame(test.set.targets(), snapshot);
        let decoupled = self
            .result()
            .map(|result| test.frame(result.decoupled_mm.view(), snapshot));
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
