//! Measures speed against accuracy in the background. A measurement begins only when the one before it has let go of the
//! processor, lest it disturb the times.

use super::TradeOffPlan;
use crate::evaluation::TradeOffPoint;
use crate::{
    app::job::{Job, Report},
    evaluation::{RunError, Workload, measure_trade_off},
};

/// News of the measurement begun last.
#[derive(Debug)]
pub enum TradeOffEvent {
    /// A point of a level.
    Measured(usize, Box<TradeOffPoint>),
    /// The measurement has ended, or why it could not go on.
    Ended(Result<(), String>),
}

/// Measures `plan`; a measurement that still runs is cancelled.
pub fn measure(job: &mut Job<TradeOffEvent>, plan: TradeOffPlan) {
    job.start(
        move |report| measure_all(&plan, report),
        |ended| {
            let ended = ended.map_err(|error| format!("{error}; the points measured so far are kept"));
            TradeOffEvent::Ended(ended.and_then(|measured| measured.map_err(|error| error.to_string())))
        },
    );
}

/// Level by level, in each preset by preset; tells each point as it is measured.
fn measure_all(plan: &TradeOffPlan, report: &Report<TradeOffEvent>) -> Result<(), RunError> {
    for (level, &noise) in plan.noises.iter().enumerate() {
        for &preset in &plan.presets {
            let settings = plan.settings(preset, noise);
            let is_cancelled = || report.is_cancelled();
            Workload::of_trade_off(&settings, &plan.hidden, &plan.decoders)?.check_memory()?;
            let Some(sets) = settings.checked_sets_unless(&is_cancelled)? else {
                return Ok(());
            };
            let mut refused = Ok(());
            let is_whole = measure_trade_off(
                &settings.into(),
                &sets,
                &plan.hidden,
                &plan.decoders,
                is_cancelled,
                |_, point| match point {
                    Ok(point) => {
                        let preset = Some(preset);
                        let point = Box::new(TradeOffPoint { preset, ..point });
                        report.send(TradeOffEvent::Measured(level, point));
                    }
                    Err(error) => refused = Err(error),
                },
            )?;
            refused?;
            if !is_whole {
                return Ok(());
            }
        }
    }
    Ok(())
}
