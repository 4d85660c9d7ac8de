//! Measures speed against accuracy in the background. A measurement begins only when the one before it has let go of the
//! processor, lest it disturb the times.

use std::path::Path;

use super::TradeOffPlan;
use crate::{
    app::job::{Job, Report},
    evaluation::{TradeOffPoint, Workload, decoded_unit, measure_trade_off},
    import::{Setup, SetupSets},
};

/// Event of the measurement begun last.
#[derive(Debug)]
pub enum TradeOffEvent {
    /// The samples of a run are there; a decoder is timed on this unit of them, such as "a sample".
    Decodes(String),
    /// A point of a level.
    Measured(usize, Box<TradeOffPoint>),
    /// A decoder cannot be used with the samples of a level, and why.
    Refused(usize, String),
    /// The measurement has ended, or why it could not go on.
    Ended(Result<(), String>),
}

/// Measures `plan`; a measurement that still runs is cancelled.
pub fn measure(job: &mut Job<TradeOffEvent>, plan: TradeOffPlan) {
    job.start(
        move |report| measure_all(&plan, report),
        |ended| {
            let ended = ended.map_err(|error| format!("{error}; the points measured so far are kept"));
            TradeOffEvent::Ended(ended.and_then(|measured| measured))
        },
    );
}

/// Level by level, in each run by run; sends each point as it is measured.
fn measure_all(plan: &TradeOffPlan, report: &Report<TradeOffEvent>) -> Result<(), String> {
    let is_cancelled = || report.is_cancelled();
    let mut last: Option<(&Setup, SetupSets)> = None;
    for (level, planned) in plan.levels.iter().enumerate() {
        for run in &planned.runs {
            if let Some(settings) = run.setup.simulated() {
                let workload = Workload::of_trade_off(&settings, &plan.hidden, &run.decoders);
                let checked = workload.and_then(|workload| workload.check_memory());
                checked.map_err(|error| error.to_string())?;
            }
            let sets = match last.take() {
                // The same samples of a recording are read once.
                Some((of, sets)) if of.plan().is_some() && of.plan() == run.setup.plan() => sets,
                _ => {
                    let sets = run.setup.sets(Path::new(""), &is_cancelled, &mut |_| ());
                    let Some(sets) = sets.map_err(|error| error.to_string())? else {
                        return Ok(());
                    };
                    sets
                }
            };
            report.send(TradeOffEvent::Decodes(decoded_unit(&sets.sets.test)));
            let is_whole = measure_trade_off(
                run.setup.settings(),
                &sets.sets,
                &plan.hidden,
                &run.decoders,
                is_cancelled,
                |kind, point| {
                    report.send(match point {
                        Ok(point) => {
                            let preset = run.preset;
                            TradeOffEvent::Measured(level, Box::new(TradeOffPoint { preset, ..point }))
                        }
                        Err(error) => TradeOffEvent::Refused(level, format!("{kind}: {error}")),
                    });
                },
            );
            if !is_whole.map_err(|error| error.to_string())? {
                return Ok(());
            }
            last = Some((&run.setup, sets));
        }
    }
    Ok(())
}
