//! What the window's threads have in common: how they tell it something, and that they yield to it.

use std::{
    fmt::Display,
    path::{Path, PathBuf},
    sync::{
        Arc,
        mpsc::{Receiver, Sender, TryRecvError},
    },
    thread,
};

use thread_priority::{ThreadPriority, ThreadPriorityValue};

/// Makes the window draw a frame, in which it looks at what the threads told.
pub(super) type Wake = Arc<dyn Fn() + Send + Sync>;

/// A thread has ended without being asked to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WorkerDied;

/// The next of a thread's events, if one has come.
pub(super) fn next_event<E>(events: &Receiver<E>) -> Result<Option<E>, WorkerDied> {
    match events.try_recv() {
        Ok(event) => Ok(Some(event)),
        Err(TryRecvError::Empty) => Ok(None),
        Err(TryRecvError::Disconnected) => Err(WorkerDied),
    }
}

/// Lets this thread, and those it starts, yield a little: on a busy machine the window gets about fifteen times its
/// share, and training is not starved by other programs.
pub(super) fn yield_to_window() {
    /// Of 0 to 99, where about 50 is normal.
    const BELOW_NORMAL: u8 = 18;
    if let Ok(priority) = ThreadPriorityValue::try_from(BELOW_NORMAL) {
        // Where the system refuses, training merely competes with the window.
        let _ = ThreadPriority::Crossplatform(priority).set_for_current();
    }
}

/// Where a thread's events go; each wakes the window. Dropping it closes the way and wakes the window once more, so that
/// it sees a thread that died.
pub(super) struct Report<E> {
    outgoing: Option<Sender<E>>,
    wake: Wake,
}

impl<E> Report<E> {
    pub(super) fn new(outgoing: Sender<E>, wake: Wake) -> Self {
        Self {
            outgoing: Some(outgoing),
            wake,
        }
    }

    /// Tells the window. Without one there is nobody to tell.
    pub(super) fn send(&self, event: E) {
        self.try_send(event);
    }

    /// As [`Self::send`]; whether the window still listens.
    pub(super) fn try_send(&self, event: E) -> bool {
        let is_heard = self
            .outgoing
            .as_ref()
            .is_some_and(|outgoing| outgoing.send(event).is_ok());
        (self.wake)();
        is_heard
    }
}

impl<E: Send + 'static> Report<E> {
    /// Writes the file `path` on a thread called `name`, and tells with `event` that it is there, or why not.
    pub(super) fn write<X: Display>(
        &self,
        name: &str,
        path: PathBuf,
        write: impl FnOnce(&Path) -> Result<(), X> + Send + 'static,
        event: fn(Result<PathBuf, String>) -> E,
    ) {
        let report = self.clone();
        let work = move || {
            let written = write(&path);
            report.send(event(written.map(|()| path).map_err(|error| error.to_string())));
        };
        if let Err(error) = thread::Builder::new().name(name.to_owned()).spawn(work) {
            let reason = format!("No thread could be started to write the file: {error}");
            self.send(event(Err(reason)));
        }
    }
}

impl<E> Clone for Report<E> {
    fn clone(&self) -> Self {
        Self {
            outgoing: self.outgoing.clone(),
            wake: Arc::clone(&self.wake),
        }
    }
}

impl<E> Drop for Report<E> {
    fn drop(&mut self) {
        self.outgoing = None;
        (self.wake)();
    }
}

/// Tells the last event of a piece of work when dropped, also by a panic.
pub(super) struct LastEvent<E> {
    report: Report<E>,
    event: Option<E>,
}

impl<E> LastEvent<E> {
    /// `event` is told unless it is replaced.
    pub(super) fn new(report: Report<E>, event: E) -> Self {
        Self {
            report,
            event: Some(event),
        }
    }

    /// Tells something before.
    pub(super) fn send(&self, event: E) {
        self.report.send(event);
    }

    pub(super) fn replace(&mut self, event: E) {
        self.event = Some(event);
    }
}

impl<E> Drop for LastEvent<E> {
    fn drop(&mut self) {
        if let Some(event) = self.event.take() {
            self.report.send(event);
        }
    }
}
