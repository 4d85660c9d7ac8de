use std::sync::Arc;

use super::subject::Subject;
use crate::window::{
    job::{Job, JobError, Wake},
    shared::Shared,
};
use decoupler_core::{
    evaluation::{Run, RunError, SimulatedSettings, ready_settings},
    network::Networks,
};

/// Message of the thread to the window.
type Trained = Result<Result<Option<Networks>, RunError>, JobError>;

/// A small network for the sensor displayed, trained in the background in a moment once somebody is about to press and there
/// is no other.
#[derive(Debug)]
pub struct ReadyNetwork {
    job: Job<Trained>,
    /// Settings of the network that is there or being trained.
    of: Option<SimulatedSettings>,
    networks: Option<Arc<Networks>>,
    /// Reason why there is none.
    pub(super) failure: Option<String>,
}

impl ReadyNetwork {
    pub(super) fn new(wake: Wake) -> Self {
        Self {
            job: Job::prompt("ready network", wake),
            of: None,
            networks: None,
            failure: None,
        }
    }

    /// Takes the network once it is trained.
    pub(super) fn take_events(&mut self) {
        while let Some(trained) = self.job.next_event() {
            match trained {
                Ok(Ok(networks)) => self.networks = networks.map(Arc::new),
                Ok(Err(error)) => self.failure = Some(error.to_string()),
                Err(error) => self.failure = Some(error.to_string()),
            }
        }
    }

    /// Trains the network of the current test set, unless it is there or too large to be trained in a moment.
    pub(super) fn ask(&mut self, shared: &Shared) {
        let Some(settings) = settings_of(shared) else { return };
        if self.of == Some(settings) {
            return;
        }
        (self.of, self.networks, self.failure) = (Some(settings), None, None);
        self.job.start(
            move |report| {
                let is_cancelled = || report.is_cancelled();
                let Some(mut run) = Run::prepare_unless(settings, &is_cancelled)? else {
                    return Ok(None);
                };
                while run.step().is_none() && !is_cancelled() {}
                Ok(Some(run.network()))
            },
            |trained| trained,
        );
    }

    /// Returns true while the network of the current test set is being trained.
    pub(super) fn is_awaited(&self, shared: &Shared) -> bool {
        self.of.is_some() && self.of == settings_of(shared) && self.job.is_under_way()
    }

    /// The network, if it is that of the current test set.
    pub(super) fn subject(&self, shared: &Shared) -> Option<Subject> {
        let settings = settings_of(shared).filter(|settings| self.of == Some(*settings))?;
        Some(Subject {
            networks: Arc::clone(self.networks.as_ref()?),
            settings,
            is_ready_made: true,
            is_idle: true,
        })
    }
}

/// Settings of the ready-made network for the current test set; `None` where it would take long.
fn settings_of(shared: &Shared) -> Option<SimulatedSettings> {
    let settings = match (&shared.preview, &shared.run) {
        (Some(preview), _) => preview.settings,
        (None, Some(run)) => run.simulated()?,
        (None, None) => return None,
    };
    ready_settings(&settings.source)
}
