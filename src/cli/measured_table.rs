use std::io::{self, Write};

use serde::Serialize;

use crate::{
    evaluation::{
        TargetErrors,
        recorded::{Determination, Undetermined},
    },
    export::{Cell, Table},
    import::Channel,
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
    let of_target = |(index, channel): (usize, &Channel)| {
        let errors = rows.iter().enumerate().filter_map(move |(number, (name, errors))| {
            let errors = errors.get(index)?;
            let title = if number == 0 { channel.title() } else { String::new() };
            Some(vec![
                title.into(),
                (*name).into(),
                errors.rmse.into(),
                errors.mae.into(),
                Cell::r2(errors.r2),
                errors.worst.into(),
                errors.percent_of_range.into(),
            ])
        });
        errors.collect::<Vec<_>>()
    };
    let headings = ["target", "", "RMSE", "MAE", "R²", "worst", "% of range"];
    let table = Table::of_headings(headings, channels.iter().enumerate().flat_map(of_target));
    write!(out, "{}", table.aligned())
}

pub(super) fn write_warnings(warnings: &[String], out: &mut impl Write) -> io::Result<()> {
    warnings
        .iter()
        .try_for_each(|warning| writeln!(out, "Warning: {warning}"))
}
