use std::io::{self, Write};

use super::{Cell, Table, TableColumn};
use decoupler_core::{
    evaluation::{
        Channel, DecoderReport, ErrorBlock, ErrorMeasure, ErrorRow, ErrorTable, Errors, Problem, TargetErrors,
        TestErrors,
    },
    training::EpochRecord,
};

/// Returns the error table: a row for each decoder and baseline, in a recording for each of every target.
pub fn error_table(table: &ErrorTable) -> Table {
    let has_targets = table.blocks.iter().any(|block| block.target.is_some());
    let target = has_targets.then(|| TableColumn::new("target", "Target", ""));
    let measures = table.measures.iter().copied().map(error_column);
    let row = |block: &ErrorBlock, row: &ErrorRow| -> Vec<Cell> {
        let target = has_targets.then(|| block.target.as_ref().map_or(String::new(), Channel::title).into());
        let errors = row.errors.iter().copied().map(Cell::from);
        target.into_iter().chain([row.name.into()]).chain(errors).collect()
    };
    let rows = table
        .blocks
        .iter()
        .flat_map(|block| block.rows.iter().map(move |line| row(block, line)));
    Table {
        columns: target
            .into_iter()
            .chain([TableColumn::new("decoupler", "Decoder", "")])
            .chain(measures)
            .collect(),
        rows: rows.collect(),
    }
}

/// Returns the table of measured decoders: for an array a row for each, and the Bayesian `reference` if it is more than
/// rounding; for a recording a row for each decoder and target.
pub fn decoder_table(problem: &Problem, reports: &[DecoderReport], reference: Option<&TestErrors>) -> Table {
    if problem.has_nodes {
        array_decoder_table(reports, reference.and_then(TestErrors::nodes))
    } else {
        recording_decoder_table(problem, reports)
    }
}

fn array_decoder_table(reports: &[DecoderReport], reference: Option<&Errors>) -> Table {
    let reference = reference.filter(|reference| !reference.is_rounding());
    let row = |report: &DecoderReport| {
        let nodes = report.errors.nodes();
        vec![
            report.kind.name(report.precision).into(),
            report.errors.percent().into(),
            nodes.map(|errors| errors.z_mm).into(),
            reference.and_then(|reference| nodes?.times(reference)).into(),
            report.residual.into(),
            report.cost.frame_us.into(),
        ]
    };
    let of_reference = reference.map(|errors| {
        let nothing = || Cell::Number(None);
        vec![
            "reference".into(),
            errors.z_percent.into(),
            errors.z_mm.into(),
            1.0.into(),
            nothing(),
            nothing(),
        ]
    });
    let mut table = Table {
        columns: vec![
            TableColumn::new("decoder", "Decoder", ""),
            TableColumn::new("z_percent", "Z", "%"),
            TableColumn::new("z_mm", "Z", "mm"),
            TableColumn::new("times_reference", "times reference", ""),
            TableColumn::new("residual", "residual", ""),
            TableColumn::new("frame_us", "a frame", "µs"),
        ],
        rows: reports.iter().map(row).chain(of_reference).collect(),
    };
    if reference.is_none() {
        table.remove_column("times_reference");
    }
    table
}

fn recording_decoder_table(problem: &Problem, reports: &[DecoderReport]) -> Table {
    let measures = [ErrorMeasure::Rmse, ErrorMeasure::R2, ErrorMeasure::RangePercent];
    let row = |report: &DecoderReport, target: &Channel, errors: &TargetErrors| {
        let names = [report.kind.name(report.precision).into(), target.title().into()];
        let errors = measures.map(|measure| measure.of_target(errors).into());
        let times = [report.cost.frame_us.into(), report.cost.fit_seconds.into()];
        Vec::from_iter(names.into_iter().chain(errors).chain(times))
    };
    let rows = reports.iter().flat_map(|report| {
        let targets = problem.targets.iter().zip(report.errors.targets());
        targets.map(move |(target, errors)| row(report, target, errors))
    });
    let names =
        [("decoder", "Decoder"), ("target", "Target")].map(|(field, heading)| TableColumn::new(field, heading, ""));
    let times = [
        TableColumn::new("frame_us", "a frame", "µs"),
        TableColumn::new("fit_seconds", "fit", "s"),
    ];
    let errors = measures.map(error_column);
    Table {
        columns: names.into_iter().chain(errors).chain(times).collect(),
        rows: rows.collect(),
    }
}

fn error_column(measure: ErrorMeasure) -> TableColumn {
    let (heading, unit) = measure.heading();
    TableColumn::new(measure.field(), heading, unit)
}

/// Writes the errors of every epoch as CSV, in the manner of [`Table::write_csv`].
///
/// # Errors
/// Any error of `writer`.
pub fn write_loss_curves(history: &[EpochRecord], writer: &mut dyn Write) -> io::Result<()> {
    writeln!(
        writer,
        "epoch,training_mse,validation_mse,test_mse,gradient_norm,parameter,effective_parameters"
    )?;
    for record in history {
        write!(writer, "{}", record.epoch)?;
        let values = [
            Some(record.training_mse),
            record.validation_mse,
            record.test_mse,
            Some(record.gradient_norm),
            Some(record.parameter),
            record.effective_parameters,
        ];
        for value in values {
            write_optional(value, writer)?;
        }
        writeln!(writer)?;
    }
    Ok(())
}

fn write_optional(value: Option<f64>, writer: &mut dyn Write) -> io::Result<()> {
    match value {
        Some(value) => write!(writer, ",{value:?}"),
        None => write!(writer, ","),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_table_has_gaps_where_the_paper_is_silent() {
        let row = ErrorRow {
            name: "published",
            errors: vec![Some(2.28), Some(0.22), Some(2.39e-12), None, None, None],
        };
        let problem = Problem {
            has_nodes: true,
            ..Problem::default()
        };
        let mut errors = ErrorTable::new(&problem, &[]);
        errors.blocks[0].rows.push(row);
        let mut table = Vec::new();
        error_table(&errors).write_csv(&mut table).unwrap();
        assert_eq!(
            String::from_utf8(table).unwrap(),
            "decoupler,z_percent,x_percent,y_percent,z_mm,z_full_scale_percent,worst_mm\n\
             published,2.28,0.22,2.39e-12,,,\n"
        );
    }

    #[test]
    fn loss_curves_keep_every_bit() {
        let record = EpochRecord {
            epoch: 3,
            training_mse: 0.1 + 0.2,
            validation_mse: None,
            test_mse: Some(1e-300),
            gradient_norm: f64::INFINITY,
            parameter: 1e-3,
            effective_parameters: None,
            validation_failures: 0,
        };
        let mut table = Vec::new();
        write_loss_curves(&[record], &mut table).unwrap();
        let text = String::from_utf8(table).unwrap();
        assert_eq!(text.lines().nth(1), Some("3,0.30000000000000004,,1e-300,inf,0.001,"));
    }
}
