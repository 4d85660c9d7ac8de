use super::{Look, RunList, RunResult, RunView, opening_settings};
use crate::{
    app::test_view::{HeightScale, TestView},
    evaluation::{Baselines, SimulatedSettings},
    figure::{
        SequentialMap,
        surface::{OrbitCamera, ViewMode},
    },
    training::StopReason,
};

/// State that all views read.
#[derive(Debug)]
pub struct Shared {
    /// Settings of the next training.
    pub draft: SimulatedSettings,
    /// State of the worker.
    pub phase: Phase,
    /// Facts about the draft before it is trained.
    pub preview: Option<Preview>,
    /// The present or last training.
    pub run: Option<RunView>,
    /// The run list.
    pub runs: RunList,
    /// Camera and mode of surfaces.
    pub look: Look,
    /// The names of the views whose threads compute.
    pub working: Vec<&'static str>,
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
    /// Held.
    Paused,
    /// Ended, and why.
    Ended(StopReason),
    /// The worker is gone.
    Died,
}

impl Phase {
    /// Returns true while a training is running or paused; its settings cannot change then.
    pub fn is_busy(self) -> bool {
        matches!(self, Self::Preparing | Self::Training | Self::Paused)
    }
}

/// Facts about settings before a training.
#[derive(Debug)]
pub struct Preview {
    /// The settings.
    pub settings: SimulatedSettings,
    /// Their test set.
    pub test: TestView,
    /// Baselines, once they are measured.
    pub baselines: Option<Baselines>,
}

impl Shared {
    /// As the window opens.
    pub fn new(is_dark: bool) -> Self {
        Self {
            draft: opening_settings(),
            phase: Phase::Idle,
            preview: None,
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
            working: Vec::new(),
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

    /// Returns the phase of an idle worker: that of the ended training, or idle before the first.
    pub fn phase_at_rest(&self) -> Phase {
        let ended = self.run.as_ref().and_then(|run| run.stop_reason);
        ended.map_or(Phase::Idle, Phase::Ended)
    }

    /// Returns true if the training on show can continue from its present weights with the draft: its sets and networks
    /// must be the same. A paused training is resumed instead, unless the method or the stopping rules change.
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
}
