//! Speed against accuracy for other programs: a table of all points, and the picture of one level of noise.

use std::io::{self, Write};

use super::figures::{Hue, Marker, Plot, PlotAxis, PlotPoint, Series};
use crate::evaluation::{DecoderKind, Precision, Preset, TradeCost, TradeLevel, TradePoint};

/// Writes every point of every level as CSV. Numbers are written so that reading gives the same bits; where there is none
/// the field is empty.
///
/// # Errors
/// What `writer` said.
pub fn write_trade(levels: &[TradeLevel], writer: &mut dyn Write) -> io::Result<()> {
    writeln!(
        writer,
        "noise,preset,decoder,precision,hidden,samples,epochs,z_percent,z_mm,frame_us,training_s,residual,\
         reference_z_percent,reference_z_mm,on_decoding_front,on_training_front"
    )?;
    for level in levels {
        let [decoding, training] = TradeCost::ALL.map(|cost| level.front(cost));
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
                write!(writer, "{hidden},{},{epochs}", point.settings.samples)?;
            } else {
                write!(writer, ",{},", point.settings.samples)?;
            }
            let numbers = [
                report.errors.z_percent,
                Some(report.errors.z_mm),
                Some(report.frame_us),
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

/// The picture of one level of noise: the points of each decoder, the front, and the limit that physics sets.
pub fn trade_plot(level: &TradeLevel, cost: TradeCost) -> Plot {
    let place = |point: &TradePoint| {
        let (x, y) = cost.of(point);
        PlotPoint { x, y, bar: None }
    };
    let series = |name: String, hue, marker: Option<Marker>, points: Vec<PlotPoint>| Series {
        name,
        hue,
        has_line: marker.is_none(),
        is_dashed: false,
        marker,
        points,
    };
    let chosen = level.points.iter().zip(level.front(cost));
    let mut front: Vec<PlotPoint> = chosen
        .filter(|(_, is_chosen)| *is_chosen)
        .map(|(point, _)| place(point))
        .collect();
    front.sort_by(|a, b| a.x.total_cmp(&b.x));
    let mut all = vec![series("no other is better".to_owned(), Hue::Grey, None, front)];
    for kind in DecoderKind::ALL {
        for (preset, marker) in [(Preset::Paper, Marker::Ring), (Preset::Best, Marker::Disc)] {
            let points = level.points.iter();
            let points = points.filter(|point| point.report.kind == kind && point.preset == preset);
            let name = format!("{kind}, {preset} preset");
            all.push(series(name, hue(kind), Some(marker), points.map(place).collect()));
        }
    }
    let limit = level.points.first().and_then(|point| point.reference?.z_percent);
    let costs = level
        .points
        .iter()
        .map(|point| cost.of(point).0)
        .filter(|x| x.is_finite() && *x > 0.0);
    let ends = [costs.clone().reduce(f64::min), costs.reduce(f64::max)];
    let ends = ends.into_iter().flatten().filter_map(|x| {
        Some(PlotPoint {
            x,
            y: limit?,
            bar: None,
        })
    });
    all.push(Series {
        is_dashed: true,
        ..series(
            "limit of physics".to_owned(),
            Hue::Grey,
            None,
            ends.filter(|end| end.y > 0.0).collect(),
        )
    });
    all.retain(|series| !series.points.is_empty());
    Plot {
        x: PlotAxis::logarithmic(cost.name()),
        y: PlotAxis::logarithmic("Z error (%)"),
        series: all,
        spans: Vec::new(),
        width_pt: Plot::WIDE_PT,
    }
}

fn hue(kind: DecoderKind) -> Hue {
    match kind {
        DecoderKind::Mean => Hue::Grey,
        DecoderKind::Ridge => Hue::Violet,
        DecoderKind::Network => Hue::Blue,
        DecoderKind::RadialBasis => Hue::Orange,
        DecoderKind::Newton => Hue::Red,
        DecoderKind::Polish => Hue::Green,
    }
}
