//! The figure of speed against accuracy, and descriptions of its points.

use std::time::Duration;

use decoupler_core::{
    decoupling::Precision,
    evaluation::{Preset, TradeOffPoint, fastest_under, most_accurate_under, pareto_front},
    text::{capitalised, format_duration, format_number, format_percent},
};

use super::{
    Ink, LineStyle, Look, Marker,
    axis::{PlotAxis, ends},
    plot::{LineAt, Plot, PlotFigure, PlotPoint, Series},
};

/// Cost that is plotted against the error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum TradeOffCost {
    /// Time to decode a frame on one thread.
    #[default]
    Decoding,
    /// Processor time of training and fitting.
    Training,
}

impl TradeOffCost {
    /// Both costs, in the order offered to the user.
    pub const ALL: [Self; 2] = [Self::Decoding, Self::Training];

    /// Returns the cost (microseconds of decoding, or seconds of training) and the error in percent.
    pub fn of(self, point: &TradeOffPoint) -> (f64, f64) {
        let cost = match self {
            Self::Decoding => point.report.frame_us,
            Self::Training => point.training_seconds,
        };
        (cost, point.percent())
    }

    /// Returns the name of the cost with its unit.
    pub fn name(self) -> &'static str {
        match self {
            Self::Decoding => "time to decode a frame (µs)",
            Self::Training => "training time (s)",
        }
    }
}

/// Limits of the questions "fastest under" and "most accurate under".
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TradeOffLimits {
    /// Maximum error in percent.
    pub percent: f64,
    /// Maximum time per frame in microseconds.
    pub microseconds: f64,
}

impl Default for TradeOffLimits {
    fn default() -> Self {
        let (percent, microseconds) = (1.0, 10.0);
        Self { percent, microseconds }
    }
}

/// Points of the trade-off at one noise level, or on a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct TradeOffLevel {
    /// Relative error of a reading, if it is simulated.
    pub noise: Option<f64>,
    /// Points in the order in which they were measured.
    pub points: Vec<TradeOffPoint>,
}

impl TradeOffLevel {
    /// Marks the points on the Pareto front for this cost.
    pub fn front(&self, cost: TradeOffCost) -> Vec<bool> {
        let points: Vec<_> = self.points.iter().map(|point| cost.of(point)).collect();
        pareto_front(&points)
    }

    /// Returns the indices of the points that answer "fastest under" and "most accurate under".
    pub fn answers(&self, limits: &TradeOffLimits) -> [Option<usize>; 2] {
        [
            fastest_under(&self.points, limits.percent),
            most_accurate_under(&self.points, limits.microseconds),
        ]
    }
}

/// The points at one level of noise, one plot for each cost: colours show the decoder, discs and diamonds the preset,
/// and hollow marks 32 bits. Also shows the Pareto front with the names of its points, the model-based error, and the
/// answers to the two questions with their limits.
pub fn trade_off_figure(level: &TradeOffLevel, limits: &TradeOffLimits) -> PlotFigure {
    let has = |is_so: fn(&TradeOffPoint) -> bool| level.points.iter().any(is_so);
    let marks = [
        has(|point| point.preset == Some(Preset::Paper)).then_some("discs: paper preset"),
        has(|point| point.preset == Some(Preset::Best)).then_some("diamonds: best preset"),
        has(|point| point.report.precision == Precision::Single).then_some("hollow: 32 bits"),
    ];
    let marks = Vec::from_iter(marks.into_iter().flatten());
    let note = (!marks.is_empty()).then(|| format!("{}.", capitalised(&marks.join(", "))));
    PlotFigure::new(TradeOffCost::ALL.map(|cost| plot(level, limits, cost)), note)
}

fn marker(preset: Option<Preset>, precision: Precision) -> Marker {
    match (preset, precision) {
        (Some(Preset::Paper) | None, Precision::Double) => Marker::Disc,
        (Some(Preset::Paper) | None, Precision::Single) => Marker::Ring,
        (Some(Preset::Best), Precision::Double) => Marker::Diamond,
        (Some(Preset::Best), Precision::Single) => Marker::HollowDiamond,
    }
}

fn plot(level: &TradeOffLevel, limits: &TradeOffLimits, cost: TradeOffCost) -> Plot {
    let at = |point: &TradeOffPoint| <[f64; 2]>::from(cost.of(point));
    let mut points = Vec::from_iter(level.points.iter().zip(level.front(cost)));
    let front = points
        .iter()
        .filter(|(point, is_on_front)| *is_on_front && point.percent().is_finite());
    let mut front = Vec::from_iter(front.map(|(point, _)| at(point)));
    front.sort_by(|a, b| a[0].total_cmp(&b[0]));
    // Nothing better was measured between two points of the front.
    let front = Series::new("Pareto front", Look::line(Ink::Grey, LineStyle::Solid), front).stepped();
    let mut series = vec![front];
    let look = |(point, _): &(&TradeOffPoint, bool)| {
        let preset = point.preset.map_or(u8::MAX, |preset| preset as u8);
        (point.report.kind as u8, point.report.precision as u8, preset)
    };
    points.sort_by_key(look);
    for alike in points.chunk_by(|one, other| look(one) == look(other)) {
        let (preset, kind, precision) = (alike[0].0.preset, alike[0].0.report.kind, alike[0].0.report.precision);
        let points = alike.iter().map(|&(point, is_on_front)| PlotPoint {
            label: is_on_front.then(|| named(point, None)),
            item: level.points.iter().position(|other| std::ptr::eq(other, point)),
            ..PlotPoint::from(at(point)).noted(format!("{}\n{}", point_name(point), point_facts(point).join("\n")))
        });
        let name = kind.name(precision);
        let name = preset.map_or_else(|| name.to_owned(), |preset| format!("{name}, {preset} preset"));
        let look = Look::marker(Ink::of_decoder(kind), marker(preset, precision));
        series.push(Series::new(name, look, points).listed(Some(kind.name(Precision::Double))));
    }
    // The questions and their limits are about decoding.
    let is_decoding = cost == TradeOffCost::Decoding;
    let [time, percent] = [limits.microseconds, limits.percent];
    let questions = [
        format!("fastest under {}", format_percent(percent)),
        format!("most accurate under {}", frame_time(time)),
    ];
    for (answer, name) in level.answers(limits).into_iter().zip(questions) {
        let point = answer.map(|answer| PlotPoint {
            label: is_decoding.then(|| name.clone()),
            ..at(&level.points[answer]).into()
        });
        series.push(Series::new(name, Look::marker(Ink::Blue, Marker::Halo), point).listed(None));
    }
    let error = match level.noise {
        Some(_) => "Z error (%)",
        None => "MAE (% of range)",
    };
    let model_based = level.points.first().and_then(|point| point.model_based);
    let model_based = model_based.filter(|errors| !errors.is_rounding());
    series.extend(model_based.and_then(|errors| errors.z_percent).map(|percent| {
        let at = LineAt::Y(percent);
        Series::across("model-based", at, Ink::Text, LineStyle::Dashed)
    }));
    let lines = [
        ("longest time", time, LineAt::X(time)),
        ("largest error", percent, LineAt::Y(percent)),
    ];
    for (axis, (name, limit, line)) in lines.into_iter().enumerate().filter(|_| is_decoding) {
        // Limits are shown if they are within the range of the points.
        let values = level.points.iter().map(|point| at(point)[axis]);
        let (low, high) = ends(values.filter(|value| value.log10().is_finite()));
        if (low..=high).contains(&limit) {
            let line = Series::across(name, line, Ink::Blue, LineStyle::Dotted);
            series.push(line.listed(Some("limits asked for")));
        }
    }
    Plot::new(PlotAxis::logarithmic(cost.name()), PlotAxis::logarithmic(error), series)
}

/// `Network f32, best preset, 12 hidden`.
pub fn point_name(point: &TradeOffPoint) -> String {
    let method = || Some(point.method()?.short_name().to_owned());
    let preset = point.preset.map(|preset| format!("{preset} preset"));
    named(point, preset.or_else(method))
}

/// The decoder of a point with its hidden nodes, and `how` it was trained.
fn named(point: &TradeOffPoint, how: Option<String>) -> String {
    let name = point.report.kind.name(point.report.precision).to_owned();
    let hidden = point.hidden().map(|hidden| format!("{hidden} hidden"));
    Vec::from_iter([Some(name), how, hidden].into_iter().flatten()).join(", ")
}

/// `3.59 µs`, `1.94 ms`.
pub fn frame_time(microseconds: f64) -> String {
    match microseconds {
        time if time < 1e3 => format!("{} µs", format_number(time)),
        time if time < 1e6 => format!("{} ms", format_number(1e-3 * time)),
        time => format!("{} s", format_number(1e-6 * time)),
    }
}

/// Formats a training time.
pub fn training_time(seconds: f64) -> String {
    Duration::try_from_secs_f64(seconds).map_or_else(|_| format_number(None), format_duration)
}

/// Returns the errors and times of a point, line by line.
pub fn point_facts(point: &TradeOffPoint) -> Vec<String> {
    let percent = format_percent(point.report.errors.percent());
    let mut facts = vec![match point.report.errors.nodes() {
        Some(errors) => format!("Z error {percent}, {} mm", format_number(errors.z_mm)),
        None => format!("mean absolute error {percent} of the range"),
    }];
    if let Some(ratio) = point.to_model_based() {
        facts.push(format!("{} times the model-based error", format_number(ratio)));
    }
    facts.push(format!("{} per frame", frame_time(point.report.frame_us)));
    facts.push(format!("{} of training", training_time(point.training_seconds)));
    facts.extend(point.report.remarks.iter().map(ToString::to_string));
    facts
}
