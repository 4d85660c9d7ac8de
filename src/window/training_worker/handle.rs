use std::{
    cell::Cell,
    sync::{
        Arc,
        atomic::{AtomicU64, AtomicUsize, Ordering},
        mpsc::{Sender, channel},
    },
};

use super::{Event, Request, training_loop::TrainingLoop};
use crate::window::job::{Job, Wake};

/// The window's end of the worker.
#[derive(Debug)]
pub struct Worker {
    requests: Sender<Request>,
    job: Job<Event>,
    /// Preparations of trainings asked for, and answered.
    asked: Cell<u64>,
    answered: Cell<u64>,
    /// The last of those that are cancelled; those before are too.
    cancelled: Arc<AtomicU64>,
    /// The displayed snapshot.
    snapshot: Arc<AtomicUsize>,
}

impl Worker {
    /// Starts the thread. `wake` is called after each event.
    pub fn start(wake: Wake) -> Self {
        let (requests, incoming) = channel();
        let cancelled = Arc::<AtomicU64>::default();
        let mut job = Job::new("training", wake);
        let snapshot = Arc::<AtomicUsize>::default();
        let (in_thread, shown) = (Arc::clone(&cancelled), Arc::clone(&snapshot));
        job.start(
            move |report| TrainingLoop::new(report, &in_thread, &shown).run(&incoming),
            |ended| Event::Died(ended.err()),
        );
        Self {
            requests,
            job,
            asked: Cell::default(),
            answered: Cell::default(),
            cancelled,
            snapshot,
        }
    }

    /// A worker that is dying; `wake` is called when it has died.
    #[cfg(test)]
    pub fn dying(wake: Wake) -> Self {
        let mut dead = Self::start(wake);
        dead.requests = channel().0;
        dead.job.start(|_| panic!("a test"), |ended| Event::Died(ended.err()));
        dead
    }

    /// Asks for something. Stopping cancels a training that is being prepared, too. A worker that died is told by
    /// [`Self::next_event`].
    pub fn ask(&self, request: Request) {
        match request {
            Request::Train(_) | Request::Open(_) | Request::TakeUp(..) => self.asked.set(self.asked.get() + 1),
            Request::Stop => self.cancelled.store(self.asked.get(), Ordering::Relaxed),
            _ => {}
        }
        // The other end is gone only if the worker died.
        let _ = self.requests.send(request);
    }

    /// Lays the surfaces of later results through the nodes of this snapshot.
    pub fn watch(&self, snapshot: usize) {
        self.snapshot.store(snapshot, Ordering::Relaxed);
    }

    /// Returns true while a training is being prepared and not cancelled.
    pub fn is_preparing(&self) -> bool {
        self.asked.get() > self.answered.get().max(self.cancelled.load(Ordering::Relaxed))
    }

    /// The next event, if one has come.
    pub fn next_event(&self) -> Option<Event> {
        loop {
            let event = self.job.next_event()?;
            if let Event::Began(_) | Event::Opened(_) | Event::Abandoned = event {
                self.answered.set(self.answered.get() + 1);
            }
            let is_cancelled = self.answered.get() <= self.cancelled.load(Ordering::Relaxed);
            match event {
                Event::Abandoned => {}
                // What cannot begin is of no interest any more.
                Event::Began(Err(_)) | Event::Opened(Err(_)) if is_cancelled => {}
                event => return Some(event),
            }
        }
    }
}
