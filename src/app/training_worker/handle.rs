use std::{
    sync::mpsc::{Receiver, Sender, channel},
    thread,
};

use super::{Event, Request, labour::Labour};
use crate::app::threads::{Report, Wake, WorkerDied, next_event, yield_to_window};

/// The window's end of the worker.
#[derive(Debug)]
pub struct Worker {
    requests: Sender<Request>,
    events: Receiver<Event>,
}

impl Worker {
    /// Starts the thread. `wake` is called after each event.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start(wake: Wake) -> std::io::Result<Self> {
        let (requests, incoming) = channel();
        let (outgoing, events) = channel();
        let report = Report::new(outgoing, wake);
        thread::Builder::new().name("training".to_owned()).spawn(move || {
            yield_to_window();
            Labour::new(report).run(&incoming);
        })?;
        Ok(Self { requests, events })
    }

    /// A worker that has died.
    #[cfg(test)]
    pub fn dead() -> Self {
        Self {
            requests: channel().0,
            events: channel().1,
        }
    }

    /// Asks for something. A worker that died is told by [`Self::next_event`].
    pub fn ask(&self, request: Request) {
        // The other end is gone only if the worker died, which the next look at the events shows.
        let _ = self.requests.send(request);
    }

    /// The next event, if one has come.
    ///
    /// # Errors
    /// The worker died.
    pub fn next_event(&self) -> Result<Option<Event>, WorkerDied> {
        next_event(&self.events)
    }
}
