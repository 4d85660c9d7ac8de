//! Calibration of prediction intervals and of the drift monitor after a training on a recording.

use clap::ValueEnum;
use decoupler_core::{
    evaluation::{Intervals, Run, RunError},
    job::Job,
    live::{Drift, DriftMonitor, DriftReference},
};
use decoupler_files::{
    export::{NetworkFile, format_duration},
    import::SetupSets,
};

use super::{
    interruption::Graceful,
    output::{note, warn},
};

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
pub(super) fn calibrate(run: &mut Run, sets: &SetupSets, when: WhenCalibrated) {
    let Some(recordings) = &sets.recordings else {
        return;
    };
    if when == WhenCalibrated::Never || run.intervals().is_some() {
        return;
    }
    let by = recordings.recorded.plan.division.by;
    // A training that failed is not one of those that gave the held-out answers.
    let calibrated = match sets.chosen_intervals().filter(|_| run.defect().is_none()) {
        Some(calibrated) => calibrated,
        None => {
            let time = Intervals::time(run);
            if let Some(time) = time.filter(|time| when == WhenCalibrated::Auto && *time > Intervals::MAX_TIME) {
                note(format_args!(
                    "No prediction intervals: they take about {}; give --intervals always",
                    format_duration(time)
                ));
                return;
            }
            if let Some(time) = time.filter(|time| time.as_secs_f64() > 2.0) {
                note(format_args!(
                    "Calibrating the prediction intervals by cross-validation takes about {}",
                    format_duration(time)
                ));
            }
            let graceful = Graceful::begin();
            let is_cancelled = || graceful.is_end_requested();
            Intervals::cross_validate(run.settings(), &sets.sets.split.training, by, &Job::new(&is_cancelled))
        }
    };
    match calibrated {
        Ok(intervals) => run.set_intervals(intervals),
        // The training is complete without them.
        Err(RunError::Cancelled(_)) => note("No prediction intervals: interrupted"),
        Err(reason) => note(format_args!("No prediction intervals: {reason}")),
    }
}

/// Reports why drift of the readings of a recording's network is not monitored, if it is not.
pub(super) fn note_unmonitored(file: &NetworkFile) {
    if let (Err(reason), None) = (&file.drift, &file.problem.sensor) {
        note(format_args!("Drift of the readings is not monitored: {reason}"));
    }
}

/// Reports that a drift of a stream has begun or ended at this line.
pub(super) fn note_drift(file: &NetworkFile, line: u64, drift: &Drift) {
    if drift.has_ended {
        note(format_args!(
            "line {line}: since line {}, the readings look like the training readings again",
            drift.last + 1
        ));
    } else {
        warn(warning(
            file,
            &format!("line {line} (since line {})", drift.first),
            drift,
        ));
    }
}

fn warning(file: &NetworkFile, lines: &str, drift: &Drift) -> String {
    let block = file.drift.as_ref().map_or(1, DriftReference::readings_per_block);
    format!(
        "{lines}: the readings no longer look like the training readings ({}), and the prediction intervals do \
         not hold: check the sensor and its connection, re-zero it, or train with recent samples; in readings like those \
         of the training, a false alarm occurs on average once in {} lines or less often",
        drift.describe(&file.problem.inputs),
        DriftMonitor::BLOCKS_BETWEEN_FALSE_ALARMS * block as f64
    )
}

/// Monitor of the readings of a decoded file, which warns on standard error at its end.
pub(super) struct DriftWarnings<'a> {
    monitor: Option<DriftMonitor>,
    file: &'a NetworkFile,
    lines: u64,
    ended: Vec<Drift>,
}

impl<'a> DriftWarnings<'a> {
    /// Monitors the readings of a file, or reports why they cannot be monitored.
    pub(super) fn new(file: &'a NetworkFile) -> Self {
        note_unmonitored(file);
        Self {
            monitor: file.drift.clone().ok().map(DriftMonitor::new),
            file,
            lines: 0,
            ended: Vec::new(),
        }
    }

    /// Takes the readings of a line.
    pub(super) fn take(&mut self, line: u64, readings: &[f64]) {
        let Some(monitor) = &mut self.monitor else { return };
        self.lines += 1;
        self.ended
            .extend(monitor.take(line, readings).filter(|drift| drift.has_ended));
    }

    /// Warns of the lines of a file whose readings drifted.
    pub(super) fn end(&self) {
        /// Maximum number of parts of the file that are listed.
        const MAX_LISTED: usize = 5;
        let Some(monitor) = &self.monitor else { return };
        let needed = (monitor.reference().readings_per_block() * monitor.reference().blocks_in_a_row()) as u64;
        if self.lines < needed {
            note(format_args!(
                "Drift of the readings is not monitored: this takes at least {needed} lines, and there are {}",
                self.lines
            ));
        }
        let drifts = self.ended.iter().chain(monitor.drift());
        for drift in drifts.clone().take(MAX_LISTED) {
            let lines = format!("lines {} to {}", drift.first, drift.last);
            warn(warning(self.file, &lines, drift));
        }
        if let more @ 1.. = drifts.count().saturating_sub(MAX_LISTED) {
            warn(format_args!("and {more} more such parts of the file"));
        }
    }
}
