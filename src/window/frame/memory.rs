use std::{path::PathBuf, time::Duration};

use super::{
    DecouplerWindow,
    remembered::{Remembered, WindowFile},
};
use crate::window::{
    job::{Job, JobError, Wake},
    shared::Matter,
};
use decoupler_files::{export::WriteError, import::Plan};

/// Longest time that closing waits for the file.
const LONGEST_WAIT: Duration = Duration::from_secs(2);

type Written = Result<Result<(), WriteError>, JobError>;

/// The file that keeps what a window remembers, written in the background.
#[derive(Debug)]
pub(super) struct Memory {
    path: PathBuf,
    /// The contents of the file, or of the one on its way there.
    written: Remembered,
    latest: Remembered,
    job: Job<Written>,
    has_told: bool,
}

impl Memory {
    pub(super) fn new(file: WindowFile, wake: Wake) -> Self {
        let WindowFile { path, remembered } = file;
        Self {
            path,
            written: remembered.clone(),
            latest: remembered,
            job: Job::prompt("memory", wake),
            has_told: false,
        }
    }

    /// Keeps what is to be remembered now; writes it if `may_write`, and else later.
    fn keep(&mut self, latest: Remembered, may_write: bool) {
        self.latest = latest;
        if may_write && self.latest != self.written && !self.job.is_under_way() {
            self.written = self.latest.clone();
            let (path, remembered) = (self.path.clone(), self.latest.clone());
            self.job.start(move |_| remembered.write(&path), |written| written);
        }
    }

    /// Returns the reason for which nothing is remembered, once.
    fn next_failure(&mut self) -> Option<String> {
        let reason = match self.job.next_event()? {
            Ok(Ok(())) => return None,
            Ok(Err(error)) => error.to_string(),
            Err(error) => error.to_string(),
        };
        let is_first = !std::mem::replace(&mut self.has_told, true);
        is_first.then(|| format!("View, theme and settings will not be found again at the next start: {reason}"))
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        self.job.wait(LONGEST_WAIT);
        if self.latest != self.written && !self.has_told {
            // No one is left to be predicted.
            let _ = self.latest.write(&self.path);
        }
    }
}

impl DecouplerWindow {
    /// Remembers what the user sees.
    pub(super) fn remember(&mut self) {
        let Some(memory) = &mut self.memory else { return };
        self.remembered.view = Some(self.names[self.shown].1.to_owned());
        self.remembered.draft = Some(self.shared.draft);
        self.remembered.source = Some(self.shared.source);
        self.remembered.recording = Some(self.shared.recording.settings);
        match &self.shared.recording.plan {
            Ok(plan) if self.remembered.plan.as_ref() != Some(&**plan) => {
                self.remembered.plan = Some(Plan::clone(plan));
            }
            Ok(_) => {}
            // An import that is incomplete now may be completed again.
            Err(_) if self.views.has_recording() => {}
            Err(_) => self.remembered.plan = None,
        }
        let (is_usual_size, is_held) = self.ctx.input(|input| {
            let viewport = input.viewport();
            let is_unusual = [viewport.maximized, viewport.fullscreen, viewport.minimized].contains(&Some(true));
            (!is_unusual, input.pointer.any_down())
        });
        if is_usual_size {
            let size = self.ctx.content_rect().size() * self.ctx.zoom_factor();
            self.remembered.take_size_points(size.into());
        }
        // What is being dragged is written when it is let go.
        memory.keep(self.remembered.clone(), !is_held);
        if let Some(reason) = memory.next_failure() {
            self.notices.fail(Matter::Memory, reason);
        }
    }

    pub(super) fn place_of(&self, view: Option<&str>) -> Option<usize> {
        let mut names = self.names.iter();
        names.find_map(|&(place, name)| (Some(name) == view).then_some(place))
    }
}
