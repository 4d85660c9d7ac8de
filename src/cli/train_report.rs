use std::{
    collections::BTreeMap,
    io::{self, Write},
    time::Duration,
};

use serde::Serialize;

use super::{failure::Failure, output::print, spread_plot::write_starts};
use crate::{
    evaluation::{
        Baselines, DecoderReport, ErrorRow, Errors, Outlook, ReferenceNote, RunError, RunFlaw, SimulatedSettings,
        StartRecord, best_start, error_remarks, error_rows,
    },
    export::{Cell, NetworkFile, Table, TrainingRecord, format_duration},
    network::InputChoice,
    scene::{Noise, NoisySets, Scene},
    sensor::{ArrayScale, Geometry, counted},
    training::{Stage, StopReason},
};

/// The object printed by `train --json`.
#[derive(Serialize)]
struct Report<'a> {
    array: ArrayScale,
    hidden: usize,
    method: &'static str,
    seed: u64,
    samples: usize,
    validation_samples: usize,
    test_samples: usize,
    starts: &'a [StartRecord],
    stages: &'a [Stage],
    epochs: usize,
    best_epoch: usize,
    stop_reason: Option<StopReason>,
    train_mse: f64,
    validation_mse: Option<f64>,
    epoch_ms: f64,
    errors: &'a Errors,
    baselines: &'a Baselines,
    published: Option<Published>,
    scene: &'a Scene,
    inputs: &'a InputChoice,
    unknowns: usize,
    equations: usize,
    networks: usize,
    weights: usize,
    condition: Option<f64>,
    warnings: Vec<String>,
    /// Remarks on the errors above, with cause and cure.
    remarks: Vec<String>,
    decoders: BTreeMap<String, Decoder>,
    reference: Option<Reference>,
}

#[derive(Serialize)]
struct Decoder {
    z_percent: Option<f64>,
    z_mm: f64,
    frame_us: f64,
    /// Root mean square of m/R − 1; none if the decoded deformation has no resistance.
    residual: Option<f64>,
    fit_seconds: f64,
    /// Remarks on the errors, with cause and cure.
    remarks: Vec<String>,
    /// None for decoders that do not solve the equations of the sensor.
    solved: Option<Solved>,
}

#[derive(Serialize)]
struct Solved {
    rows: usize,
    unsolved: usize,
    undetermined: usize,
}

#[derive(Serialize)]
struct Reference {
    z_percent: Option<f64>,
    z_mm: f64,
}

#[derive(Serialize)]
struct Published {
    z_percent: f64,
    x_percent: f64,
    y_percent: f64,
}

fn epochs(training: &TrainingRecord) -> usize {
    training.history.last().map_or(0, |record| record.epoch)
}

/// Mean time of an epoch.
fn epoch_seconds(training: &TrainingRecord) -> f64 {
    training.seconds / epochs(training).max(1) as f64
}

/// Returns the object printed by `train --json`.
pub(super) fn report<'a>(
    file: &'a NetworkFile,
    flaw: Option<&RunFlaw>,
    decoders: &[DecoderReport],
) -> Result<impl Serialize + use<'a>, Failure> {
    let (settings, training) = (&file.settings, &file.training);
    let best = training.history.get(training.best_epoch);
    let size = settings.source.model_size().map_err(RunError::from)?;
    let outlook = Outlook::of(&settings.source).ok();
    let best_start = best_start(&training.starts).and_then(|number| training.starts.get(number));
    Ok(Report {
        array: settings.source.sensor.scale,
        hidden: settings.hidden,
        method: settings.training.method.short_name(),
        seed: settings.seed.0,
        samples: settings.source.samples,
        validation_samples: settings.source.validation_samples,
        test_samples: settings.source.test_samples,
        starts: &training.starts,
        stages: &training.stages,
        epochs: epochs(training),
        best_epoch: training.best_epoch,
        stop_reason: training.stop_reason,
        train_mse: best_start.map_or_else(
            || best.map_or(f64::NAN, |record| record.training_mse),
            |start| start.train_mse,
        ),
        validation_mse: best_start.map_or_else(
            || best.and_then(|record| record.validation_mse),
            |start| start.validation_mse,
        ),
        epoch_ms: 1e3 * epoch_seconds(training),
        errors: &file.errors,
        baselines: &file.baselines,
        published: settings.published().map(|row| Published {
            z_percent: row.z_percent,
            x_percent: row.x_percent,
            y_percent: row.y_percent,
        }),
        scene: &settings.source.scene,
        inputs: &settings.inputs,
        unknowns: size.unknowns,
        equations: size.equations,
        networks: size.networks,
        weights: file.network.weights(),
        condition: condition(outlook.as_ref()),
        warnings: warnings(outlook.as_ref())
            .into_iter()
            .chain(flaw.map(ToString::to_string))
            .collect(),
        remarks: remarks(file),
        decoders: decoders.iter().map(|report| (report.name(), decoder(report))).collect(),
        reference: file.baselines.reference.as_ref().map(|errors| Reference {
            z_percent: errors.z_percent,
            z_mm: errors.z_mm,
        }),
    })
}

fn decoder(report: &DecoderReport) -> Decoder {
    Decoder {
        z_percent: report.errors.z_percent,
        z_mm: report.errors.z_mm,
        frame_us: report.cost.frame_us,
        residual: Some(report.residual).filter(|residual| residual.is_finite()),
        fit_seconds: report.cost.fit_seconds,
        remarks: report.remarks.iter().map(ToString::to_string).collect(),
        solved: (report.solved.rows > 0).then_some(Solved {
            rows: report.solved.rows,
            unsolved: report.solved.unsolved,
            undetermined: report.solved.undetermined,
        }),
    }
}

/// Remarks on the rows of the error table.
fn remarks(file: &NetworkFile) -> Vec<String> {
    let reason = file.training.stop_reason;
    let remarks = error_remarks(&file.settings, &file.errors, &file.baselines, reason);
    let told = remarks.iter().map(|(row, remark)| format!("{row}: {remark}"));
    told.chain(ReferenceNote::of(&file.baselines).map(|note| note.to_string()))
        .collect()
}

/// Condition number of the worst row; none if the Jacobian is singular.
fn condition(outlook: Option<&Outlook>) -> Option<f64> {
    let condition = outlook?.worst_row.condition();
    Some(condition).filter(|condition| condition.is_finite())
}

fn warnings(outlook: Option<&Outlook>) -> Vec<String> {
    let warnings = outlook.iter().flat_map(|outlook| &outlook.warnings);
    warnings.map(ToString::to_string).collect()
}

/// Prints what was trained, why it ended, and the error table.
pub(super) fn print_text(
    file: &NetworkFile,
    flaw: Option<&RunFlaw>,
    decoders: &[DecoderReport],
) -> Result<(), Failure> {
    print(|output| write_text(file, flaw, decoders, output))
}

fn write_text(
    file: &NetworkFile,
    flaw: Option<&RunFlaw>,
    decoders: &[DecoderReport],
    out: &mut impl Write,
) -> io::Result<()> {
    let (settings, training) = (&file.settings, &file.training);
    let scale = settings.source.sensor.scale;
    let first = training.stages.first();
    let method = first.map_or(settings.training.method, |stage| stage.method);
    writeln!(
        out,
        "{scale}, {}, {method}, seed {}",
        counted(settings.hidden, "hidden node"),
        settings.seed
    )?;
    for stage in training.stages.iter().skip(1) {
        writeln!(out, "From epoch {} {}", stage.first_epoch, stage.method)?;
    }
    write_scene(file, out)?;
    let rows = settings.source.model_size().map_or(1, |size| size.rows);
    let whole = |samples: usize| samples.div_ceil(rows) * rows;
    writeln!(
        out,
        "{} for training, {} for validation, {} for test",
        counted(whole(settings.source.samples), "sample"),
        whole(settings.source.validation_samples),
        whole(settings.source.test_samples)
    )?;
    let reason = training
        .stop_reason
        .map_or("not ended".to_owned(), |reason| reason.to_string());
    let time = |seconds| format_duration(Duration::try_from_secs_f64(seconds).unwrap_or_default());
    writeln!(
        out,
        "Ended after {}, {} on one thread ({} an epoch): {reason}",
        counted(epochs(training), "epoch"),
        time(training.seconds),
        time(epoch_seconds(training))
    )?;
    writeln!(out, "Weights kept from epoch {}", training.best_epoch)?;
    if let Some(flaw) = flaw {
        writeln!(out, "Warning: {flaw}")?;
    }
    writeln!(out)?;
    if training.starts.len() > 1 {
        write_starts(&training.starts, out)?;
        writeln!(out)?;
    }
    let published = settings.published();
    write_table(&error_rows(&file.errors, &file.baselines, published.as_ref()), out)?;
    for remark in remarks(file) {
        writeln!(out, "Warning: {remark}")?;
    }
    let reference = file.baselines.reference.as_ref();
    if reference.is_some_and(Errors::is_rounding) {
        writeln!(
            out,
            "The reference is nothing but rounding: the readings determine the deformation, and no ratio to it is \
             given."
        )?;
    }
    write_decoders(decoders, reference, out)?;
    writeln!(
        out,
        "\nErrors in % are relative to the coordinate, as in the paper, or to the stroke where stated."
    )?;
    for note in scale.note().iter().map(String::as_str).chain([Geometry::ASSUMPTION]) {
        writeln!(out, "{note}")?;
    }
    Ok(())
}

/// Writes the scene, the size of its equations and of the network, and warnings.
fn write_scene(file: &NetworkFile, out: &mut impl Write) -> io::Result<()> {
    let SimulatedSettings { source, inputs, .. } = &file.settings;
    let scene = &source.scene;
    let Noise {
        relative,
        additive_ohm,
        converter_bits,
        drift,
        sets,
    } = scene.noise;
    write!(
        out,
        "Rows {}, axes {}, loading {}, inputs {} ({})",
        scene.rows, scene.movement, scene.loading, inputs.quantity, inputs.scaling
    )?;
    let noises = [
        (relative > 0.0).then(|| format!("noise {relative:e}")),
        (additive_ohm > 0.0).then(|| format!("noise {additive_ohm:e} ohm")),
        converter_bits.map(|bits| format!("{bits} bits")),
        (drift > 0.0).then(|| format!("drift {drift:e}")),
        (!scene.noise.is_none() && sets == NoisySets::Training).then(|| "in training only".to_owned()),
        (!scene.noise.is_none() && sets == NoisySets::Test).then(|| "in test only".to_owned()),
    ];
    for noise in noises.into_iter().flatten() {
        write!(out, ", {noise}")?;
    }
    writeln!(out)?;
    if let Ok(size) = file.settings.source.model_size() {
        write!(
            out,
            "A frame has {} and {}; {} with {}",
            counted(size.unknowns, "unknown"),
            counted(size.equations, "equation"),
            counted(size.networks, "network"),
            counted(file.network.weights(), "weight")
        )?;
    }
    let outlook = Outlook::of(source).ok();
    match condition(outlook.as_ref()) {
        Some(condition) => writeln!(out, "; condition number of the worst row {condition:.1e}")?,
        None => writeln!(out)?,
    }
    for warning in warnings(outlook.as_ref()) {
        writeln!(out, "Warning: {warning}")?;
    }
    Ok(())
}

/// Writes the errors of each decoder and their ratio to the reference.
fn write_decoders(decoders: &[DecoderReport], reference: Option<&Errors>, out: &mut impl Write) -> io::Result<()> {
    if decoders.is_empty() {
        return Ok(());
    }
    let row = |report: &DecoderReport| {
        let ratio = reference.and_then(|reference| report.errors.times(reference));
        vec![
            report.name().into(),
            report.errors.z_percent.into(),
            report.errors.z_mm.into(),
            ratio.into(),
            report.residual.into(),
            report.cost.frame_us.into(),
        ]
    };
    let headings = ["Decoder", "Z %", "Z mm", "x reference", "residual", "us a frame"];
    let table = Table::of_headings(headings, decoders.iter().map(row));
    write!(out, "\n{}", table.aligned())?;
    for report in decoders {
        for remark in &report.remarks {
            writeln!(out, "Warning: {}: {remark}", report.name())?;
        }
    }
    writeln!(
        out,
        "The residual is the rms relative difference between the readings and those of the decoded deformation; it \
         needs no ground truth."
    )
}

fn write_table(rows: &[ErrorRow], out: &mut impl Write) -> io::Result<()> {
    let row = |row: &ErrorRow| {
        let values = row.values().into_iter().map(Cell::from);
        std::iter::once(row.name.into()).chain(values).collect()
    };
    let headings = ["", "Z %", "X %", "Y %", "Z mm", "Z % stroke", "worst mm"];
    write!(out, "{}", Table::of_headings(headings, rows.iter().map(row)).aligned())
}
