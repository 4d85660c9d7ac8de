use std::{
    io::{self, Write},
    time::Duration,
};

use serde::Serialize;

use super::{
    failure::Failure,
    measured_report::Report,
    measured_table::{Target, targets, write_table, write_warnings},
    output::{print, print_object},
    trade_report::{Choice, FRONTS, Limits, front_marks, precision_word},
};
use crate::{
    dataset::SplitBy,
    evaluation::{TargetErrors, TargetTradeOffPoint, pareto_front},
    export::{Cell, Table, format_duration},
    import::Channel,
};

/// Decoders measured on own data.
pub(super) struct TradeOff {
    pub(super) report: Report,
    /// Unit that is decoded: "a sample", "a frame of 4 row-wires".
    pub(super) decoded: String,
    /// Rule by which the samples are divided.
    pub(super) by: SplitBy,
    pub(super) targets: Vec<Channel>,
    pub(super) measured: Vec<Measured>,
    /// Decoders that cannot be used with these samples, and why.
    pub(super) refused: Vec<String>,
}

/// A point with what it was trained on.
pub(super) struct Measured {
    pub(super) point: TargetTradeOffPoint,
    /// Numbers of training and validation samples.
    pub(super) samples: [usize; 2],
    /// Command that trains the network, if there is one.
    pub(super) command: Option<String>,
}

/// The object printed by `trade --data --json`.
#[derive(Serialize)]
struct Printed<'a> {
    #[serde(flatten)]
    report: &'a Report,
    decoded: &'a str,
    points: Vec<PointReport<'a>>,
    fastest_under: Option<Choice>,
    most_accurate_under: Option<Choice>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct PointReport<'a> {
    decoder: String,
    precision: &'static str,
    hidden: Option<usize>,
    method: Option<&'static str>,
    samples: usize,
    validation_samples: usize,
    /// Mean absolute error in percent of the range, averaged over the targets.
    percent_of_range: Option<f64>,
    targets: Vec<Target<'a>>,
    frame_us: f64,
    training_s: f64,
    /// Remarks on the figures, with cause and cure.
    remarks: Vec<String>,
    on_decoding_front: bool,
    on_training_front: bool,
    command: Option<&'a str>,
}

impl TradeOff {
    pub(super) fn print(&self, limits: Limits, is_json: bool) -> Result<(), Failure> {
        if is_json {
            self.print_json(limits)
        } else {
            print(|out| self.write(limits, out))
        }
    }

    fn print_json(&self, limits: Limits) -> Result<(), Failure> {
        let [fastest_under, most_accurate_under] = self.choices(limits);
        print_object(&Printed {
            report: &self.report,
            decoded: &self.decoded,
            points: self.points(),
            fastest_under,
            most_accurate_under,
            warnings: self.warnings(),
        })
    }

    fn points(&self) -> Vec<PointReport<'_>> {
        let points = self.measured.iter().zip(self.fronts());
        let report = |(measured, (on_decoding_front, on_training_front))| {
            let Measured {
                point,
                samples,
                command,
            }: &Measured = measured;
            PointReport {
                decoder: point.report.kind.to_string(),
                precision: precision_word(point.report.precision),
                hidden: point.hidden(),
                method: point.method().map(|method| method.short_name()),
                samples: samples[0],
                validation_samples: samples[1],
                percent_of_range: point.percent_of_range(),
                targets: targets(&self.targets, &point.report.targets, &[]),
                frame_us: point.report.cost.frame_us,
                training_s: point.training_seconds,
                remarks: point.report.remarks.iter().map(ToString::to_string).collect(),
                on_decoding_front,
                on_training_front,
                command: command.as_deref(),
            }
        };
        points.map(report).collect()
    }

    /// For each point, true if it is on the Pareto front of decoding time and on that of training time.
    fn fronts(&self) -> Vec<(bool, bool)> {
        let front = |cost: fn(&TargetTradeOffPoint) -> (f64, f64)| {
            pareto_front(&Vec::from_iter(
                self.measured.iter().map(|measured| cost(&measured.point)),
            ))
        };
        let decoding = front(TargetTradeOffPoint::decoding).into_iter();
        decoding.zip(front(TargetTradeOffPoint::training)).collect()
    }

    /// The fastest and the most accurate point within `limits`, for those given.
    fn choices(&self, limits: Limits) -> [Option<Choice>; 2] {
        let points = Vec::from_iter(self.measured.iter().map(|measured| measured.point.decoding()));
        // The place of the least of one figure among those whose other figure is within the limit.
        let least = |of: fn(&(f64, f64)) -> f64, other: fn(&(f64, f64)) -> f64, limit: f64| {
            let within = points.iter().enumerate().filter(|(_, point)| other(point) <= limit);
            within
                .min_by(|(_, a), (_, b)| of(a).total_cmp(&of(b)))
                .map(|(place, _)| place)
        };
        let choice = |limit, point: Option<usize>| Choice {
            limit,
            point,
            command: point.and_then(|place| self.measured[place].command.clone()),
        };
        let (time, error) = (|point: &(f64, f64)| point.0, |point: &(f64, f64)| point.1);
        [
            limits.percent.map(|limit| choice(limit, least(time, error, limit))),
            limits
                .microseconds
                .map(|limit| choice(limit, least(error, time, limit))),
        ]
    }

    fn warnings(&self) -> Vec<String> {
        let mut warnings = self.report.warnings().to_vec();
        if self.by == SplitBy::Random && !self.report.has_test_file() {
            let message = "random test samples flatter where neighbouring rows of a recording are alike; decoupler train \
                           measures by how much, and --split group or time avoids it";
            warnings.push(message.to_owned());
        }
        warnings.extend(self.refused.iter().cloned());
        warnings
    }

    fn write(&self, limits: Limits, out: &mut impl Write) -> io::Result<()> {
        self.report.write(out)?;
        writeln!(
            out,
            "\nTime to decode {} (one thread) and training time against the error (MAE in % of the range, mean of the targets)\n",
            self.decoded
        )?;
        let row = |(measured, (on_decoding_front, on_training_front)): (&Measured, (bool, bool))| {
            let point = &measured.point;
            let training = Duration::try_from_secs_f64(point.training_seconds).unwrap_or_default();
            vec![
                point.report.name().into(),
                point.hidden().map_or_else(|| "".into(), Cell::from),
                point.method().map_or("", |method| method.short_name()).into(),
                point.percent_of_range().into(),
                point.report.cost.frame_us.into(),
                format_duration(training).into(),
                front_marks(on_decoding_front, on_training_front).into(),
            ]
        };
        let headings = ["decoder", "hidden", "method", "% of range", "us", "training", ""];
        let table = Table::of_headings(headings, self.measured.iter().zip(self.fronts()).map(row));
        write!(out, "{}", table.aligned())?;
        writeln!(out, "\n{FRONTS}\n")?;
        let names = Vec::from_iter(self.measured.iter().map(|measured| name(&measured.point)));
        let errors = self.measured.iter().map(|measured| &measured.point.report.targets[..]);
        let rows: Vec<(&str, &[TargetErrors])> = names.iter().map(String::as_str).zip(errors).collect();
        write_table(&self.targets, &rows, out)?;
        let remarks = self.measured.iter().zip(&names).flat_map(|(measured, name)| {
            let remarks = measured.point.report.remarks.iter();
            remarks.map(move |remark| format!("{name}: {remark}"))
        });
        let warnings = Vec::from_iter(self.warnings().into_iter().chain(remarks));
        write_warnings(&warnings, out)?;
        let [fastest, most_accurate] = self.choices(limits);
        let told = [
            fastest.map(|choice| (format!("Fastest under {} %", choice.limit), choice)),
            most_accurate.map(|choice| (format!("Most accurate under {} us", choice.limit), choice)),
        ];
        for (what, choice) in told.into_iter().flatten() {
            let name = choice.point.map_or("none", |place| names[place].as_str());
            let command = choice
                .command
                .map_or_else(String::new, |command| format!(": {command}"));
            writeln!(out, "{what}: {name}{command}")?;
        }
        Ok(())
    }
}

/// `network_f32, 12, lm`: the decoder, its hidden nodes and its method.
fn name(point: &TargetTradeOffPoint) -> String {
    let mut name = point.report.name();
    if let (Some(hidden), Some(method)) = (point.hidden(), point.method()) {
        name += &format!(", {hidden}, {}", method.short_name());
    }
    name
}
