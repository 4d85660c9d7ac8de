//! Work on files in the background, one task at a time: opening them, and checking the import.

use std::{ops::ControlFlow, sync::Arc};

use decoupler_core::dataset::Seed;
use decoupler_files::import::{Plan, Progress, Watch};

use super::{
    checking::{Checked, check},
    opening::Opened,
};
use crate::window::job::{Background, JobError, Jobs, Report};

/// The task under way, or the outcome of the last one.
#[derive(Debug)]
pub(super) struct Reading {
    job: Background<State>,
    /// The plan that is being checked, or was checked last.
    asked: Option<(Arc<Plan>, Seed)>,
    pub(super) state: State,
}

/// State of the work.
#[derive(Debug)]
pub(super) enum State {
    /// Nothing was asked for.
    Idle,
    /// Files with these names are being opened; those of a plan if `is_plan`.
    Opening {
        names: String,
        progress: Option<Progress>,
        is_plan: bool,
    },
    /// Contents of files that were opened, which the editor takes.
    Opened(Result<Opened, String>),
    /// The samples of the plan are being imported.
    Checking,
    /// The samples of the plan, or the reason why there are none.
    Checked(Result<Checked, String>),
}

impl Reading {
    /// No work yet.
    pub(super) fn new(jobs: &Jobs) -> Self {
        Self {
            job: Background::new("reading of a recording", jobs),
            asked: None,
            state: State::Idle,
        }
    }

    /// Opens files with these names by `open`; other work is abandoned.
    pub(super) fn open(
        &mut self,
        names: String,
        is_plan: bool,
        open: impl FnOnce(Watch<'_>) -> Result<Opened, String> + Send + 'static,
    ) {
        let opening = move |progress| State::Opening {
            names: names.clone(),
            progress,
            is_plan,
        };
        (self.asked, self.state) = (None, opening(None));
        self.job.start(
            move |report| open(&mut watch(report, |progress| opening(Some(progress)))),
            |opened| State::Opened(flat(opened)),
        );
    }

    /// Checks this plan, unless that is done or under way, or files are being opened; `None` if there is nothing to check.
    pub(super) fn check(&mut self, plan: Option<Arc<Plan>>, seed: Seed) {
        let is_same = match (&plan, &self.asked) {
            (None, None) => true,
            (Some(plan), Some((asked, before))) => Arc::ptr_eq(plan, asked) && seed == *before,
            _ => false,
        };
        if is_same || matches!(self.state, State::Opening { .. }) {
            return;
        }
        self.cancel();
        if let Some(plan) = plan {
            (self.asked, self.state) = (Some((Arc::clone(&plan), seed)), State::Checking);
            self.job.start(
                move |report| check(&plan, seed, &mut watch(report, |_| State::Checking)),
                |checked| State::Checked(flat(checked)),
            );
        }
    }

    /// Cancels the work.
    pub(super) fn cancel(&mut self) {
        self.job.abandon();
        (self.asked, self.state) = (None, State::Idle);
    }

    /// Returns the contents of files once they are read.
    pub(super) fn next_opened(&mut self) -> Option<Result<Opened, String>> {
        while let Some(state) = self.job.next_event() {
            if let State::Opened(opened) = state {
                self.state = State::Idle;
                return Some(opened);
            }
            self.state = state;
        }
        None
    }

    /// Returns true while files are being opened.
    pub(super) fn is_opening(&self) -> bool {
        matches!(self.state, State::Opening { .. })
    }

    /// Returns true while the files of a plan are being opened.
    pub(super) fn is_reopening(&self) -> bool {
        matches!(self.state, State::Opening { is_plan: true, .. })
    }

    /// Returns the samples of the plan, once they are known.
    pub(super) fn checked(&self) -> Option<&Checked> {
        match &self.state {
            State::Checked(checked) => checked.as_ref().ok(),
            _ => None,
        }
    }
}

/// Reports the progress of reading as a state, until the work is cancelled.
fn watch(report: &Report<State>, state: impl Fn(Progress) -> State) -> impl FnMut(Progress) -> ControlFlow<()> {
    move |progress| {
        report.progress(state(progress), |_, _| ());
        if report.is_cancelled() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

fn flat<T>(result: Result<Result<T, String>, JobError>) -> Result<T, String> {
    result.unwrap_or_else(|error| Err(error.to_string()))
}
