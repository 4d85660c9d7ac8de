//! The thread that measures. It yields to the window. A measurement begins only when the one before it has let go of
//! the processor, lest it disturb the times.

use std::{
    fmt, io,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc::{Receiver, channel},
    },
    thread::{self, JoinHandle},
};

use super::TradePlan;
use crate::{
    app::threads::{LastEvent, Report, Wake, yield_to_window},
    evaluation::{RunError, TradePoint, measure_trade},
};

/// Tells measurements apart that were begun in one window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TradeNumber(u64);

/// What the threads tell the window. What a cancelled measurement still had in hand comes with its own number.
#[derive(Debug)]
pub enum TradeEvent {
    /// A point of a level.
    Measured(TradeNumber, usize, Box<TradePoint>),
    /// The measurement has ended, or why it could not go on.
    Ended(TradeNumber, Result<(), String>),
}

/// The window's end of the threads.
pub struct TradeWorker {
    report: Report<TradeEvent>,
    events: Receiver<TradeEvent>,
    is_cancelled: Arc<AtomicBool>,
    latest: TradeNumber,
    thread: Option<JoinHandle<()>>,
}

impl TradeWorker {
    /// No thread yet. `wake` is called after each event.
    pub fn new(wake: Wake) -> Self {
        let (outgoing, events) = channel();
        Self {
            report: Report::new(outgoing, wake),
            events,
            is_cancelled: Arc::default(),
            latest: TradeNumber::default(),
            thread: None,
        }
    }

    /// Measures `plan` and tells its number; a measurement that still runs is cancelled.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn measure(&mut self, plan: TradePlan) -> io::Result<TradeNumber> {
        self.cancel();
        let number = TradeNumber(self.latest.0 + 1);
        self.is_cancelled = Arc::default();
        let is_cancelled = Arc::clone(&self.is_cancelled);
        let before = self.thread.take();
        let died = "The measurement ended unexpectedly; what is measured stays.".to_owned();
        let mut ending = LastEvent::new(self.report.clone(), TradeEvent::Ended(number, Err(died)));
        let work = move || {
            yield_to_window();
            if let Some(before) = before {
                // However it ended.
                let _ = before.join();
            }
            let result = measure_all(&plan, &is_cancelled, |level, point| {
                ending.send(TradeEvent::Measured(number, level, Box::new(point)));
            });
            ending.replace(TradeEvent::Ended(number, result.map_err(|error| error.to_string())));
        };
        self.thread = Some(thread::Builder::new().name("trade".to_owned()).spawn(work)?);
        self.latest = number;
        Ok(number)
    }

    /// Ends the measurement. Its thread ends after the epoch or the decoder in progress, which nobody waits for.
    pub fn cancel(&self) {
        self.is_cancelled.store(true, Ordering::Relaxed);
    }

    /// The next event, if one has come.
    pub fn next_event(&self) -> Option<TradeEvent> {
        self.events.try_recv().ok()
    }
}

/// Level by level, in each preset by preset; hands over each point as it is measured.
fn measure_all(
    plan: &TradePlan,
    is_cancelled: &AtomicBool,
    mut on_point: impl FnMut(usize, TradePoint),
) -> Result<(), RunError> {
    for (level, &noise) in plan.noises.iter().enumerate() {
        for &preset in &plan.presets {
            let settings = plan.settings(preset, noise);
            let is_whole = measure_trade(
                preset,
                &settings,
                &plan.hidden,
                &plan.decoders,
                || is_cancelled.load(Ordering::Relaxed),
                |point| on_point(level, point),
            )?;
            if !is_whole {
                return Ok(());
            }
        }
    }
    Ok(())
}

impl Drop for TradeWorker {
    fn drop(&mut self) {
        self.cancel();
    }
}

impl fmt::Debug for TradeWorker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TradeWorker").finish_non_exhaustive()
    }
}
