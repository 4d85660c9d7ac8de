use std::io::{self, Write};

use serde_json::{Value, json};

use super::{
    errors_report::errors_object,
    failure::Failure,
    inspect::{RecordingReport, import_warnings},
    output::{joined, print, warn},
};
use decoupler_core::{
    dataset::SplitBy,
    decoupling::Precision,
    evaluation::{ErrorTable, Errors, RunSets, TradeOffPoint, decoded_unit, fastest_under, most_accurate_under},
    problem::Problem,
    sensor::ArrayScale,
};
use decoupler_files::{
    export::{Table, TableColumn, error_table, format_number, trade_off_summary},
    figure::{TradeOffCost, TradeOffLevel, point_name},
    import::Recordings,
};

/// Limits for choosing the best decoder.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    pub(super) percent: Option<f64>,
    pub(super) microseconds: Option<f64>,
}

/// Decoders measured at every level of noise, or on a recording.
pub(super) struct TradeOff {
    pub(super) source: TradeSource,
    pub(super) levels: Vec<MeasuredLevel>,
}

/// Source of the samples.
pub(super) enum TradeSource {
    Array(ArrayScale),
    Recording(Box<RecordedSource>),
}

/// A recording on which decoders are measured.
pub(super) struct RecordedSource {
    report: RecordingReport,
    /// Unit that is decoded: "a sample", "a frame of 4 row-wires".
    decoded: String,
    problem: Problem,
    warnings: Vec<String>,
}

/// Points of a level with their training data.
pub(super) struct MeasuredLevel {
    pub(super) level: TradeOffLevel,
    /// Training of each point.
    pub(super) trainings: Vec<PointTraining>,
    /// Decoders that cannot be used with these samples, with the reason.
    pub(super) refused: Vec<String>,
}

/// Training of a point.
pub(super) struct PointTraining {
    /// Numbers of training and validation samples.
    pub(super) samples: [usize; 2],
    /// Command that trains it, if there is one.
    pub(super) command: Option<String>,
}

/// Legend of the marks at the end of the lines of the table.
const FRONTS: &str = "* no other decoder is both faster and more accurate; + no other is both trained faster and more accurate\n\
                      Training time is the sum over all rows and starts.";

/// The best point within a limit.
struct Choice {
    limit: f64,
    /// Index of the point; none if no point is within the limit.
    point: Option<usize>,
    command: Option<String>,
}

impl RecordedSource {
    pub(super) fn new(sets: &RunSets, recordings: &Recordings) -> Result<Self, Failure> {
        let plan = &recordings.recorded.plan;
        let mut warnings = import_warnings(recordings);
        if plan.division.by == SplitBy::Random && recordings.test.is_none() {
            let message = "random test samples are optimistic when neighbouring rows of a recording are similar; decoupler \
                           train measures by how much, and --split group or time avoids it";
            warnings.push(message.to_owned());
        }
        Ok(Self {
            report: RecordingReport::new(sets, recordings).map_err(Failure::Output)?,
            decoded: decoded_unit(&sets.test),
            problem: Problem::clone(&sets.problem),
            warnings,
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
            let limit = limit?;
            let point = choose(points, limit);
            Some(Choice {
                limit,
                point,
                command: point.and_then(|place| self.trainings[place].command.clone()),
            })
        };
        [
            choice(limits.percent, fastest_under),
            choice(limits.microseconds, most_accurate_under),
        ]
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
                        "residual": point.report.residual,
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
                "frame_us": point.report.frame_us,
                "training_s": point.training_seconds,
                "remarks": point.report.remarks,
                "on_decoding_front": on_decoding_front,
                "on_training_front": on_training_front,
                "command": training.command,
            });
            joined([figures, errors_object(channels, &point.report.errors), of_source])
        };
        let [fastest_under, most_accurate_under] = self.choices(limits).map(|choice| {
            choice.map(|choice| json!({"limit": choice.limit, "point": choice.point, "command": choice.command}))
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
            fastest.map(|choice| (format!("Fastest under {} %", choice.limit), choice)),
            most_accurate.map(|choice| (format!("Most accurate under {} us", choice.limit), choice)),
        ];
        for (what, choice) in choices.into_iter().flatten() {
            let decoder = choice.point.map(|place| point_name(&self.level.points[place]));
            let answer = choice.command.or(decoder).unwrap_or_else(|| "none".to_owned());
            writeln!(out, "{what}: {answer}")?;
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
        if let TradeSource::Recording(recording) = &self.source {
            recording.warnings.iter().for_each(warn);
        }
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
