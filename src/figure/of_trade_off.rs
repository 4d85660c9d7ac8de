//! The figure of speed against accuracy.

use super::{
    axis::PlotAxis,
    look::{Hue, Key, LineStyle, Look, Marker},
    plot::{LineAt, Plot, PlotPoint, ReferenceLine, Series},
    plot_figure::PlotFigure,
    trade_words::{frame_time, point_facts, point_name},
};
use crate::{
    decoupling::{DecoderKind, Precision},
    evaluation::{Preset, TradeCost, TradeLevel, TradeLimits, TradePoint, format::format_percent},
};

const FRONT: Look = Look {
    hue: Hue::Grey,
    line: Some(LineStyle::Solid),
    marker: None,
};
const REFERENCE: Look = Look {
    hue: Hue::Ink,
    line: Some(LineStyle::Dashed),
    marker: None,
};
const LIMIT: Look = Look {
    hue: Hue::Blue,
    line: Some(LineStyle::Dotted),
    marker: None,
};
const ANSWER: Look = Look {
    hue: Hue::Blue,
    line: None,
    marker: Some(Marker::Halo),
};

/// The points at one level of noise, one plot for each cost: colours tell the decoder, discs and diamonds the preset,
/// hollow marks 32 bits. With the Pareto front, the Bayesian reference, and the answers to the two questions with their
/// limits.
pub fn trade_off_figure(level: &TradeLevel, limits: &TradeLimits) -> PlotFigure {
    let plots: Vec<Plot> = TradeCost::ALL.map(|cost| plot(level, limits, cost)).into();
    let mut keys = Vec::new();
    for kind in DecoderKind::ALL {
        let is_there = level.points.iter().any(|point| point.report.kind == kind);
        let look = Look::marker(kind.colour().into(), Marker::Disc);
        keys.extend(is_there.then(|| Key::new(kind.name(Precision::Double), look)));
    }
    for preset in Preset::ALL {
        let of_preset = |precision: Precision| {
            let mut points = level.points.iter();
            points.any(|point| (point.preset, point.report.precision) == (preset, precision))
        };
        for (precision, bits) in [(Precision::Double, ""), (Precision::Single, ", 32 bits")] {
            let look = Look::marker(Hue::Ink, marker(preset, precision));
            keys.extend(of_preset(precision).then(|| Key::new(format!("{preset} preset{bits}"), look)));
        }
    }
    let has = |look: Look| {
        let mut series = plots.iter().flat_map(|plot| &plot.series);
        let mut lines = plots.iter().flat_map(|plot| &plot.lines);
        series.any(|series| series.look == look && !series.points.is_empty())
            || lines.any(|line| (line.hue, Some(line.style)) == (look.hue, look.line))
    };
    let questions = format!(
        "fastest under {}, most accurate under {}",
        format_percent(limits.percent),
        frame_time(limits.microseconds)
    );
    let marks = [
        ("no other is better", FRONT),
        ("Bayesian reference", REFERENCE),
        (&*questions, ANSWER),
        ("their limits", LIMIT),
    ];
    keys.extend(
        marks
            .into_iter()
            .filter(|(_, look)| has(*look))
            .map(|(name, look)| Key::new(name, look)),
    );
    PlotFigure {
        plots,
        keys,
        notes: Vec::new(),
    }
}

fn marker(preset: Preset, precision: Precision) -> Marker {
    match (preset, precision) {
        (Preset::Paper, Precision::Double) => Marker::Disc,
        (Preset::Paper, Precision::Single) => Marker::Ring,
        (Preset::Best, Precision::Double) => Marker::Diamond,
        (Preset::Best, Precision::Single) => Marker::HollowDiamond,
    }
}

fn plot(level: &TradeLevel, limits: &TradeLimits, cost: TradeCost) -> Plot {
    let at = |point: &TradePoint| {
        let (x, y) = cost.of(point);
        [x, y]
    };
    let mut series = vec![Series::new("no other is better", FRONT, front(level, cost))];
    for kind in DecoderKind::ALL {
        for &precision in kind.precisions() {
            for preset in Preset::ALL {
                let is_of = |point: &&TradePoint| {
                    (point.report.kind, point.report.precision, point.preset) == (kind, precision, preset)
                };
                let points = level.points.iter().filter(is_of).map(|point| PlotPoint {
                    note: Some(format!("{}\n{}", point_name(point), point_facts(point).join("\n"))),
                    ..PlotPoint::from(at(point))
                });
                let look = Look::marker(kind.colour().into(), marker(preset, precision));
                let name = format!("{}, {preset} preset", kind.name(precision));
                series.push(Series {
                    points: points.collect(),
                    ..Series::new(name, look, [])
                });
            }
        }
    }
    let answers = level.answers(limits).into_iter().zip(["fastest", "most accurate"]);
    for (answer, name) in answers.filter_map(|(answer, name)| Some((level.points.get(answer?)?, name))) {
        series.push(Series::new(name, ANSWER, [at(answer)]));
    }
    series.retain(|series| !series.points.is_empty());
    let mut plot = Plot::new(
        PlotAxis::logarithmic(cost.name()),
        PlotAxis::logarithmic("Z error (%)"),
        series,
    );
    let reference = level.points.first().and_then(|point| point.reference);
    let reference = reference.filter(|reference| !reference.is_rounding());
    if let Some(percent) = reference.and_then(|reference| reference.z_percent) {
        plot.lines
            .push(line("Bayesian reference", LineAt::Y(percent), REFERENCE));
    }
    // The limits are of decoding, and shown where they lie among the points.
    let places: Vec<[f64; 2]> = level
        .points
        .iter()
        .map(at)
        .filter(|[x, y]| plot.place(*x, *y).is_some())
        .collect();
    let is_among = |limit: f64, axis: usize| {
        places.iter().any(|place| place[axis] <= limit) && places.iter().any(|place| place[axis] >= limit)
    };
    if cost == TradeCost::Decoding {
        if is_among(limits.microseconds, 0) {
            plot.lines
                .push(line("longest time", LineAt::X(limits.microseconds), LIMIT));
        }
        if is_among(limits.percent, 1) {
            plot.lines.push(line("largest error", LineAt::Y(limits.percent), LIMIT));
        }
    }
    plot
}

fn line(name: &str, at: LineAt, look: Look) -> ReferenceLine {
    ReferenceLine::new(name, at, look.hue, look.line.unwrap_or(LineStyle::Solid))
}

/// From point to point that no other beats, in steps: between them nothing better was measured.
fn front(level: &TradeLevel, cost: TradeCost) -> Vec<[f64; 2]> {
    let chosen = level.points.iter().zip(level.front(cost));
    let places = chosen.filter(|(_, is_chosen)| *is_chosen).map(|(point, _)| {
        let (x, y) = cost.of(point);
        [x, y]
    });
    let mut places: Vec<[f64; 2]> = places
        .filter(|place| place.iter().all(|part| part.is_finite()))
        .collect();
    places.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut steps: Vec<[f64; 2]> = Vec::new();
    for place in places {
        if let Some(&[_, y]) = steps.last() {
            steps.push([place[0], y]);
        }
        steps.push(place);
    }
    steps
}
