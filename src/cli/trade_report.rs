use std::{
    io::{self, Write},
    time::Duration,
};

use serde::Serialize;

use super::{
    failure::Failure,
    output::{print, print_object},
};
use crate::{
    decoupling::Precision,
    evaluation::{SimulatedSettings, TradeOffCost, TradeOffLevel, TradeOffPoint, fastest_under, most_accurate_under},
    export::{Cell, Table, format_duration, format_number},
    sensor::ArrayScale,
};

/// Limits for which the best decoder is to be found.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    pub(super) percent: Option<f64>,
    pub(super) microseconds: Option<f64>,
}

/// Legend of the marks behind the lines of the table.
pub(super) const FRONTS: &str = "* no other decodes as fast with as little error; + no other is trained as fast with as little error\n\
                                 Training time is the sum over all rows and starts.";

/// Marks of a point, as [`FRONTS`] explains them.
pub(super) fn front_marks(is_on_decoding_front: bool, is_on_training_front: bool) -> String {
    let decoding = if is_on_decoding_front { "*" } else { " " };
    let training = if is_on_training_front { "+" } else { "" };
    format!("{decoding}{training}")
}

/// Word for a precision.
pub(super) fn precision_word(precision: Precision) -> &'static str {
    match precision {
        Precision::Double => "f64",
        Precision::Single => "f32",
    }
}

/// For each point, true if it is on the Pareto front of decoding time and on that of training time.
fn fronts(level: &TradeOffLevel) -> Vec<(bool, bool)> {
    let decoding = level.front(TradeOffCost::Decoding).into_iter();
    decoding.zip(level.front(TradeOffCost::Training)).collect()
}

/// Command that trains the network of `point`.
fn command(point: &TradeOffPoint) -> String {
    let settings = &point.settings;
    // As `train` would begin: with this noise the preset has these samples and epochs, without the noise itself.
    let mut of_preset = point.preset.settings_in(settings.source.scene.noise);
    of_preset.source.scene = point.preset.settings().source.scene;
    let array = settings.source.sensor.scale.to_string().replace('×', "x");
    let mut command = format!("decoupler train --preset {} --array {array}", point.preset);
    let mut add = |name: &str, value: &dyn Fn(&SimulatedSettings) -> String| {
        if value(settings) != value(&of_preset) {
            command += &format!(" --{name} {}", value(settings));
        }
    };
    add("rows", &|settings| settings.source.scene.rows.to_string());
    add("axes", &|settings| settings.source.scene.movement.to_string());
    add("loading", &|settings| settings.source.scene.loading.to_string());
    add("inputs", &|settings| settings.inputs.quantity.to_string());
    add("scaling", &|settings| settings.inputs.scaling.to_string());
    add("noise", &|settings| {
        format!("{:e}", settings.source.scene.noise.relative)
    });
    add("noise-ohm", &|settings| {
        format!("{:e}", settings.source.scene.noise.additive_ohm)
    });
    add("drift", &|settings| format!("{:e}", settings.source.scene.noise.drift));
    add("adc-bits", &|settings| {
        settings.source.scene.noise.converter_bits.unwrap_or(0).to_string()
    });
    add("noise-in", &|settings| {
        format!("{:?}", settings.source.scene.noise.sets).to_lowercase()
    });
    add("samples", &|settings| settings.source.samples.to_string());
    add("epochs", &|settings| settings.training.stopping.epochs.to_string());
    add("seed", &|settings| settings.seed.to_string());
    if let Some(hidden) = point.hidden() {
        command += &format!(" --hidden {hidden}");
    }
    command + &format!(" --decoder {}", point.report.kind)
}

#[derive(Serialize)]
struct Report {
    array: ArrayScale,
    levels: Vec<LevelReport>,
}

#[derive(Serialize)]
struct LevelReport {
    noise: f64,
    points: Vec<PointReport>,
    fastest_under: Option<Choice>,
    most_accurate_under: Option<Choice>,
}

#[derive(Serialize)]
struct PointReport {
    preset: String,
    decoder: String,
    precision: &'static str,
    hidden: Option<usize>,
    z_percent: Option<f64>,
    z_mm: f64,
    frame_us: f64,
    training_s: f64,
    /// Root mean square of m/R − 1; none if the decoded deformation has no resistance.
    residual: Option<f64>,
    reference_z_percent: Option<f64>,
    reference_z_mm: Option<f64>,
    to_reference: Option<f64>,
    /// Remarks on the figures, with cause and cure.
    remarks: Vec<String>,
    on_decoding_front: bool,
    on_training_front: bool,
    command: String,
}

/// The best point within a limit.
#[derive(Serialize)]
pub(super) struct Choice {
    pub(super) limit: f64,
    /// Index of the point; none if no point is within the limit.
    pub(super) point: Option<usize>,
    pub(super) command: Option<String>,
}

/// The fastest and the most accurate point within `limits`, for those given.
fn choices(level: &TradeOffLevel, limits: Limits) -> [Option<Choice>; 2] {
    let choice = |limit: Option<f64>, choose: fn(&[TradeOffPoint], f64) -> Option<&TradeOffPoint>| {
        let limit = limit?;
        let chosen = choose(&level.points, limit);
        let is_chosen = |point: &TradeOffPoint| chosen.is_some_and(|chosen| std::ptr::eq(point, chosen));
        Some(Choice {
            limit,
            point: level.points.iter().position(is_chosen),
            command: chosen.map(command),
        })
    };
    [
        choice(limits.percent, fastest_under),
        choice(limits.microseconds, most_accurate_under),
    ]
}

/// Prints one JSON object.
pub(super) fn print_json(array: ArrayScale, levels: &[TradeOffLevel], limits: Limits) -> Result<(), Failure> {
    let point = |(point, (on_decoding_front, on_training_front)): (&TradeOffPoint, (bool, bool))| PointReport {
        preset: point.preset.to_string(),
        decoder: point.report.kind.to_string(),
        precision: precision_word(point.report.precision),
        hidden: point.hidden(),
        z_percent: point.report.errors.z_percent,
        z_mm: point.report.errors.z_mm,
        frame_us: point.report.cost.frame_us,
        training_s: point.training_seconds,
        residual: Some(point.report.residual).filter(|residual| residual.is_finite()),
        reference_z_percent: point.reference.and_then(|errors| errors.z_percent),
        reference_z_mm: point.reference.map(|errors| errors.z_mm),
        to_reference: point.to_reference(),
        remarks: point.report.remarks.iter().map(ToString::to_string).collect(),
        on_decoding_front,
        on_training_front,
        command: command(point),
    };
    let level = |level: &TradeOffLevel| {
        let [fastest_under, most_accurate_under] = choices(level, limits);
        LevelReport {
            noise: level.noise,
            points: level.points.iter().zip(fronts(level)).map(point).collect(),
            fastest_under,
            most_accurate_under,
        }
    };
    let report = Report {
        array,
        levels: levels.iter().map(level).collect(),
    };
    print_object(&report)
}

/// Prints a table for each level of noise.
pub(super) fn print_text(array: ArrayScale, levels: &[TradeOffLevel], limits: Limits) -> Result<(), Failure> {
    print(|output| write_text(array, levels, limits, output))
}

fn write_text(array: ArrayScale, levels: &[TradeOffLevel], limits: Limits, out: &mut impl Write) -> io::Result<()> {
    writeln!(
        out,
        "{array}: time for a frame (one thread) and training time against the error of z"
    )?;
    for level in levels {
        write_level(level, limits, out)?;
    }
    writeln!(out, "\n{FRONTS}")
}

fn write_level(level: &TradeOffLevel, limits: Limits, out: &mut impl Write) -> io::Result<()> {
    write!(out, "\nNoise {}", level.noise)?;
    if let Some(reference) = level.points.first().and_then(|point| point.reference) {
        let (percent, mm) = (format_number(reference.z_percent), format_number(reference.z_mm));
        write!(out, ", reference {percent} % ({mm} mm)")?;
        if reference.is_rounding() {
            write!(out, ", nothing but rounding")?;
        }
    }
    let row = |(point, (on_decoding_front, on_training_front)): (&TradeOffPoint, (bool, bool))| {
        let hidden = point.hidden().map_or_else(|| "".into(), Cell::from);
        let training = Duration::try_from_secs_f64(point.training_seconds).unwrap_or_default();
        vec![
            point.preset.to_string().into(),
            point.report.name().into(),
            hidden,
            point.report.errors.z_percent.into(),
            point.report.errors.z_mm.into(),
            point.to_reference().into(),
            point.report.cost.frame_us.into(),
            format_duration(training).into(),
            front_marks(on_decoding_front, on_training_front).into(),
        ]
    };
    let headings = [
        "preset",
        "decoder",
        "hidden",
        "Z %",
        "Z mm",
        "x reference",
        "us a frame",
        "training",
        "",
    ];
    let table = Table::of_headings(headings, level.points.iter().zip(fronts(level)).map(row));
    write!(out, "\n{}", table.aligned())?;
    for point in &level.points {
        let hidden = point
            .hidden()
            .map_or(String::new(), |hidden| format!(", {hidden} hidden"));
        for remark in &point.report.remarks {
            writeln!(
                out,
                "Warning: {}, {}{hidden}: {remark}",
                point.preset,
                point.report.name()
            )?;
        }
    }
    let [fastest, most_accurate] = choices(level, limits);
    let told = [
        fastest.map(|choice| (format!("Fastest under {} %", choice.limit), choice)),
        most_accurate.map(|choice| (format!("Most accurate under {} us", choice.limit), choice)),
    ];
    for (what, choice) in told.into_iter().flatten() {
        writeln!(out, "{what}: {}", choice.command.as_deref().unwrap_or("none"))?;
    }
    Ok(())
}
