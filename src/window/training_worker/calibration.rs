use decoupler_core::{
    dataset::{Dataset, Folds, SplitBy, Stream},
    decoupling::Combined,
    evaluation::{CrossValidated, DecoderSet, Intervals, Run, RunError},
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

    /// Fits ridge regression, to answer in place of the network of `run`, and calibrates its intervals.
    ///
    /// # Errors
    /// If it cannot be fitted.
    pub fn ridge(&self, run: &Run) -> Result<(Combined, Result<Intervals, RunError>), RunError> {
        let (mut settings, training) = (*run.settings(), &self.training);
        let decoder = DecoderSet::new(settings, training.clone(), None).linear()?;
        let program = decoder.program().expect("an affine map is a program");
        let targets = training.outputs();
        let combined = Combined {
            network: vec![0.0; targets],
            others: vec![(program, vec![1.0; targets])],
            margin: (20.0 / training.samples() as f64).max(0.1),
        };
        // Networks are trained with it, and not used.
        (settings.hidden, settings.starts, settings.training.stopping.epochs) = (1, 1, 1);
        let count = self.by.folds_of(training, Intervals::FOLDS);
        let folds = Folds::by(training, count, self.by, &mut settings.seed.rng(Stream::Split));
        let validated = folds.map_err(RunError::from);
        let validated =
            validated.and_then(|folds| CrossValidated::on_folds(&settings, training, folds, &Job::UNINTERRUPTED));
        let calibrate = |of: CrossValidated| Intervals::calibrate(training, of.linear.view(), self.by).checked();
        Ok((combined, validated.and_then(calibrate)))
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
                        "no 90 % intervals: calibrating them takes about {}; fewer hidden nodes or restarts take less",
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
