//! Tables of the measurements, to be exported.

use super::thread::{Decoders, Told};
use crate::export::{Cell, Table, TableColumn};

fn columns<const N: usize>(columns: [(&'static str, &'static str, &'static str); N]) -> Vec<TableColumn> {
    columns
        .map(|(field, heading, unit)| TableColumn::new(field, heading, unit))
        .into()
}

/// Growth of the error of each target without each channel.
pub fn channel_table(told: &Told) -> Table {
    let mut rows = Vec::new();
    for channel in &told.findings.importance {
        for (target, growth) in told.targets.iter().zip(&channel.growth) {
            let name = |text: &str| Cell::Text(text.to_owned());
            let figures = [
                growth.map(|growth| growth.value),
                growth.map(|growth| growth.low),
                growth.map(|growth| growth.high),
            ];
            let mut cells = vec![name(&told.inputs[channel.channel].name), name(&target.name)];
            cells.extend(figures.map(Cell::Number));
            rows.push(cells);
        }
    }
    let columns = columns([
        ("channel", "Channel", ""),
        ("target", "Target", ""),
        ("rmse_ratio", "RMSE without it / with all", ""),
        ("low", "from", ""),
        ("high", "to", ""),
    ]);
    Table { columns, rows }
}

/// Errors and times of the decoders, target by target.
pub fn decoders_table(decoders: &Decoders) -> Table {
    let mut rows = Vec::new();
    for report in &decoders.reports {
        for (target, errors) in decoders.of.targets.iter().zip(&report.targets) {
            let unit = target.unit.clone().unwrap_or_default();
            let mut cells = vec![
                Cell::Text(report.kind.name(report.precision).to_owned()),
                Cell::Text(target.name.clone()),
                Cell::Text(unit),
            ];
            cells.extend([
                errors.rmse.into(),
                Cell::r2(errors.r2),
                report.cost.frame_us.into(),
                report.cost.fit_seconds.into(),
            ]);
            rows.push(cells);
        }
    }
    let columns = columns([
        ("decoder", "Decoder", ""),
        ("target", "Target", ""),
        ("unit", "Unit", ""),
        ("rmse", "RMSE", ""),
        ("r2", "R²", ""),
        ("decoding_us", "decoding", "µs"),
        ("fit_seconds", "fit", "s"),
    ]);
    Table { columns, rows }
}
