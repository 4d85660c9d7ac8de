//! Measures speed against accuracy in the background. A measurement begins only when the one before it has let go of the
//! processor, lest it disturb the times.

use std::{path::Path, sync::Arc};

use super::TradeOffPlan;
use crate::window::job::{Job, Report};
use decoupler_core::evaluation::{Run, TradeOffPoint, Workload, decoded_unit, measure_trade_off};
use decoupler_files::{
    export::NetworkFile,
    import::{Recorded, Setup, SetupSets},
};

/// Event of the measurement begun last.
#[derive(Debug)]
pub enum TradeOffEvent {
    /// The samples of a run are there.
    Samples {
        /// Unit of them on which a decoder is timed, such as "a sample".
        decoded: String,
        /// Origin of recorded samples.
        recorded: Option<Box<Recorded>>,
    },
    /// A point of a level, with the file of its network if it has one.
    Measured(usize, Box<TradeOffPoint>, Option<Arc<NetworkFile>>),
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
            let recorded = sets.recorded();
            report.send(TradeOffEvent::Samples {
                decoded: decoded_unit(&sets.sets.test),
                recorded: recorded.cloned().map(Box::new),
            });
            // Several decoders use one network.
            let mut last_file: Option<Arc<NetworkFile>> = None;
            let is_whole = measure_trade_off(
                run.setup.settings(),
                &sets.sets,
                &plan.hidden,
                &run.decoders,
                is_cancelled,
                |kind, point, trained: Option<&Run>| {
                    report.send(match point {
                        Ok(point) => {
                            let point = TradeOffPoint {
                                preset: run.preset,
                                ..point
                            };
                            last_file = trained.and_then(|trained| {
                                let last = last_file.take().filter(|file| file.settings == *trained.settings());
                                last.or_else(|| NetworkFile::from_run(trained, recorded).ok().map(Arc::new))
                            });
                            TradeOffEvent::Measured(level, Box::new(point), last_file.clone())
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
