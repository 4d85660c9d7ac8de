//! The figure of decoding time against the error of a target.

use super::{
    axis::PlotAxis,
    look::{Hue, Key, LineStyle, Look, Marker},
    of_trade_off::steps,
    plot::{Plot, PlotPoint, Series},
    plot_figure::PlotFigure,
    trade_words::frame_time,
};
use crate::{
    decoupling::Precision,
    evaluation::Channel,
    evaluation::{DecoderReport, format::format_number, pareto_front},
};

/// Error of each decoder for the target at this place against its time to decode `decoded` ("a sample"), with the Pareto
/// front: what no other decoder beats in both.
pub fn decoders_figure(reports: &[DecoderReport], target: usize, channel: &Channel, decoded: &str) -> PlotFigure {
    let at = |report: &DecoderReport| (report.cost.frame_us, report.errors.targets()[target].rmse);
    let places: Vec<(f64, f64)> = reports.iter().map(at).collect();
    let is_on_front = pareto_front(&places);
    let front = Look::line(Hue::Grey, LineStyle::Solid);
    let chosen = places.iter().zip(&is_on_front).filter(|(_, is_chosen)| **is_chosen);
    let mut series = vec![Series::new(
        "Pareto front",
        front,
        steps(chosen.map(|(&(x, y), _)| [x, y])),
    )];
    for (report, &(x, y)) in reports.iter().zip(&places) {
        let name = report.kind.name(report.precision);
        let marker = match report.precision {
            Precision::Double => Marker::Disc,
            Precision::Single => Marker::Ring,
        };
        let unit = channel
            .unit
            .as_ref()
            .map_or_else(String::new, |unit| format!(" {unit}"));
        let note = format!(
            "{name}\nRMSE {}{unit}\n{} for {decoded}",
            format_number(y),
            frame_time(x)
        );
        let point = PlotPoint {
            note: Some(note),
            label: Some(name.to_owned()),
            ..PlotPoint::from([x, y])
        };
        series.push(Series {
            points: vec![point],
            ..Series::new(name, Look::marker(report.kind.colour().into(), marker), [])
        });
    }
    PlotFigure {
        plots: vec![Plot::new(
            PlotAxis::logarithmic(format!("time to decode {decoded} (µs)")),
            PlotAxis::logarithmic(format!("RMSE of {}", channel.title())),
            series,
        )],
        keys: vec![Key::new("Pareto front", front)],
        notes: Vec::new(),
    }
}
