use std::io::{self, Write};

use crate::{evaluation::ErrorRow, training::EpochRecord};

/// Writes an error table as CSV. Numbers are written so that reading gives the same bits; where there is none the
/// field is empty.
///
/// # Errors
/// Any error of `writer`.
pub fn write_errors(rows: &[ErrorRow], writer: &mut dyn Write) -> io::Result<()> {
    writeln!(writer, "decoupler,{}", ErrorRow::COLUMNS.join(","))?;
    for row in rows {
        write!(writer, "{}", row.name)?;
        for value in row.values() {
            write_optional(value, writer)?;
        }
        writeln!(writer)?;
    }
    Ok(())
}

/// Writes the errors of every epoch as CSV, in the manner of [`write_errors`].
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
            z_percent: Some(2.28),
            x_percent: Some(0.22),
            y_percent: Some(2.39e-12),
            z_mm: None,
            z_full_scale_percent: None,
            worst_mm: None,
        };
        let mut table = Vec::new();
        write_errors(&[row], &mut table).unwrap();
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
