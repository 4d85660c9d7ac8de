use std::io::{self, Write};

use serde::Serialize;

use crate::{evaluation::TargetErrors, export::format_number, import::Channel};

/// R² on the test samples below which readings hardly tell a target.
const HARDLY: f64 = 0.4;

/// Errors for one target.
#[derive(Serialize)]
pub(super) struct Target<'a> {
    name: &'a str,
    unit: Option<&'a str>,
    rmse: f64,
    mae: f64,
    r2: Option<f64>,
    worst: f64,
    percent_of_range: Option<f64>,
}

/// Warns of targets that the readings hardly tell, and of networks that are worse than ridge.
pub(super) fn judgements(channels: &[Channel], network: &[TargetErrors], ridge: &[TargetErrors]) -> Vec<String> {
    let mut words = Vec::new();
    for ((channel, network), ridge) in channels.iter().zip(network).zip(ridge) {
        let name = &channel.name;
        match network.r2 {
            None => words.push(format!("{name} is constant in the test samples: nothing can be judged")),
            Some(r2) if r2 < HARDLY => words.push(format!(
                "the readings hardly tell {name}: R² {r2:.2} on the test samples, where always answering their mean has 0"
            )),
            Some(_) => {}
        }
        if network.rmse > ridge.rmse {
            words.push(format!(
                "for {name} the network is worse than ridge regression (RMSE {} against {}): record more samples, or use \
                 fewer hidden nodes or --method br",
                format_number(network.rmse),
                format_number(ridge.rmse)
            ));
        }
    }
    words
}

pub(super) fn targets<'a>(channels: &'a [Channel], errors: &[TargetErrors]) -> Vec<Target<'a>> {
    let target = |(channel, errors): (&'a Channel, &TargetErrors)| Target {
        name: &channel.name,
        unit: channel.unit.as_deref(),
        rmse: errors.rmse,
        mae: errors.mae,
        r2: errors.r2,
        worst: errors.worst,
        percent_of_range: errors.percent_of_range,
    };
    channels.iter().zip(errors).map(target).collect()
}

/// Writes the errors of each target, one line for each of `rows`.
pub(super) fn write_table(
    channels: &[Channel],
    rows: &[(&str, &[TargetErrors])],
    out: &mut impl Write,
) -> io::Result<()> {
    let width = channels
        .iter()
        .map(|channel| channel.title().chars().count())
        .max()
        .unwrap_or(0)
        .max(6);
    writeln!(
        out,
        "{:<width$}  {:<8}{:>11}{:>11}{:>9}{:>11}{:>11}",
        "target", "", "RMSE", "MAE", "R²", "worst", "% of range"
    )?;
    for (index, channel) in channels.iter().enumerate() {
        for (number, (name, errors)) in rows.iter().enumerate() {
            let Some(errors) = errors.get(index) else { continue };
            let title = if number == 0 { channel.title() } else { String::new() };
            let or_none =
                |value: Option<f64>, digits| value.map_or("–".to_owned(), |value| format!("{value:.digits$}"));
            writeln!(
                out,
                "{title:<width$}  {name:<8}{:>11}{:>11}{:>9}{:>11}{:>11}",
                format_number(errors.rmse),
                format_number(errors.mae),
                or_none(errors.r2, 4),
                format_number(errors.worst),
                or_none(errors.percent_of_range, 2)
            )?;
        }
    }
    Ok(())
}

pub(super) fn write_warnings(warnings: &[String], out: &mut impl Write) -> io::Result<()> {
    warnings
        .iter()
        .try_for_each(|warning| writeln!(out, "Warning: {warning}"))
}
