//! The command that retrains the network of a point of the trade-off.

use clap::Args;
use decoupler_core::{
    dataset::{Dataset, Seed},
    decoupling::DecoderKind,
    evaluation::{Preset, RunError, RunSets, TradeOffPoint, Workload, measure_trade_off},
    job::Job,
    network::LARGEST_HIDDEN,
    text::counted,
    training::Method,
};
use decoupler_files::{
    export::report::train_command,
    import::{Plan, Recordings, Setup, SetupSets},
};

use super::{
    count,
    failure::Failure,
    import_arguments::ImportArguments,
    interruption::Graceful,
    number,
    output::progress_bar,
    samples::{announce_workload, following, working_folder},
    settings_arguments::{OfTrade, SettingsArguments},
    trade_report::{Limits, MeasuredLevel, PointTraining, RecordedSource, TradeOff, TradeSource},
};

/// Measure speed against accuracy of every decoder
///
/// Trains networks of both presets with several numbers of hidden nodes, at several levels of noise, and prints for each
/// decoder its error, its time per frame (median of many, one thread) and its training time, marks the Pareto-optimal
/// choices, and prints the command for each requested choice. With --data it uses the samples of a recording and the
/// decoders that need no model of the sensor.
#[derive(Args)]
#[command(allow_negative_numbers = true)]
pub(super) struct Trade {
    #[command(flatten)]
    scene: SettingsArguments<OfTrade>,
    #[command(flatten)]
    import: ImportArguments,
    /// Noise of each reading (standard deviation), relative to the reading [default: 0,1e-4,1e-3,1e-2]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = number)]
    noise: Vec<f64>,
    /// Hidden nodes of the networks
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "6,12", value_parser = count(1..=LARGEST_HIDDEN))]
    hidden: Vec<usize>,
    /// Training methods of the networks for a recording [default: br]; a simulated array uses those of its presets
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = Method::named)]
    method: Vec<Method>,
    /// Also print the fastest decoder whose error is at most this many percent: of z, or of the ranges of a recording's
    /// targets
    #[arg(long, value_name = "PERCENT", value_parser = number)]
    under_percent: Option<f64>,
    /// Also print the most accurate decoder that takes at most this many microseconds per frame
    #[arg(long, value_name = "US", value_parser = number)]
    under_us: Option<f64>,
}

/// A network to be measured with the decoders that need one, or all decoders.
struct Case {
    /// Relative noise of a simulated array.
    noise: Option<f64>,
    preset: Option<Preset>,
    setup: Setup,
    decoders: Vec<DecoderKind>,
}

impl Case {
    /// Name of the case.
    fn name(&self) -> String {
        match (self.noise, self.preset) {
            (Some(noise), Some(preset)) => format!("noise {noise}, preset {preset}"),
            _ => format!("method {}", self.setup.settings().training.method.short_name()),
        }
    }
}

impl Trade {
    pub(super) fn run(self) -> Result<(), Failure> {
        let cases = self.cases()?;
        let mut trade_off = TradeOff {
            source: TradeSource::Array(self.scene.settings_at(Preset::default(), 0.0)?.drawn()?.sensor.scale),
            levels: Vec::new(),
        };
        let bar = progress_bar(cases.len(), "{bar:30} {pos} of {len}, {msg}, {elapsed}");
        let graceful = Graceful::begin();
        let mut recordings: Option<Recordings> = None;
        let (levels, end) = measure_levels(&cases, |case, level| {
            let is_cancelled = || graceful.is_end_requested();
            let sets = match (&recordings, case.setup.plan()) {
                (Some(recordings), Some(plan)) => divided(recordings, plan, case.setup.settings().seed)?,
                _ => {
                    let SetupSets { sets, recordings: read } = following(&case.setup, |on_progress| {
                        case.setup.sets(working_folder(), &Job::UNINTERRUPTED, on_progress)
                    })?;
                    if let Some(read) = &read {
                        trade_off.source = TradeSource::Recording(Box::new(RecordedSource::new(&sets, read)?));
                    }
                    recordings = read;
                    sets
                }
            };
            let samples = [
                sets.split.training.samples(),
                sets.split.validation.as_ref().map_or(0, Dataset::samples),
            ];
            bar.set_message(case.name());
            let settings = case.setup.settings();
            let on_point = |kind, point: Result<TradeOffPoint, RunError>, _: Option<&_>| match point {
                Ok(point) => {
                    let point = TradeOffPoint {
                        preset: case.preset,
                        ..point
                    };
                    level.trainings.push(PointTraining {
                        samples,
                        command: command(&point, case.setup.plan(), &self.import),
                    });
                    level.level.points.push(point);
                }
                Err(error) => level.refused.push(format!("{kind}: {error}")),
            };
            let job = Job::new(&is_cancelled);
            match measure_trade_off(settings, &sets, &self.hidden, &case.decoders, &job, on_point) {
                Err(RunError::Cancelled(_)) => Ok(false),
                measured => {
                    measured?;
                    bar.inc(1);
                    Ok(true)
                }
            }
        });
        bar.finish_and_clear();
        drop(graceful);
        let done: usize = levels.iter().map(|level| level.level.points.len()).sum();
        trade_off.levels = levels;
        if end.is_ok() || done > 0 {
            trade_off.print(Limits {
                percent: self.under_percent,
                microseconds: self.under_us,
            })?;
        }
        if end? {
            return Ok(());
        }
        Err(Failure::Interrupted(format!(" after {}", counted(done, "point"))))
    }

    /// Cases to measure: both presets at every level of noise, or a recording with every method.
    fn cases(&self) -> Result<Vec<Case>, Failure> {
        if self.import.is_given() {
            return self.cases_of_recording(&self.import.plan(&self.scene.columns())?);
        }
        self.import.check_unused()?;
        self.cases_of_array()
    }

    fn cases_of_array(&self) -> Result<Vec<Case>, Failure> {
        if !self.method.is_empty() {
            let message = "--method: the presets name the methods of a simulated array; leave it out, or give --data";
            return Err(Failure::Arguments(message.to_owned()));
        }
        let noises = match &self.noise[..] {
            [] => vec![0.0, 1e-4, 1e-3, 1e-2],
            given => given.to_vec(),
        };
        let presets = match self.scene.preset {
            Some(preset) => vec![preset],
            None => Preset::ALL.to_vec(),
        };
        let decoders = self.scene.decoders();
        let mut cases = Vec::new();
        for &noise in &noises {
            for &preset in &presets {
                let settings = self.scene.settings_at(preset, noise)?;
                // The work is nearly independent of the noise.
                if noise == noises[0] {
                    announce_workload(&Workload::of_trade_off(&settings, &self.hidden, &decoders)?)?;
                }
                cases.push(Case {
                    noise: Some(noise),
                    preset: Some(preset),
                    setup: settings.into(),
                    decoders: decoders.clone(),
                });
            }
        }
        Ok(cases)
    }

    fn cases_of_recording(&self, plan: &Plan) -> Result<Vec<Case>, Failure> {
        if !self.noise.is_empty() {
            let message = "--noise: a recording (--data) has its own noise; leave it out";
            return Err(Failure::Arguments(message.to_owned()));
        }
        let settings = self.scene.recorded(plan.import.row_wire.is_some())?;
        let default = settings.training.method;
        let mut decoders = self.scene.decoders();
        decoders.retain(|kind| !kind.needs_sensor());
        let methods = if self.method.is_empty() {
            vec![default]
        } else {
            self.method.clone()
        };
        let case = |(number, method): (usize, &Method)| {
            let mut settings = settings;
            let stopping = settings.training.stopping;
            settings.choose_method(*method);
            if self.scene.value("epochs").is_some() {
                settings.training.stopping.epochs = stopping.epochs;
            }
            let mut plan = plan.clone();
            if !self.import.holds_out() {
                plan.division.validation_fraction = settings.validation_fraction();
            }
            let mut decoders = decoders.clone();
            // The others do not depend on the method.
            decoders.retain(|kind| number == 0 || kind.needs_network());
            Case {
                noise: None,
                preset: None,
                setup: Setup::recording(settings, plan),
                decoders,
            }
        };
        Ok(methods.iter().enumerate().map(case).collect())
    }
}

/// Divides recordings that have already been read by another plan.
fn divided(recordings: &Recordings, plan: &Plan, seed: Seed) -> Result<RunSets, Failure> {
    let (split, test) = plan.divide(&recordings.training, recordings.test.as_ref(), seed)?;
    Ok(RunSets::new(split, test).described(recordings.training.problem()))
}

/// Measures all cases, up to the first failure. Returns the levels with points, and whether all cases were measured
/// completely.
fn measure_levels(
    cases: &[Case],
    mut measure: impl FnMut(&Case, &mut MeasuredLevel) -> Result<bool, Failure>,
) -> (Vec<MeasuredLevel>, Result<bool, Failure>) {
    let mut levels: Vec<MeasuredLevel> = Vec::new();
    let mut end = Ok(true);
    for case in cases {
        let mut level = match levels.pop_if(|level| level.level.noise == case.noise) {
            Some(level) => level,
            None => MeasuredLevel::new(case.noise),
        };
        let measured = measure(case, &mut level);
        if !level.level.points.is_empty() || (measured.is_ok() && case.noise.is_none()) {
            levels.push(level);
        }
        match measured {
            Ok(true) => {}
            Ok(false) => {
                end = Ok(false);
                break;
            }
            // Nothing is lost, so no message is needed.
            Err(cause) if levels.is_empty() => return (levels, Err(cause)),
            Err(cause) => {
                let (place, cause) = (case.name(), Box::new(cause));
                return (levels, Err(Failure::TradeOff { place, cause }));
            }
        }
    }
    (levels, end)
}

/// Command that trains with the settings of `point`, on the samples of `plan` if there is one; `None` for decoders of a
/// recording that have no network.
fn command(point: &TradeOffPoint, plan: Option<&Plan>, import: &ImportArguments) -> Option<String> {
    let mut settings = point.settings;
    settings.hidden = point.hidden().or_else(|| plan.is_none().then_some(settings.hidden))?;
    let setup = Setup::of(settings, plan.cloned())?;
    let command = train_command(&setup, import.recipe()).ok()?;
    Some(match plan {
        Some(_) => command,
        None => format!("{command} --decoder {}", point.report.kind),
    })
}

#[cfg(test)]
mod tests {
    use decoupler_core::evaluation::RunSettings;

    use super::*;
    use crate::terminal::samples::sets;

    #[test]
    fn results_before_a_failure_are_kept_and_the_failure_names_its_case() {
        let mut settings = RunSettings::default();
        settings.simulation_mut().unwrap().sensor.scale = "1x1_1x3".parse().unwrap();
        (
            settings.simulation_mut().unwrap().samples,
            settings.simulation_mut().unwrap().test_samples,
        ) = (8, 4);
        let cases = Vec::from_iter([0.0, 0.01, 0.1].into_iter().flat_map(|noise| {
            Preset::ALL.map(|preset| Case {
                noise: Some(noise),
                preset: Some(preset),
                setup: settings.into(),
                decoders: vec![DecoderKind::Mean],
            })
        }));
        let measure_until = |fails_at: (f64, Preset)| {
            measure_levels(&cases, |case, level| {
                if (case.noise, case.preset) == (Some(fails_at.0), Some(fails_at.1)) {
                    return Err(Failure::Arguments("too wide".to_owned()));
                }
                let sets = sets(&case.setup)?.sets;
                let keep =
                    |_, point: Result<TradeOffPoint, RunError>, _: Option<&_>| level.level.points.push(point.unwrap());
                let job = Job::UNINTERRUPTED;
                measure_trade_off(case.setup.settings(), &sets, &[], &case.decoders, &job, keep)?;
                Ok(true)
            })
        };
        for (place, preset) in Preset::ALL.into_iter().enumerate() {
            let (levels, end) = measure_until((0.01, preset));
            let points = levels.iter().map(|level| (level.level.noise, level.level.points.len()));
            assert_eq!(
                Vec::from_iter(points),
                [(Some(0.0), 2), (Some(0.01), place)][..1 + place]
            );
            let failure = end.unwrap_err();
            assert_eq!(failure.status(), 1);
            let message = failure.to_string();
            let expected = format!("noise 0.01, preset {preset}: too wide");
            assert!(message.starts_with(&expected), "{message}");
        }
        let (levels, end) = measure_until((0.0, Preset::ALL[0]));
        assert!(levels.is_empty());
        assert_eq!(end.unwrap_err().status(), 2, "an argument is wrong and nothing is lost");
        let (levels, end) = measure_until((1.0, Preset::ALL[0]));
        assert_eq!((levels.len(), end.unwrap()), (3, true));
    }
}
