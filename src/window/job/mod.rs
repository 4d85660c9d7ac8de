//! Background work: [`Background`] work runs one task at a time on a named thread; a newer task replaces an older one. [`Jobs`]
//! lists those that run, by name.
//!
//! A task sends events through a [`Report`], which wakes the window; the window receives them with [`Background::next_event`].
//! Every task has its own mailbox, so events of an older task are never seen.

use std::{
    any::Any,
    collections::VecDeque,
    fmt,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use thiserror::Error;
use thread_priority::{ThreadPriority, ThreadPriorityValue};

/// Maximum time to wait for cancelled work when closing. Work that takes longer ends with the program.
const LONGEST_WAIT: Duration = Duration::from_millis(150);

/// Reasons why work ends without a result.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum JobError {
    /// A bug in the program.
    #[error("an internal error stopped the thread '{name}': {panic}. Other work is not affected")]
    Panicked {
        /// The thread.
        name: &'static str,
        /// Message of the panic.
        panic: String,
    },
    /// The system cannot start another thread.
    #[error("no thread could be started: {0}")]
    NoThread(String),
}

/// The jobs of the window that run now. Each is listed by its name; its events have a type of their own and go to the part of the
/// window that started it, as one list of all events would hold values whose type is known only when they are taken out.
#[derive(Clone)]
pub struct Jobs {
    /// Called after each event.
    wake: Wake,
    running: Arc<Mutex<Vec<Arc<Running>>>>,
}

/// A job that runs.
#[derive(Default)]
struct Running {
    name: &'static str,
    is_cancelled: AtomicBool,
    /// True while it waits for requests, a file or the user.
    is_waiting: AtomicBool,
}

impl Jobs {
    /// None yet. `wake` is called after each event of a job.
    pub(super) fn new(wake: Wake) -> Self {
        let running = Arc::default();
        Self { wake, running }
    }

    /// Asks all jobs to end.
    pub(super) fn cancel_all(&self) {
        let cancel = |job: &Arc<Running>| job.is_cancelled.store(true, Ordering::Relaxed);
        self.running().iter().for_each(cancel);
    }

    /// Returns the name of a job that computes, other than `name`.
    fn computing(&self, name: &str) -> Option<&'static str> {
        let computes = |job: &&Arc<Running>| job.name != name && !job.is_waiting.load(Ordering::Relaxed);
        self.running().iter().find(computes).map(|job| job.name)
    }

    fn running(&self) -> MutexGuard<'_, Vec<Arc<Running>>> {
        // A panic elsewhere cannot leave the list in an invalid state.
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Background work, one task at a time. Dropping it cancels the task and waits briefly for its end.
pub(super) struct Background<E> {
    name: &'static str,
    jobs: Jobs,
    /// True for long computations, which run at lower priority than the window.
    yields: bool,
    /// Events of the newest task.
    newest: Option<Arc<Mailbox<E>>>,
    thread: Option<JoinHandle<()>>,
    is_abandoned: bool,
}

impl<E: Send + 'static> Background<E> {
    /// Creates a job without work, which is listed among `jobs` by the name of its threads. The work runs at lower priority than
    /// the window.
    pub(super) fn new(name: &'static str, jobs: &Jobs) -> Self {
        Self {
            name,
            jobs: jobs.clone(),
            yields: true,
            newest: None,
            thread: None,
            is_abandoned: false,
        }
    }

    /// As [`Self::new`], at normal priority: for work that the user is waiting for.
    pub(super) fn prompt(name: &'static str, jobs: &Jobs) -> Self {
        let mut job = Self::new(name, jobs);
        job.yields = false;
        job
    }

    /// Starts `work`. `last` turns its result into the last event, also if it panics or no thread can be started.
    ///
    /// Work that is still running is cancelled, and its events are discarded. The new work starts when the old one has ended,
    /// so that neither affects the other's timings.
    pub(super) fn start<T: 'static>(
        &mut self,
        work: impl FnOnce(&Report<E>) -> T + Send + 'static,
        last: fn(Result<T, JobError>) -> E,
    ) {
        self.cancel();
        let (name, yields) = (self.name, self.yields);
        let running = Arc::new(Running {
            name,
            ..Running::default()
        });
        self.jobs.running().push(Arc::clone(&running));
        let mailbox = Arc::new(Mailbox {
            running,
            inside: Mutex::new(Inside {
                events: VecDeque::new(),
                has_progress: false,
                has_ended: false,
            }),
            ended: Condvar::new(),
        });
        let before = self.newest.replace(Arc::clone(&mailbox));
        let report = || Report {
            mailbox: Arc::clone(&mailbox),
            jobs: self.jobs.clone(),
        };
        let [in_work, at_end] = [report(), report()];
        #[cfg(test)]
        let work = planned_panic::before(name, work);
        let run = move || {
            if yields {
                yield_to_window();
            }
            if let Some(before) = before {
                before.wait_for_end(None);
            }
            work(&in_work)
        };
        let thread = start_thread(name, run, move |result| at_end.end(last(result)));
        self.is_abandoned = false;
        self.thread = thread.map_err(|error| report().end(last(Err(error)))).ok();
    }
}

impl<E> Background<E> {
    /// Returns the next event, if one has arrived.
    pub(super) fn next_event(&self) -> Option<E> {
        self.mailbox()?.inside().events.pop_front()
    }

    /// Returns true while more events are expected.
    pub(super) fn is_under_way(&self) -> bool {
        self.mailbox().is_some_and(|mailbox| {
            let inside = mailbox.inside();
            !inside.has_ended || !inside.events.is_empty()
        })
    }

    /// Asks the work to end. Its remaining events are received.
    pub(super) fn cancel(&self) {
        if let Some(mailbox) = &self.newest {
            mailbox.running.is_cancelled.store(true, Ordering::Relaxed);
        }
    }

    /// Returns the name of another job that computes now, which would distort times.
    pub(super) fn distorted_by(&self) -> Option<&'static str> {
        self.jobs.computing(self.name)
    }

    /// Asks the work to end. Its remaining events are discarded.
    pub(super) fn abandon(&mut self) {
        self.cancel();
        self.is_abandoned = true;
    }

    fn mailbox(&self) -> Option<&Arc<Mailbox<E>>> {
        self.newest.as_ref().filter(|_| !self.is_abandoned)
    }

    /// Waits for the work to end, for at most `longest`.
    pub(super) fn wait(&mut self, longest: Duration) {
        if self
            .newest
            .as_ref()
            .is_some_and(|mailbox| mailbox.wait_for_end(Some(longest)))
            && let Some(thread) = self.thread.take()
        {
            // Panics in the work were caught.
            let _ = thread.join();
        }
    }
}

impl<E> Drop for Background<E> {
    fn drop(&mut self) {
        self.cancel();
        self.wait(LONGEST_WAIT);
    }
}

impl<E> fmt::Debug for Background<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Background")
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}

/// Runs `work` on a thread of its own, and passes its result to `end` there, also if it panics. All threads of the window
/// are started here.
///
/// # Errors
/// If the system cannot start another thread.
pub(in crate::window) fn start_thread<T: 'static>(
    name: &'static str,
    work: impl FnOnce() -> T + Send + 'static,
    end: impl FnOnce(Result<T, JobError>) + Send + 'static,
) -> Result<JoinHandle<()>, JobError> {
    let run = move || end(caught(name, work));
    let started = thread::Builder::new().name(name.to_owned()).spawn(run);
    started.map_err(|error| JobError::NoThread(error.to_string()))
}

/// Runs `work`; `name` is the name of its thread.
///
/// # Errors
/// If it panics.
pub(in crate::window) fn caught<T>(name: &'static str, work: impl FnOnce() -> T) -> Result<T, JobError> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| JobError::Panicked {
        name,
        panic: message(panic.as_ref()),
    })
}

/// Lowers the priority of this thread and those it starts a little: on a busy machine the window gets about fifteen times
/// their share, and training is not starved by other programs.
fn yield_to_window() {
    /// From 0 to 99; about 50 is normal.
    const BELOW_NORMAL: u8 = 18;
    if let Ok(priority) = ThreadPriorityValue::try_from(BELOW_NORMAL) {
        // If the system refuses, the work competes with the window.
        let _ = ThreadPriority::Crossplatform(priority).set_for_current();
    }
}

/// Returns the message of a panic.
fn message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    text.unwrap_or_else(|| "unknown cause".to_owned())
}

/// Callback that makes the window draw a frame, in which it receives events.
pub(in crate::window) type Wake = Arc<dyn Fn() + Send + Sync>;

/// Channel between a task and the window: events to the window, cancellation to the task.
struct Mailbox<E> {
    running: Arc<Running>,
    inside: Mutex<Inside<E>>,
    ended: Condvar,
}

struct Inside<E> {
    events: VecDeque<E>,
    /// True if the latest of `events` is a progress report, which the next one replaces.
    has_progress: bool,
    has_ended: bool,
}

impl<E> Mailbox<E> {
    fn inside(&self) -> MutexGuard<'_, Inside<E>> {
        // A panic elsewhere cannot leave the queue in an invalid state.
        self.inside.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for the work to end, for at most `longest`; returns true if it has ended.
    fn wait_for_end(&self, longest: Option<Duration>) -> bool {
        let longest = longest.unwrap_or(Duration::MAX);
        let runs = |inside: &mut Inside<E>| !inside.has_ended;
        let waited = self.ended.wait_timeout_while(self.inside(), longest, runs);
        waited.unwrap_or_else(PoisonError::into_inner).0.has_ended
    }
}

/// Sending end of the mailbox, used by the work.
pub(in crate::window) struct Report<E> {
    mailbox: Arc<Mailbox<E>>,
    jobs: Jobs,
}

impl<E> Report<E> {
    /// Returns true if the work should end.
    pub(in crate::window) fn is_cancelled(&self) -> bool {
        self.mailbox.running.is_cancelled.load(Ordering::Relaxed)
    }

    /// Waits for requests, a file or the user with `wait`; meanwhile the work does not compute.
    pub(in crate::window) fn waiting<T>(&self, wait: impl FnOnce() -> T) -> T {
        let is_waiting = &self.mailbox.running.is_waiting;
        is_waiting.store(true, Ordering::Relaxed);
        let waited = wait();
        is_waiting.store(false, Ordering::Relaxed);
        waited
    }

    /// Returns true while another job computes, which would distort times.
    pub(in crate::window) fn is_distorted(&self) -> bool {
        self.jobs.computing(self.mailbox.running.name).is_some()
    }

    /// Returns the result of the work, without the error with which cancelled work ends.
    pub(in crate::window) fn unless_cancelled<X>(&self, result: Result<(), X>) -> Result<(), X> {
        if self.is_cancelled() { Ok(()) } else { result }
    }

    /// Sends an event that is never replaced.
    pub(in crate::window) fn send(&self, event: E) {
        self.put(|inside| {
            inside.events.push_back(event);
            inside.has_progress = false;
        });
    }

    /// Sends a progress report. It replaces the previous one if the window has not received it and no other event was sent since,
    /// so that a hidden window receives only the latest. `keep` moves data that must not be lost from the older one.
    pub(in crate::window) fn progress(&self, mut event: E, keep: impl FnOnce(E, &mut E)) {
        self.put(|inside| {
            if inside.has_progress
                && let Some(older) = inside.events.pop_back()
            {
                keep(older, &mut event);
            }
            inside.events.push_back(event);
            inside.has_progress = true;
        });
    }

    /// Sends the last event.
    fn end(&self, event: E) {
        let running = &self.mailbox.running;
        self.jobs.running().retain(|job| !Arc::ptr_eq(job, running));
        self.put(|inside| {
            inside.events.push_back(event);
            inside.has_ended = true;
        });
        self.mailbox.ended.notify_all();
    }

    fn put(&self, change: impl FnOnce(&mut Inside<E>)) {
        change(&mut self.mailbox.inside());
        (self.jobs.wake)();
    }
}

#[cfg(test)]
pub(in crate::window) mod planned_panic {
    //! Panics planned by tests in the work of a job.

    use std::cell::Cell;

    use crate::window::job::Report;

    /// Message of the panics.
    pub(in crate::window) const MESSAGE: &str = "a planned panic";

    thread_local! {
        static PLANNED: Cell<Option<&'static str>> = const { Cell::new(None) };
    }

    /// Makes the work panic that the job of this name starts next from this thread.
    pub(in crate::window) fn plan(name: &'static str) {
        PLANNED.set(Some(name));
    }

    /// Returns true until the planned panic has been started.
    pub(in crate::window) fn is_pending() -> bool {
        PLANNED.get().is_some()
    }

    /// Returns `work` of the job `name`, preceded by a panic if that is planned.
    pub(super) fn before<E, T>(
        name: &'static str,
        work: impl FnOnce(&Report<E>) -> T + Send + 'static,
    ) -> impl FnOnce(&Report<E>) -> T + Send + 'static {
        let panics = PLANNED.get() == Some(name);
        if panics {
            PLANNED.set(None);
        }
        move |report| {
            assert!(!panics, "{MESSAGE}");
            work(report)
        }
    }
}
#[cfg(test)]
mod tests;
