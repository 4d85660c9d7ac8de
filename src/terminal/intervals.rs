//! Calibration of prediction intervals and of the drift monitor after a training on a recording.

use std::{io::Write, time::Duration};

use clap::ValueEnum;
use decoupler_core::{
    evaluation::{Channel, Coverage, Intervals, Run, RunError},
    live::DriftMonitor,
};
use decoupler_files::{
    export::{NetworkFile, format_duration, format_number},
    import::SetupSets,
};

use super::{interruption::Graceful, output::messages};

/// When to calibrate 90 % prediction intervals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum WhenCalibrated {
    /// If it takes at most a minute.
    #[default]
    Auto,
    Always,
    Never,
}

/// Longest estimated time in seconds for which intervals are calibrated without being requested.
const MAX_SECONDS: f64 = 60.0;

/// Calibrates the intervals of a finished `run` on a recording, by cross-validation of its training samples. Ctrl-C
/// leaves them out.
pub(super) fn calibrate(run: &mut Run, sets: &SetupSets, when: WhenCalibrated) -> Result<(), RunError> {
    let Some(recordings) = &sets.recordings else {
        return Ok(());
    };
    if when == WhenCalibrated::Never || run.intervals().is_some() {
        return Ok(());
    }
    // Each of the folds trains on the share (k − 1) / k of the samples.
    let seconds = run
        .wall_time()
        .map(|time| (Intervals::FOLDS - 1) as f64 * time.as_secs_f64());
    let describe = |seconds| format_duration(Duration::try_from_secs_f64(seconds).unwrap_or_default());
    if let Some(seconds) = seconds.filter(|seconds| when == WhenCalibrated::Auto && *seconds > MAX_SECONDS) {
        note(&format!(
            "No prediction intervals: they take about {}; give --intervals always",
            describe(seconds)
        ));
        return Ok(());
    }
    if let Some(seconds) = seconds.filter(|seconds| *seconds > 2.0) {
        let seconds = describe(seconds);
        note(&format!(
            "Calibrating the prediction intervals by cross-validation takes about {seconds}"
        ));
    }
    let by = recordings.recorded.plan.division.by;
    let graceful = Graceful::begin();
    let is_cancelled = || graceful.is_end_requested();
    let training = &sets.sets.split.training;
    match Intervals::cross_validate(run.settings(), training, by, &is_cancelled) {
        Ok(Some(intervals)) if intervals.is_empty() => {
            note(
                "No prediction intervals: there are fewer than 9 independent training samples (their errors are \
                 correlated in time or within groups)",
            );
            Ok(())
        }
        Ok(Some(intervals)) => {
            run.set_intervals(intervals, by);
            Ok(())
        }
        Ok(None) => {
            note("No prediction intervals: interrupted");
            Ok(())
        }
        // Too few groups for a cross-validation.
        Err(RunError::Folds(error)) => {
            note(&format!("No prediction intervals: {error}"));
            Ok(())
        }
        Err(error) => Err(error),
    }
}

fn note(message: &str) {
    // There is no one to report to if this fails.
    let _ = writeln!(messages(), "{message}");
}

/// Warns of the targets whose intervals contain significantly fewer test samples than stated, with cause and remedy.
pub(super) fn describe_coverage(targets: &[Channel], coverage: &[Option<Coverage>]) -> Vec<String> {
    let low = targets
        .iter()
        .zip(coverage)
        .filter_map(|(target, coverage)| Some((target, coverage.as_ref().filter(|of| of.is_too_low())?)));
    let describe = |(target, coverage): (&Channel, &Coverage)| {
        let percent = |share: f64| format!("{:.0}", 100.0 * share);
        let cause = if coverage.bias.abs() > 0.5 * coverage.half_width {
            format!(
                "the test part is offset from the training part (mean error {}, half-width {}): re-zero the sensor, or \
                 record training data closer to the time of use",
                format_number(coverage.bias),
                format_number(coverage.half_width)
            )
        } else {
            "the test part differs from the training part: record training data that cover its conditions, or split by \
             group"
                .to_owned()
        };
        format!(
            "the 90 % intervals of {} contain {} % of the test samples (expected {} to {} %): {cause}",
            target.name,
            percent(coverage.share),
            percent(coverage.expected[0]),
            percent(coverage.expected[1])
        )
    };
    low.map(describe).collect()
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
