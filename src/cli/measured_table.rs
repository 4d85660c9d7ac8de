use std::io::{self, Write};

use serde::Serialize;

use crate::{
    evaluation::Channel,
    evaluation::{
        TargetErrors,
        recorded::{Determination, Undetermined},
    },
    export::format_number,
};

/// Errors for one target.
#[derive(Serialize)]
pub(super) struct Target<'a> {
    name: &'a str,
    unit: Option<&'a str>,
    rmse: f64,
    mae: f64,
    r2: Option<f64>,
    /// 95 % confidence interval of R², of the network.
    #[serde(skip_serializing_if = "Option::is_none")]
    r2_interval: Option<[f64; 2]>,
    worst: f64,
    percent_of_range: Option<f64>,
}

pub(super) fn targets<'a>(
    channels: &'a [Channel],
    errors: &[TargetErrors],
    told: &[Result<Determination, Undetermined>],
) -> Vec<Target<'a>> {
    let target = |(index, (channel, errors)): (usize, (&'a Channel, &TargetErrors))| Target {
        name: &channel.name,
        unit: channel.unit.as_deref(),
        rmse: errors.rmse,
        mae: errors.mae,
        r2: errors.r2,
        r2_interval: told
            .get(index)
            .and_then(|told| told.ok())
            .map(|told| [told.r2.low, told.r2.high]),
        worst: errors.worst,
        percent_of_range: errors.percent_of_range,
    };
    channels.iter().zip(errors).enumerate().map(target).collect()
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
    let names = rows.iter().map(|(name, _)| name.chars().count());
    let name_width = names.max().unwrap_or(0).max(8);
    writeln!(
        out,
        "{:<width$}  {:<name_width$}{:>11}{:>11}{:>9}{:>11}{:>11}",
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
                "{title:<width$}  {name:<name_width$}{:>11}{:>11}{:>9}{:>11}{:>11}",
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
