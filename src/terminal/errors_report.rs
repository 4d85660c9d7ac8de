//! Errors of a decoder in JSON: of the nodes of an array, or of each target of a recording.

use std::io::{self, Write};

use decoupler_core::{
    evaluation::{
        Combination, Coverage, Spread, StartRecord, TargetErrors, TestErrors, best_start,
        recorded::{Determination, Undetermined},
    },
    problem::Channel,
};
use decoupler_files::export::format_number;
use serde::Serialize;

/// Errors of a decoder.
#[derive(Serialize)]
#[serde(untagged)]
pub(super) enum ErrorsReport<'a> {
    /// Errors of the nodes of an array.
    Nodes { z_percent: Option<f64>, z_mm: f64 },
    /// Errors of each target.
    Targets {
        /// Mean absolute error in percent of the range, averaged over the targets.
        percent_of_range: Option<f64>,
        targets: Vec<Target<'a>>,
    },
}

/// Errors for one target.
#[derive(Serialize)]
pub(super) struct Target<'a> {
    name: &'a str,
    unit: Option<&'a str>,
    rmse: f64,
    mae: f64,
    r2: Option<f64>,
    /// 95 % confidence interval of R² of the network.
    #[serde(skip_serializing_if = "Option::is_none")]
    r2_interval: Option<[f64; 2]>,
    worst: f64,
    percent_of_range: Option<f64>,
    /// 90 % prediction intervals of the network.
    #[serde(skip_serializing_if = "Option::is_none")]
    interval: Option<Coverage>,
}

impl<'a> ErrorsReport<'a> {
    pub(super) fn new(channels: &'a [Channel], errors: &TestErrors) -> Self {
        match errors {
            TestErrors::Nodes(errors) => Self::Nodes {
                z_percent: errors.z_percent,
                z_mm: errors.z_mm,
            },
            TestErrors::Targets(_) => Self::Targets {
                percent_of_range: errors.percent(),
                targets: targets(channels, errors, &[], &[]),
            },
        }
    }
}

/// Returns the errors of the targets `channels`; `determined` are the coefficients of determination with their intervals,
/// and `coverage` that of the prediction intervals, if they were measured.
pub(super) fn targets<'a>(
    channels: &'a [Channel],
    errors: &TestErrors,
    determined: &[Result<Determination, Undetermined>],
    coverage: &[Option<Coverage>],
) -> Vec<Target<'a>> {
    let target = |(index, (channel, errors)): (usize, (&'a Channel, &TargetErrors))| Target {
        name: &channel.name,
        unit: channel.unit.as_deref(),
        rmse: errors.rmse,
        mae: errors.mae,
        r2: errors.r2,
        r2_interval: determined
            .get(index)
            .and_then(|determined| determined.ok())
            .map(|determined| [determined.r2.low, determined.r2.high]),
        worst: errors.worst,
        percent_of_range: errors.percent_of_range,
        interval: coverage.get(index).copied().flatten(),
    };
    let channels = channels.iter().zip(errors.targets());
    channels.enumerate().map(target).collect()
}

/// Width of the plot in characters.
const WIDTH: usize = 64;

/// Writes the spread of the results of several starts: a table, and a box plot of the test error, called `error_name`,
/// above a strip plot of the starts.
pub(super) fn write_starts(
    starts: &[StartRecord],
    combine: Combination,
    error_name: &str,
    out: &mut dyn Write,
) -> io::Result<()> {
    let Some(best) = best_start(starts) else { return Ok(()) };
    let held_out = starts.iter().all(|start| start.validation_mse.is_some());
    let error = if held_out { "validation mse" } else { "training mse" };
    let (count, number) = (starts.len(), best + 1);
    let mark = match combine {
        Combination::Best => {
            writeln!(
                out,
                "{count} starts, of which number {number} is kept: it has the lowest {error}"
            )?;
            "the one kept"
        }
        Combination::Mean => {
            writeln!(
                out,
                "{count} starts, whose mean is the network; number {number} has the lowest {error}"
            )?;
            "the one with the lowest error"
        }
    };
    let z_percent: Vec<f64> = starts.iter().filter_map(StartRecord::percent).collect();
    let rows = [
        (error_name, Spread::of(z_percent.iter().copied())),
        (error, Spread::of(starts.iter().map(StartRecord::deciding_mse))),
    ];
    let width = error_name.len().max(14) + 2;
    write!(out, "{:<width$}", "")?;
    for heading in ["smallest", "quartile 1", "median", "quartile 3", "largest"] {
        write!(out, "{heading:>11}")?;
    }
    writeln!(out)?;
    for (name, spread) in rows {
        let Some(spread) = spread else { continue };
        let figures = [
            spread.smallest,
            spread.lower_quartile,
            spread.median,
            spread.upper_quartile,
            spread.largest,
        ];
        write!(out, "{name:<width$}")?;
        for figure in figures {
            write!(out, "{:>11}", format_number(figure))?;
        }
        writeln!(out)?;
    }
    match (rows[0].1, starts[best].percent()) {
        (Some(spread), Some(kept)) if spread.smallest < spread.largest => {
            let [plot, strip] = plot(&spread, &z_percent, kept);
            writeln!(out, "\n{plot}  box: quartiles of {error_name}, | median")?;
            writeln!(out, "{strip}  o a start, * {mark}")
        }
        _ => Ok(()),
    }
}

/// A box plot and the strip plot below it.
fn plot(spread: &Spread, values: &[f64], kept: f64) -> [String; 2] {
    let column = |value: f64| {
        let share = (value - spread.smallest) / (spread.largest - spread.smallest);
        (share * (WIDTH - 1) as f64).round() as usize
    };
    let (lower, upper) = (column(spread.lower_quartile), column(spread.upper_quartile));
    let mut plot: Vec<char> = (0..WIDTH)
        .map(|column| if (lower..=upper).contains(&column) { '=' } else { '-' })
        .collect();
    plot[lower] = '[';
    plot[upper] = ']';
    plot[column(spread.median)] = '|';
    let mut strip = vec![' '; WIDTH];
    for value in values {
        strip[column(*value)] = 'o';
    }
    strip[column(kept)] = '*';
    [plot, strip].map(|line| line.into_iter().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn start(validation_mse: f64, z_percent: f64) -> StartRecord {
        StartRecord {
            train_mse: 1.0,
            validation_mse: Some(validation_mse),
            z_percent: Some(z_percent),
            percent_of_range: None,
            epochs: 1,
            best_epoch: 1,
            stop_reason: None,
        }
    }

    #[test]
    fn the_plot_shows_quartiles_and_the_kept_start() {
        let starts = [start(3.0, 1.0), start(1.0, 2.0), start(2.0, 4.15), start(5.0, 7.3)];
        let mut text = Vec::new();
        write_starts(&starts, Combination::Best, "test Z %", &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(
            lines[0],
            "4 starts, of which number 2 is kept: it has the lowest validation mse"
        );
        let figures: Vec<_> = lines[2].split_whitespace().collect();
        assert_eq!(figures, ["test", "Z", "%", "1.00", "1.75", "3.08", "4.94", "7.30"]);
        // Ten columns for each unit of Z.
        let column = |line: &str, mark| line.chars().position(|c| c == mark).unwrap();
        assert_eq!(['[', '|', ']'].map(|mark| column(lines[5], mark)), [8, 21, 39]);
        assert_eq!(column(lines[6], '*'), 10);
        assert_eq!(lines[6].chars().take(WIDTH).filter(|c| *c == 'o').count(), 3);
    }

    #[test]
    fn equal_starts_have_no_plot() {
        let mut text = Vec::new();
        write_starts(&[start(1.0, 2.0); 3], Combination::Best, "test Z %", &mut text).unwrap();
        assert_eq!(String::from_utf8(text).unwrap().lines().count(), 4);
    }
}
