use super::figures::{Hue, Marker, Plot, PlotAxis, PlotPoint, Series};
use crate::{
    decoupling::{ColourKey, DecoderKind},
    evaluation::{Preset, TradeCost, TradeLevel, TradePoint},
};

/// The picture of one level of noise: the points of each decoder, the front, and the Bayesian reference.
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
            all.push(series(
                name,
                hue(kind.colour()),
                Some(marker),
                points.map(place).collect(),
            ));
        }
    }
    let limit = level.points.first().and_then(|point| point.reference);
    let limit = limit
        .filter(|limit| !limit.is_rounding())
        .and_then(|limit| limit.z_percent);
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
        ..series("Bayesian reference".to_owned(), Hue::Grey, None, ends.collect())
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

/// Colour of a decoder in print.
fn hue(colour: ColourKey) -> Hue {
    match colour {
        ColourKey::Grey => Hue::Grey,
        ColourKey::Violet => Hue::Violet,
        ColourKey::Blue => Hue::Blue,
        ColourKey::Orange => Hue::Orange,
        ColourKey::Red => Hue::Red,
        ColourKey::Green => Hue::Green,
        ColourKey::Cyan => Hue::Cyan,
    }
}
