use std::io::{self, Write};

use clap::Args;
use decoupler_core::{
    dataset::{Dataset, Seed, SplitBy},
    decoupling::{DecoderKind, Precision},
    evaluation::{
        ErrorTable, Errors, Preset, RunError, RunSets, TradeOffPoint, Workload, decoded_unit, fastest_under,
        measure_trade_off, most_accurate_under,
    },
    job::Job,
    network::LARGEST_HIDDEN,
    problem::Problem,
    sensor::ArrayScale,
    text::counted,
    training::Method,
};
use decoupler_files::{
    export::{Table, TableColumn, error_table, format_number, report::train_command, trade_off_summary},
    figure::{TradeOffCost, TradeOffLevel, point_name},
    import::{Plan, Recordings, Setup, SetupSets},
};
use serde_json::{Value, json};

use super::{
    count,
    failure::Failure,
    import_arguments::ImportArguments,
    inspect::{RecordingReport, import_warnings},
    interruption::Graceful,
    number,
    output::{joined, print, progress_bar, warn},
    samples::{announce_workload, following, working_folder},
    settings_arguments::{OfTrade, SettingsArguments},
    train_report::decoder_object,
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
        let simulation = cases.first().and_then(|case| case.setup.settings().simulation());
        let mut trade_off = TradeOff {
            source: TradeSource::Array(simulation.map_or_else(ArrayScale::default, |source| source.sensor.scale)),
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
        let presets = self.scene.preset.map_or(Preset::ALL.to_vec(), |preset| vec![preset]);
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
        let methods = match &self.method[..] {
            [] => &[default],
            given => given,
        };
        let case = |(number, method): (usize, &Method)| {
            let mut settings = settings;
            let stopping = settings.training.stopping;
            settings.choose_method(*method);
            if self.scene.value("epochs").is_some() {
                settings.training.stopping.epochs = stopping.epochs;
            }
            let mut decoders = decoders.clone();
            // The others do not depend on the method.
            decoders.retain(|kind| number == 0 || kind.needs_network());
            Case {
                noise: None,
                preset: None,
                setup: Setup::recording(settings, plan.clone()),
                decoders,
            }
        };
        Ok(methods.iter().enumerate().map(case).collect())
    }
}

/// Divides recordings that have already been read by another plan.
fn divided(recordings: &Recordings, plan: &Plan, seed: Seed) -> Result<RunSets, Failure> {
    let (split, test) = plan.divide(&recordings.training, recordings.test.as_ref(), seed)?;
    Ok(RunSets::new(split, test).described(recordings.training.problem.clone()))
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

/// Limits for choosing the best decoder.
#[derive(Clone, Copy)]
struct Limits {
    pub(super) percent: Option<f64>,
    pub(super) microseconds: Option<f64>,
}

/// Decoders measured at every level of noise, or on a recording.
struct TradeOff {
    pub(super) source: TradeSource,
    pub(super) levels: Vec<MeasuredLevel>,
}

/// Source of the samples.
enum TradeSource {
    Array(ArrayScale),
    Recording(Box<RecordedSource>),
}

/// A recording on which decoders are measured.
struct RecordedSource {
    report: RecordingReport,
    /// Unit that is decoded: "a sample", "a frame of 4 row-wires".
    decoded: String,
    problem: Problem,
}

/// Points of a level with their training data.
struct MeasuredLevel {
    pub(super) level: TradeOffLevel,
    /// Training of each point.
    pub(super) trainings: Vec<PointTraining>,
    /// Decoders that cannot be used with these samples, with the reason.
    pub(super) refused: Vec<String>,
}

/// Training of a point.
struct PointTraining {
    /// Numbers of training and validation samples.
    pub(super) samples: [usize; 2],
    /// Command that trains it, if there is one.
    pub(super) command: Option<String>,
}

/// Legend of the marks at the end of the lines of the table.
const FRONTS: &str = "* no other decoder is both faster and more accurate; + no other is both trained faster and more accurate\n\
                      Training time is that of all restarts together, on all threads.";

/// A limit, and the index of the best point within it; none if no point is.
type Choice = (f64, Option<usize>);

impl RecordedSource {
    pub(super) fn new(sets: &RunSets, recordings: &Recordings) -> Result<Self, Failure> {
        let plan = &recordings.recorded.plan;
        import_warnings(recordings).iter().for_each(warn);
        if plan.division.by == SplitBy::Random && recordings.test.is_none() {
            warn(
                "random test samples are optimistic when neighbouring samples of a recording are similar; decoupler train \
                 measures by how much, and --split group or time avoids it",
            );
        }
        Ok(Self {
            report: RecordingReport::new(sets, recordings).map_err(Failure::Output)?,
            decoded: decoded_unit(&sets.test),
            problem: Problem::clone(&sets.problem),
        })
    }
}

impl MeasuredLevel {
    pub(super) fn new(noise: Option<f64>) -> Self {
        Self {
            level: TradeOffLevel {
                noise,
                points: Vec::new(),
            },
            trainings: Vec::new(),
            refused: Vec::new(),
        }
    }

    /// For each point, whether it is on the Pareto fronts of decoding time and of training time.
    fn fronts(&self) -> Vec<(bool, bool)> {
        let decoding = self.level.front(TradeOffCost::Decoding).into_iter();
        decoding.zip(self.level.front(TradeOffCost::Training)).collect()
    }

    /// The fastest and the most accurate point within the given `limits`.
    fn choices(&self, limits: Limits) -> [Option<Choice>; 2] {
        let points = &self.level.points;
        let choice = |limit: Option<f64>, choose: fn(&[TradeOffPoint], f64) -> Option<usize>| {
            limit.map(|limit| (limit, choose(points, limit)))
        };
        [
            choice(limits.percent, fastest_under),
            choice(limits.microseconds, most_accurate_under),
        ]
    }

    fn command(&self, point: Option<usize>) -> Option<&str> {
        self.trainings[point?].command.as_deref()
    }

    fn object(&self, source: &TradeSource, limits: Limits) -> Value {
        let point = |(place, (on_decoding_front, on_training_front))| {
            let (point, training): (&TradeOffPoint, &PointTraining) =
                (&self.level.points[place], &self.trainings[place]);
            let (channels, of_source) = match source {
                TradeSource::Array(_) => {
                    let of_model = |figure: fn(&Errors) -> Option<f64>| point.model_based.as_ref().and_then(figure);
                    let figures = json!({
                        "preset": point.preset.map(|preset| preset.to_string()),
                        "model_based_z_percent": of_model(|errors| errors.z_percent),
                        "model_based_z_mm": of_model(|errors| Some(errors.z_mm)),
                        "to_model_based": point.to_model_based(),
                    });
                    (&[][..], figures)
                }
                TradeSource::Recording(recording) => {
                    let figures = json!({
                        "method": point.method().map(|method| method.short_name()),
                        "samples": training.samples[0],
                        "validation_samples": training.samples[1],
                    });
                    (&recording.problem.targets[..], figures)
                }
            };
            let precision = match point.report.precision {
                Precision::Double => "f64",
                Precision::Single => "f32",
            };
            let figures = json!({
                "decoder": point.report.kind.to_string(),
                "precision": precision,
                "hidden": point.hidden(),
                "training_s": point.training_seconds,
                "on_decoding_front": on_decoding_front,
                "on_training_front": on_training_front,
                "command": training.command,
            });
            joined([decoder_object(channels, &point.report), figures, of_source])
        };
        let [fastest_under, most_accurate_under] = self.choices(limits).map(|choice| {
            choice.map(|(limit, point)| json!({"limit": limit, "point": point, "command": self.command(point)}))
        });
        let mut object = json!({
            "points": Vec::from_iter(self.fronts().into_iter().enumerate().map(point)),
            "fastest_under": fastest_under,
            "most_accurate_under": most_accurate_under,
        });
        if let Some(noise) = self.level.noise {
            object["noise"] = noise.into();
            if !self.refused.is_empty() {
                object["refused"] = self.refused.clone().into();
            }
        }
        object
    }

    /// Remarks on the figures, with cause and remedy, and decoders that cannot be used.
    fn warnings(&self) -> impl Iterator<Item = String> {
        let remarks = self.level.points.iter().flat_map(|point| {
            let remarks = point.report.remarks.iter();
            remarks.map(move |remark| format!("{}: {remark}", point_name(point)))
        });
        remarks.chain(self.refused.iter().cloned())
    }

    /// Table of the points, fastest first, with marks for those on the Pareto fronts.
    fn table(&self) -> Table {
        let mut table = trade_off_summary(&self.level);
        let mut points = Vec::from_iter(self.level.points.iter().zip(self.fronts()));
        points.sort_by(|(one, _), (other, _)| one.report.frame_us.total_cmp(&other.report.frame_us));
        table.columns.push(TableColumn::field(""));
        for (row, (_, (is_on_decoding_front, is_on_training_front))) in table.rows.iter_mut().zip(points) {
            let marks = [(is_on_decoding_front, "*"), (is_on_training_front, "+")];
            row.push(
                marks
                    .map(|(is_on, mark)| if is_on { mark } else { " " })
                    .concat()
                    .into(),
            );
        }
        table
    }

    fn write(&self, limits: Limits, out: &mut dyn Write) -> io::Result<()> {
        if let Some(noise) = self.level.noise {
            write!(out, "\nNoise {noise}")?;
            if let Some(model_based) = self.level.points.first().and_then(|point| point.model_based) {
                let (percent, mm) = (format_number(model_based.z_percent), format_number(model_based.z_mm));
                write!(out, ", model-based {percent} % ({mm} mm)")?;
                if model_based.is_rounding() {
                    write!(out, ", nothing but rounding")?;
                }
            }
        }
        write!(out, "\n{}", self.table().aligned())?;
        let [fastest, most_accurate] = self.choices(limits);
        let choices = [
            fastest.map(|(percent, point)| (format!("Fastest under {percent} %"), point)),
            most_accurate.map(|(us, point)| (format!("Most accurate under {us} us"), point)),
        ];
        for (what, point) in choices.into_iter().flatten() {
            let decoder = point.map(|place| point_name(&self.level.points[place]));
            let answer = self.command(point).map(str::to_owned).or(decoder);
            writeln!(out, "{what}: {}", answer.as_deref().unwrap_or("none"))?;
        }
        Ok(())
    }

    /// Errors of each point, target by target.
    fn target_table(&self, problem: &Problem) -> Table {
        let points = &self.level.points;
        let errors = points.iter().map(|point| ("", &point.report.errors));
        let mut table = error_table(&ErrorTable::of_errors(problem, &Vec::from_iter(errors)));
        // The rows of each target are the points in their order.
        for (row, point) in table.rows.iter_mut().zip(points.iter().cycle()) {
            row[1] = point_name(point).into();
        }
        table
    }
}

impl TradeOff {
    pub(super) fn print(&self, limits: Limits) -> Result<(), Failure> {
        self.levels.iter().flat_map(MeasuredLevel::warnings).for_each(warn);
        let levels = self.levels.iter().map(|level| level.object(&self.source, limits));
        let object = || match &self.source {
            TradeSource::Array(array) => json!({"array": array, "levels": Vec::from_iter(levels)}),
            TradeSource::Recording(recording) => {
                let decoded = json!({"decoded": recording.decoded});
                joined([recording.report.object.clone(), decoded].into_iter().chain(levels))
            }
        };
        print(object, |out| self.write(limits, out))
    }

    fn write(&self, limits: Limits, out: &mut dyn Write) -> io::Result<()> {
        match &self.source {
            TradeSource::Array(array) => writeln!(
                out,
                "{array}: time per frame (one thread) and training time against the error of z"
            )?,
            TradeSource::Recording(recording) => {
                out.write_all(&recording.report.text)?;
                writeln!(
                    out,
                    "\nTime to decode {} (one thread) and training time against the error (MAE in % of range, mean of the \
                     targets)",
                    recording.decoded
                )?;
            }
        }
        self.levels.iter().try_for_each(|level| level.write(limits, out))?;
        writeln!(out, "\n{FRONTS}")?;
        if let TradeSource::Recording(recording) = &self.source {
            for level in &self.levels {
                write!(out, "\n{}", level.target_table(&recording.problem).aligned())?;
            }
        }
        Ok(())
    }
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
