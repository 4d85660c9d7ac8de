//! Calibration of prediction intervals and of the drift monitor after a training on a recording.

use std::io::Write;

use clap::ValueEnum;
use decoupler_core::{
    evaluation::{Intervals, NoIntervals, Run},
    live::DriftMonitor,
};
use decoupler_files::{
    export::{NetworkFile, format_duration},
    import::SetupSets,
};

use super::{interruption::Graceful, output::messages};

/// When to calibrate 90 % prediction intervals by cross-validation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum WhenCalibrated {
    /// If it takes at most a minute.
    #[default]
    Auto,
    Always,
    Never,
}

/// Sets the intervals of a finished `run` on a recording: those that its choice of settings has already given, or
/// otherwise by cross-validation of its training samples. Ctrl-C leaves them out.
pub(super) fn calibrate(
    run: &mut Run,
    sets: &SetupSets,
    chosen: Option<Result<Intervals, NoIntervals>>,
    when: WhenCalibrated,
) {
    let Some(recordings) = &sets.recordings else {
        return;
    };
    if when == WhenCalibrated::Never || run.intervals().is_some() {
        return;
    }
    let by = recordings.recorded.plan.division.by;
    // A training that failed is not one of those that gave the held-out answers.
    let calibrated = match chosen.filter(|_| run.defect().is_none()) {
        Some(calibrated) => calibrated,
        None => {
            let time = Intervals::time(run);
            if let Some(time) = time.filter(|time| when == WhenCalibrated::Auto && *time > Intervals::MAX_TIME) {
                note(&format!(
                    "No prediction intervals: they take about {}; give --intervals always",
                    format_duration(time)
                ));
                return;
            }
            if let Some(time) = time.filter(|time| time.as_secs_f64() > 2.0) {
                note(&format!(
                    "Calibrating the prediction intervals by cross-validation takes about {}",
                    format_duration(time)
                ));
            }
            let graceful = Graceful::begin();
            let is_cancelled = || graceful.is_end_requested();
            Intervals::cross_validate(run.settings(), &sets.sets.split.training, by, &is_cancelled)
        }
    };
    match calibrated {
        Ok(intervals) => run.set_intervals(intervals, by),
        // The training is complete without them.
        Err(reason) => note(&format!("No prediction intervals: {reason}")),
    }
}

fn note(message: &str) {
    // There is no one to report to if this fails.
    let _ = writeln!(messages(), "{message}");
}

/// Monitor of the readings of a decoded input, which warns on standard error.
pub(super) struct Drift(Option<DriftMonitor>);

impl Drift {
    pub(super) fn new(file: &NetworkFile) -> Self {
        Self(file.drift.clone().map(DriftMonitor::new))
    }

    /// Takes the readings of a line, and warns once if the readings have drifted.
    pub(super) fn take(&mut self, line: u64, readings: &[f64]) {
        let Some(monitor) = &mut self.0 else { return };
        if monitor.take(readings) {
            let block = monitor.reference().readings_per_block();
            note(&format!(
                "warning: line {line}: the latest readings no longer look like the training readings, and the prediction \
                 intervals no longer hold: recalibrate (re-zero the sensor, or train with recent samples); in readings like \
                 those of the training, a false alarm occurs on average once in {} lines or less often",
                DriftMonitor::BLOCKS_BETWEEN_FALSE_ALARMS * block as f64
            ));
        }
    }
}
