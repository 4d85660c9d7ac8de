//! Measures speed against accuracy in the background. A measurement begins only when the one before it has let go of the
//! processor, lest it disturb the times.

use super::TradePlan;
use crate::evaluation::TradePoint;
use crate::{
    app::job::{Job, Report},
    evaluation::{RunError, measure_trade},
};

/// News of the measurement begun last.
#[derive(Debug)]
pub enum TradeEvent {
    /// A point of a level.
    Measured(usize, Box<TradePoint>),
    /// The measurement has ended, or why it could not go on.
    Ended(Result<(), String>),
}

/// Measures `plan`; a measurement that still runs is cancelled.
pub fn measure(job: &mut Job<TradeEvent>, plan: TradePlan) {
    job.start(
        move |report| measure_all(&plan, report),
        |ended| {
            let ended = ended.map_err(|error| format!("{error}; what is measured stays"));
            TradeEvent::Ended(ended.and_then(|measured| measured.map_err(|error| error.to_string())))
        },
    );
}

/// Level by level, in each preset by preset; tells each point as it is measured.
fn measure_all(plan: &TradePlan, report: &Report<TradeEvent>) -> Result<(), RunError> {
    for (level, &noise) in plan.noises.iter().enumerate() {
        for &preset in &plan.presets {
            let settings = plan.settings(preset, noise);
            let is_whole = measure_trade(
                preset,
                &settings,
                &plan.hidden,
                &plan.decoders,
                || report.is_cancelled(),
                |point| report.send(TradeEvent::Measured(level, Box::new(point))),
            )?;
            if !is_whole {
                return Ok(());
            }
        }
    }
    Ok(())
}
