use std::sync::Arc;

use decoupler_core::{
    dataset::Simulation,
    evaluation::{Baselines, RunSettings},
    scene::{Indenter, Loading, Noise, RowModel, Scene},
    training::{StopReason, TrainingSettings},
};
use decoupler_files::{
    figure::{
        SequentialMap,
        surface::{OrbitCamera, ViewMode},
    },
    import::{Plan, Setup},
};
use serde::{Deserialize, Serialize};

use super::{Command, Look, Offer, RunList, RunResult, RunView, ViewKind};
use crate::window::{
    test_view::{HeightScale, Skin, TestView},
    training_worker::{Asked, OpenPlan, Preparing},
};

/// State that all views read.
#[derive(Debug)]
pub struct Shared {
    /// Source of the next training.
    pub source: SourceKind,
    /// Settings of the next training on a simulated array.
    pub draft: RunSettings,
    /// Settings of the next training on a recording.
    pub recording: RecordingDraft,
    /// State of the worker.
    pub phase: Phase,
    /// Facts about the draft before it is trained.
    pub preview: Option<Preview>,
    /// Progress of reading a recording or of choosing settings before a training.
    pub preparing: Option<Preparing>,
    /// The current or last training.
    pub run: Option<RunView>,
    /// The run list.
    pub runs: RunList,
    /// Camera and mode of surfaces.
    pub look: Look,
    /// The displayed view.
    pub shown: ViewKind,
    /// The commands of this frame.
    pub offers: Vec<Offer>,
}

/// Kinds of source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SourceKind {
    /// Samples drawn from the model of an array.
    #[default]
    Array,
    /// Samples read from files.
    Recording,
}

/// Settings of a training on a recording, and the plan that reads it.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordingDraft {
    /// Settings; their source is measured.
    pub settings: RunSettings,
    /// True if they are chosen by cross-validation before the training, with a memory.
    pub is_auto: bool,
    /// Plan of the import with absolute paths, or what is missing and what to do.
    pub plan: Result<OpenPlan, String>,
}

impl RecordingDraft {
    /// Reason why there is no plan before a file is opened.
    pub const NOTHING_OPEN: &str = "Open a recording first: drop files on the window.";

    /// Returns true if the settings of the next training are chosen automatically, which needs one network for all row-wires.
    pub fn is_automatic(&self) -> bool {
        self.is_auto && self.settings.source.row_model() == RowModel::Shared
    }
}

impl Default for RecordingDraft {
    fn default() -> Self {
        Self {
            settings: RunSettings::measured(RowModel::Shared),
            is_auto: true,
            plan: Err(Self::NOTHING_OPEN.to_owned()),
        }
    }
}

/// State of the worker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Waiting for the user.
    Idle,
    /// Drawing samples and starting the network.
    Preparing,
    /// Stepping.
    Training,
    /// Paused.
    Paused,
    /// Calibrating the intervals after the last epoch.
    Calibrating,
    /// Ended, and why.
    Ended(StopReason),
}

impl Phase {
    /// Returns true while a training is running or paused; its settings cannot change then.
    pub fn is_busy(self) -> bool {
        matches!(
            self,
            Self::Preparing | Self::Training | Self::Paused | Self::Calibrating
        )
    }
}

/// Facts about settings before a training.
#[derive(Debug)]
pub struct Preview {
    /// The settings.
    pub settings: RunSettings,
    /// Their test set.
    pub test: TestView,
    /// Baselines, once they are measured.
    pub baselines: Option<Baselines>,
}

impl Shared {
    /// As the window opens.
    pub fn new(is_dark: bool) -> Self {
        Self {
            source: SourceKind::default(),
            draft: opening_settings(),
            recording: RecordingDraft::default(),
            phase: Phase::Idle,
            preview: None,
            preparing: None,
            run: None,
            runs: RunList::default(),
            look: Look {
                camera: OrbitCamera::default(),
                mode: ViewMode::ThreeD,
                is_dark,
                colours: SequentialMap::default(),
                heights: HeightScale::default(),
                error_limit_mm: None,
            },
            shown: ViewKind::default(),
            offers: Vec::new(),
        }
    }

    /// Returns the reason why a command is not available in this frame; an empty one if it is not offered.
    pub fn obstacle(&self, command: &Command) -> Option<&str> {
        let offer = self.offers.iter().find(|offer| offer.command == *command);
        offer.map_or(Some(""), |offer| offer.obstacle.as_deref())
    }

    /// Returns true if the displayed view has a column on the right in a window of this width in points, which leaves the
    /// middle enough room: two surfaces, or the values of a recording over time.
    pub fn has_report(&self, window_width: f32) -> bool {
        let min_width = match self.source {
            SourceKind::Array => 1700.0,
            SourceKind::Recording => 1400.0,
        };
        self.shown == ViewKind::Train && window_width >= min_width
    }

    /// Settings of the next training.
    pub fn settings(&self) -> RunSettings {
        match self.source {
            SourceKind::Array => self.draft,
            SourceKind::Recording => match self.chosen_run() {
                Some(run) => *run.settings(),
                None => self.recording.settings,
            },
        }
    }

    /// Returns the current training if its settings were chosen automatically for what the next one would be chosen for.
    pub fn chosen_run(&self) -> Option<&RunView> {
        let run = self.shown_run().filter(|run| run.search.is_some())?;
        let is_asked = || self.asked().is_ok_and(|asked| asked == run.asked);
        (self.recording.is_automatic() && is_asked()).then_some(run)
    }

    /// Sets the training settings of the next training.
    pub fn set_training(&mut self, training: TrainingSettings) {
        match self.source {
            SourceKind::Array => self.draft.training = training,
            SourceKind::Recording => self.recording.settings.training = training,
        }
    }

    /// Returns what the recording that is to be trained on lacks, with what to do.
    pub fn missing_recording(&self) -> Option<&str> {
        let is_recording = self.source == SourceKind::Recording;
        let reason = self.recording.plan.as_ref().err().filter(|_| is_recording);
        reason.map(String::as_str)
    }

    /// Setup of the next training.
    ///
    /// # Errors
    /// If something is missing; the message says what to do.
    pub fn setup(&self) -> Result<Setup, String> {
        self.asked().map(|Asked { settings, plan }| match plan {
            None => settings.into(),
            Some(plan) => Setup::recording(settings, Plan::clone(&plan)),
        })
    }

    /// Returns what the next training is asked for; its plan is shared, not copied.
    ///
    /// # Errors
    /// If something is missing; the message says what to do.
    pub fn asked(&self) -> Result<Asked, String> {
        let (settings, plan) = match self.source {
            SourceKind::Array => (self.draft, None),
            SourceKind::Recording => (self.recording.settings, Some(self.recording.plan.clone()?)),
        };
        Ok(Asked { settings, plan })
    }

    /// Returns the current test set: the training's, or the draft's if it has another one.
    pub fn test(&self) -> Option<&TestView> {
        match &self.preview {
            Some(preview) if self.source == SourceKind::Array => Some(&preview.test),
            _ => self.shown_run().map(|run| &run.test),
        }
    }

    /// Returns the array of the current test set; none for a recording.
    pub fn skin(&self) -> Option<&Arc<Skin>> {
        self.test()?.skin.as_ref()
    }

    /// Returns the current training; none if it has another source, or the draft has another test set by now.
    pub fn shown_run(&self) -> Option<&RunView> {
        let run = self.run.as_ref()?;
        let is_shown = match (self.source, run.setup.plan(), &self.recording.plan) {
            (SourceKind::Array, None, _) => self.preview.is_none(),
            // Another recording does not inherit its errors.
            (SourceKind::Recording, Some(plan), Ok(open)) => plan.import.data == open.import.data,
            (SourceKind::Recording, Some(_), Err(_)) => true,
            _ => false,
        };
        is_shown.then_some(run)
    }

    /// Returns the phase of an idle worker: that of the ended training, or idle before the first.
    pub fn phase_at_rest(&self) -> Phase {
        let ended = self.run.as_ref().and_then(|run| run.stop_reason);
        ended.map_or(Phase::Idle, Phase::Ended)
    }

    /// Returns true if the current training can continue from its present weights with the draft: its sets and networks
    /// must be the same. A paused training is resumed instead, unless the method or the stopping rules change.
    pub fn can_continue(&self) -> bool {
        // The worker does not have a run of the list.
        let run = self.shown_run().filter(|run| run.kept.is_none());
        let (Some(run), Ok(mut asked)) = (run, self.asked()) else {
            return false;
        };
        let training = run.asked.settings.training;
        let may_continue = match self.phase {
            Phase::Paused => self.chosen_run().is_none() && asked.settings.training != training,
            Phase::Ended(reason) => reason != StopReason::Diverged,
            _ => false,
        };
        asked.settings.training = training;
        may_continue && asked == run.asked
    }

    /// Returns true if the settings or the plan have changed since `run` began or was continued, and it has ended.
    pub fn is_old(&self, run: &RunView) -> bool {
        run.stop_reason.is_some() && self.asked().is_ok_and(|asked| asked != run.asked)
    }

    /// The current result.
    pub fn result(&self) -> Option<&RunResult> {
        self.shown_run().and_then(|run| run.result.as_ref())
    }
}

/// Settings with which the window opens for the first time: the paper's experiment, but with a ball pressed somewhere
/// onto the surface, which is easily recognised as touch, instead of independently pressed nodes, and readings with noise.
pub fn opening_settings() -> RunSettings {
    RunSettings::from(Simulation {
        scene: Scene {
            loading: Loading::Indenter(Indenter::default()),
            noise: Noise::relative(1e-3),
            ..Scene::default()
        },
        ..Simulation::default()
    })
}
