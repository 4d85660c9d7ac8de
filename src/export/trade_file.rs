use std::io::{self, Write};

use crate::{
    decoupling::Precision,
    evaluation::{TradeOffCost, TradeOffLevel},
};

/// Writes every point of every level as CSV. Numbers are written so that reading gives the same bits; where there is none
/// the field is empty.
///
/// # Errors
/// Any error of `writer`.
pub fn write_trade_off(levels: &[TradeOffLevel], writer: &mut dyn Write) -> io::Result<()> {
    writeln!(
        writer,
        "noise,preset,decoder,precision,hidden,samples,epochs,z_percent,z_mm,frame_us,training_s,residual,\
         reference_z_percent,reference_z_mm,on_decoding_front,on_training_front"
    )?;
    for level in levels {
        let [decoding, training] = TradeOffCost::ALL.map(|cost| level.front(cost));
        for ((point, on_decoding), on_training) in level.points.iter().zip(decoding).zip(training) {
            let report = &point.report;
            let precision = match report.precision {
                Precision::Double => "f64",
                Precision::Single => "f32",
            };
            write!(
                writer,
                "{:?},{},{},{precision},",
                level.noise, point.preset, report.kind
            )?;
            if let Some(hidden) = point.hidden() {
                let epochs = point.settings.training.stopping.epochs;
                write!(writer, "{hidden},{},{epochs}", point.settings.source.samples)?;
            } else {
                write!(writer, ",{},", point.settings.source.samples)?;
            }
            let numbers = [
                report.errors.z_percent,
                Some(report.errors.z_mm),
                Some(report.cost.frame_us),
                Some(point.training_seconds),
                Some(report.residual),
                point.reference.and_then(|errors| errors.z_percent),
                point.reference.map(|errors| errors.z_mm),
            ];
            for number in numbers {
                match number.filter(|number| number.is_finite()) {
                    Some(number) => write!(writer, ",{number:?}")?,
                    None => write!(writer, ",")?,
                }
            }
            writeln!(writer, ",{on_decoding},{on_training}")?;
        }
    }
    Ok(())
}
