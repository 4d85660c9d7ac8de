use std::{
    collections::VecDeque,
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

/// Makes the window draw a frame, in which it takes events.
pub(in crate::window) type Wake = Arc<dyn Fn() + Send + Sync>;

/// Lies between one piece of work and the window: events one way, the wish to cancel the other.
pub(super) struct Mailbox<E> {
    is_cancelled: AtomicBool,
    inside: Mutex<Inside<E>>,
    ended: Condvar,
}

struct Inside<E> {
    events: VecDeque<E>,
    /// True if the youngest of `events` is a progress, which the next progress replaces.
    has_progress: bool,
    has_ended: bool,
}

impl<E> Mailbox<E> {
    pub(super) fn new() -> Self {
        Self {
            is_cancelled: AtomicBool::new(false),
            inside: Mutex::new(Inside {
                events: VecDeque::new(),
                has_progress: false,
                has_ended: false,
            }),
            ended: Condvar::new(),
        }
    }

    fn inside(&self) -> MutexGuard<'_, Inside<E>> {
        // Events are put in and taken out whole.
        self.inside.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn next_event(&self) -> Option<E> {
        self.inside().events.pop_front()
    }

    pub(super) fn has_more(&self) -> bool {
        let inside = self.inside();
        !inside.has_ended || !inside.events.is_empty()
    }

    pub(super) fn cancel(&self) {
        self.is_cancelled.store(true, Ordering::Relaxed);
    }

    /// Waits until the work has ended, at most as long as given; returns whether it has.
    pub(super) fn wait_for_end(&self, longest: Option<Duration>) -> bool {
        let inside = self.inside();
        let runs = |inside: &mut Inside<E>| !inside.has_ended;
        let inside = match longest {
            None => self
                .ended
                .wait_while(inside, runs)
                .unwrap_or_else(PoisonError::into_inner),
            Some(longest) => {
                let waited = self.ended.wait_timeout_while(inside, longest, runs);
                waited.unwrap_or_else(PoisonError::into_inner).0
            }
        };
        inside.has_ended
    }
}

/// The work's end of the mailbox.
pub(in crate::window) struct Report<E> {
    mailbox: Arc<Mailbox<E>>,
    wake: Wake,
}

impl<E> Report<E> {
    pub(super) fn new(mailbox: Arc<Mailbox<E>>, wake: Wake) -> Self {
        Self { mailbox, wake }
    }

    /// Returns true if the work is to end.
    pub(in crate::window) fn is_cancelled(&self) -> bool {
        self.mailbox.is_cancelled.load(Ordering::Relaxed)
    }

    /// Tells an event that must not be lost.
    pub(in crate::window) fn send(&self, event: E) {
        self.put(|inside| {
            inside.events.push_back(event);
            inside.has_progress = false;
        });
    }

    /// Tells the status of the work. It replaces the progress before, if the window has not taken that and nothing was told
    /// since: a window that looks away finds the latest only. `keep` moves what must not be lost from the older one.
    pub(in crate::window) fn progress(&self, event: E, keep: impl FnOnce(E, &mut E)) {
        self.put(|inside| {
            let mut event = event;
            if inside.has_progress
                && let Some(older) = inside.events.pop_back()
            {
                keep(older, &mut event);
            }
            inside.events.push_back(event);
            inside.has_progress = true;
        });
    }

    /// Tells the last event.
    pub(super) fn end(&self, event: E) {
        self.put(|inside| {
            inside.events.push_back(event);
            inside.has_ended = true;
        });
        self.mailbox.ended.notify_all();
    }

    fn put(&self, change: impl FnOnce(&mut Inside<E>)) {
        change(&mut self.mailbox.inside());
        (self.wake)();
    }
}
