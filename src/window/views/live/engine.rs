//! The decoding thread: a session decodes what its source sends, and the window displays the latest.
//!
//! [`run`] is the loop. [`Command`]s change the session while it runs. A [`Snapshot`] is sent only after the window has drawn
//! the previous one, so frames do not queue up.

use std::{
    sync::mpsc::{Receiver, RecvTimeoutError},
    time::{Duration, Instant},
};

use decoupler_core::job::Job;
use decoupler_files::live::{Input, Note, Session, SessionEvent, SessionPlan};

use super::snapshot::{Screen, Snapshot};
use crate::window::job::Report;

/// Message to the thread.
pub enum Command {
    /// The last snapshot was drawn: send the next one.
    Drawn,
    /// Change the session.
    Change(Change),
}

/// Change of the session, which may fail with a reason.
pub type Change = Box<dyn FnOnce(&mut Session) -> Result<(), String> + Send>;

/// Event from the thread.
#[derive(Debug)]
pub enum LiveEvent {
    /// The latest state.
    Shown(Box<Snapshot>),
    /// A change has failed, or a recording has ended by itself, with the reason.
    Failed(String),
    /// Decoding has ended, with the reason if it could not continue.
    Ended(Result<(), String>),
}

/// Minimum time between displayed frames.
const BETWEEN_SHOWN: Duration = Duration::from_micros(16_600);
/// Maximum wait for a line of a device between checks for commands.
const BETWEEN_LOOKS: Duration = Duration::from_millis(20);
/// Maximum wait for a command while the source is paused.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// Runs `plan` until its source ends, the sender of the commands is gone, or the work is cancelled; `shown` is what was
/// displayed before.
///
/// # Errors
/// If decoding cannot begin or continue, with the reason.
pub fn run(
    mut plan: SessionPlan,
    shown: Snapshot,
    commands: &Receiver<Command>,
    report: &Report<LiveEvent>,
) -> Result<(), String> {
    plan.source = plan.source.resolved();
    let mut screen = Screen::new(&plan, shown)?;
    let mut session = match Session::open(plan, &Job::new(&|| report.is_cancelled())) {
        Err(_) if report.is_cancelled() => return Ok(()),
        opened => opened.map_err(|error| error.to_string())?,
    };
    let show = |screen: &mut Screen, session: &Session| {
        let shown = screen.show(session);
        report.progress(LiveEvent::Shown(Box::new(shown)), |_, _| {});
    };
    let (mut is_drawn, mut has_news, mut may_show_at) = (true, false, Instant::now());
    let end = loop {
        if report.is_cancelled() {
            break Ok(());
        }
        let now = Instant::now();
        if has_news && is_drawn && may_show_at <= now {
            show(&mut screen, &session);
            (has_news, is_drawn, may_show_at) = (false, false, now + BETWEEN_SHOWN);
        }
        let mut until = session.input.due(now).unwrap_or(now + LONGEST_WAIT);
        if has_news && is_drawn {
            until = until.min(may_show_at);
        }
        match commands.recv_timeout(until.saturating_duration_since(now)) {
            Ok(Command::Drawn) => is_drawn = true,
            Ok(Command::Change(change)) => {
                screen.follow_recording(&session);
                has_news = true;
                change(&mut session).unwrap_or_else(|reason| report.send(LiveEvent::Failed(reason)));
            }
            Err(RecvTimeoutError::Timeout) => match session.next(Instant::now(), BETWEEN_LOOKS) {
                SessionEvent::Answer => {
                    session.count();
                    (has_news, screen.has_answer) = (true, true);
                }
                SessionEvent::Bad(_) => {
                    has_news = true;
                    // The truth is that of a frame without an answer.
                    screen.has_answer &= session.input.truth().is_none();
                }
                SessionEvent::Nothing => {
                    let is_stream = matches!(session.input, Input::Lines(_));
                    has_news |= is_stream && session.tally.falls_silent(Instant::now());
                }
                SessionEvent::End(end) => break end.map_err(|error| error.to_string()),
            },
            Err(RecvTimeoutError::Disconnected) => break Ok(()),
        }
        for note in std::mem::take(&mut session.notes) {
            if let Note::RecordingEnded(recorded, reason) = note {
                screen.shown.recorded = Some(recorded);
                show(&mut screen, &session);
                report.send(LiveEvent::Failed(reason));
            }
        }
    };
    // The last frame stays on the screen.
    show(&mut screen, &session);
    end
}
