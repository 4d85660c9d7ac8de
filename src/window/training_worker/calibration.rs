use decoupler_core::{
    dataset::{Dataset, SplitBy},
    evaluation::{Intervals, Run, RunError},
    job::Job,
    training::StopReason,
};
use decoupler_files::{export::format_duration, import::SetupSets};

/// Calibration of the prediction intervals of a training on a recording, when it has ended.
pub struct Calibration {
    training: Dataset,
    /// Rule by which samples are held out.
    by: SplitBy,
    /// Intervals from the held-out answers of the choice of settings; `None` if they were not chosen.
    chosen: Option<Result<Intervals, RunError>>,
}

impl Calibration {
    /// Prepares the calibration of a training on `sets`; `None` for a simulated array, whose decoders are compared with the
    /// error that is possible in its scene.
    pub fn of(sets: &SetupSets) -> Option<Self> {
        let by = sets.recorded()?.plan.division.by;
        Some(Self {
            training: sets.sets.split.training.clone(),
            by,
            chosen: sets.chosen_intervals(),
        })
    }

    /// Forgets the choice of settings, because the training continues with others.
    pub fn forget_choice(&mut self) {
        self.chosen = None;
    }

    /// Calibrates the intervals of `run`, which has ended, without further trainings if its settings were chosen.
    /// The job is checked in every epoch.
    ///
    /// # Errors
    /// The reason why there are none.
    pub fn calibrate(&self, run: &Run, job: &Job<'_>) -> Result<Intervals, String> {
        let calibrated = match &self.chosen {
            _ if run.stop_reason() == Some(StopReason::Stopped) => {
                return Err("no 90 % intervals: the training was stopped before its end".to_owned());
            }
            _ if run.defect().is_some() => return Err("no 90 % intervals: the training has failed".to_owned()),
            Some(chosen) => chosen.clone(),
            None => {
                if let Some(time) = Intervals::time(run).filter(|time| *time > Intervals::MAX_TIME) {
                    return Err(format!(
                        "no 90 % intervals: calibrating them takes about {}; train in a terminal with --intervals always",
                        format_duration(time)
                    ));
                }
                Intervals::cross_validate(run.settings(), &self.training, self.by, job)
            }
        };
        calibrated.map_err(|reason| match reason {
            RunError::Cancelled(_) => "no 90 % intervals: interrupted".to_owned(),
            reason => format!("no 90 % intervals: {reason}"),
        })
    }
}
