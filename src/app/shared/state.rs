use super::{Look, RunList, RunResult, RunView};
use crate::{
    app::test_view::TestView,
    evaluation::{Baselines, SimulatedSettings},
    figure::surface::{OrbitCamera, ViewMode},
    training::StopReason,
};

/// What all views read.
#[derive(Debug)]
pub struct Shared {
    /// Settings of the next training.
    pub draft: SimulatedSettings,
    /// What the worker is doing.
    pub phase: Phase,
    /// What is known about the draft before it is trained.
    pub preview: Option<Preview>,
    /// The present or last training.
    pub run: Option<RunView>,
    /// The run list.
    pub runs: RunList,
    /// How surfaces are looked at.
    pub look: Look,
    /// The names of the views whose threads compute.
    pub working: Vec<&'static str>,
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

impl Shared {
    /// As the window opens.
    pub fn new(is_dark: bool) -> Self {
        Self {
            draft: SimulatedSettings::default(),
            phase: Phase::Idle,
            preview: None,
            run: None,
            runs: RunList::default(),
            look: Look {
                camera: OrbitCamera::default(),
                mode: ViewMode::ThreeD,
                is_dark,
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
}
