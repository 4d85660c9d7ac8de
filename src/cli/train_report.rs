use std::{
    io::{self, Write, stdout},
    time::Duration,
};

use serde::Serialize;

use super::{failure::Failure, spread_plot::write_starts};
use crate::{
    evaluation::{Baselines, ErrorRow, Errors, PublishedErrors, RunSettings, StartRecord, error_rows},
    export::{NetworkFile, TrainingRecord, format_duration, format_number},
    sensor::{ArrayScale, Geometry},
    training::{Stage, StopReason},
};

/// What `train --json` prints.
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
}

#[derive(Serialize)]
struct Published {
    z_percent: f64,
    x_percent: f64,
    y_percent: f64,
}

fn published(settings: &RunSettings) -> Option<PublishedErrors> {
    PublishedErrors::of(settings.sensor.scale, settings.hidden, settings.samples)
}

fn epochs(training: &TrainingRecord) -> usize {
    training.history.last().map_or(0, |record| record.epoch)
}

/// Mean time of an epoch.
fn epoch_seconds(training: &TrainingRecord) -> f64 {
    training.seconds / epochs(training).max(1) as f64
}

/// Prints one JSON object.
pub(super) fn print_json(file: &NetworkFile) -> Result<(), Failure> {
    let (settings, training) = (&file.settings, &file.training);
    let best = training.history.get(training.best_epoch);
    let report = Report {
        array: settings.sensor.scale,
        hidden: settings.hidden,
        method: settings.training.method.short_name(),
        seed: settings.seed.0,
        samples: settings.samples,
        validation_samples: settings.validation_samples,
        test_samples: settings.test_samples,
        starts: &training.starts,
        stages: &training.stages,
        epochs: epochs(training),
        best_epoch: training.best_epoch,
        stop_reason: training.stop_reason,
        train_mse: best.map_or(f64::NAN, |record| record.training_mse),
        validation_mse: best.and_then(|record| record.validation_mse),
        epoch_ms: 1e3 * epoch_seconds(training),
        errors: &file.errors,
        baselines: &file.baselines,
        published: published(settings).map(|row| Published {
            z_percent: row.z_percent,
            x_percent: row.x_percent,
            y_percent: row.y_percent,
        }),
    };
    let mut output = stdout().lock();
    let written = serde_json::to_writer(&mut output, &report)
        .map_err(io::Error::from)
        .and_then(|()| writeln!(output));
    written.map_err(Failure::Output)
}

/// Prints what was trained, why it ended, and the error table.
pub(super) fn print_text(file: &NetworkFile) -> Result<(), Failure> {
    write_text(file, &mut stdout().lock()).map_err(Failure::Output)
}

fn write_text(file: &NetworkFile, out: &mut impl Write) -> io::Result<()> {
    let (settings, training) = (&file.settings, &file.training);
    let scale = settings.sensor.scale;
    let first = training.stages.first();
    let method = first.map_or(settings.training.method, |stage| stage.method);
    writeln!(
        out,
        "{scale}, {} hidden nodes, {method}, seed {}",
        settings.hidden, settings.seed
    )?;
    for stage in training.stages.iter().skip(1) {
        writeln!(out, "From epoch {} {}", stage.first_epoch, stage.method)?;
    }
    let whole = |samples: usize| samples.div_ceil(scale.rows()) * scale.rows();
    writeln!(
        out,
        "{} samples for training, {} for validation, {} for test",
        whole(settings.samples),
        whole(settings.validation_samples),
        whole(settings.test_samples)
    )?;
    let reason = training
        .stop_reason
        .map_or("not ended".to_owned(), |reason| reason.to_string());
    let time = |seconds| format_duration(Duration::try_from_secs_f64(seconds).unwrap_or_default());
    writeln!(
        out,
        "Ended after {} epochs, {} ({} an epoch): {reason}",
        epochs(training),
        time(training.seconds),
        time(epoch_seconds(training))
    )?;
    writeln!(out, "Weights kept from epoch {}\n", training.best_epoch)?;
    if training.starts.len() > 1 {
        write_starts(&training.starts, out)?;
        writeln!(out)?;
    }
    let published = published(settings);
    write_table(&error_rows(&file.errors, &file.baselines, published.as_ref()), out)?;
    writeln!(
        out,
        "\nErrors in % are means of the coordinate, as in the paper; of the stroke where said so."
    )?;
    for note in scale.note().iter().map(String::as_str).chain([Geometry::ASSUMPTION]) {
        writeln!(out, "{note}")?;
    }
    Ok(())
}

fn write_table(rows: &[ErrorRow], out: &mut impl Write) -> io::Result<()> {
    let headings = ["Z %", "X %", "Y %", "Z mm", "Z % stroke", "worst mm"];
    write!(out, "{:<14}", "")?;
    for heading in headings {
        write!(out, "{heading:>12}")?;
    }
    writeln!(out)?;
    for row in rows {
        write!(out, "{:<14}", row.name)?;
        for value in row.values() {
            write!(out, "{:>12}", format_number(value))?;
        }
        writeln!(out)?;
    }
    Ok(())
}
