//! The figure of speed against accuracy, and descriptions of its points.

use std::time::Duration;

use decoupler_core::{
    decoupling::{DecoderKind, Precision},
    evaluation::{Preset, TradeOffPoint, fastest_under, most_accurate_under, pareto_front},
    text::{capitalised, format_duration, format_number, format_percent},
};

use super::{
    Hue, LineStyle, Look, Marker,
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
    let has = |is_so: &dyn Fn(&TradeOffPoint) -> bool| level.points.iter().any(is_so);
    let of_preset = |preset| has(&|point| point.preset == Some(preset));
    let is_single = has(&|point| point.report.precision == Precision::Single);
    let marks = [
        (of_preset(Preset::Paper), "discs: paper preset"),
        (of_preset(Preset::Best), "diamonds: best preset"),
        (is_single, "hollow: 32 bits"),
    ];
    let marks = marks
        .into_iter()
        .filter_map(|(is_there, mark)| is_there.then_some(mark));
    let note = capitalised(&Vec::from_iter(marks).join(", "));
    let plots = TradeOffCost::ALL.map(|cost| plot(level, limits, cost));
    PlotFigure::new(plots, (!note.is_empty()).then(|| format!("{note}.")))
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
    let is_on_front = level.front(cost);
    let points = || level.points.iter().zip(&is_on_front);
    let front = points().filter(|(point, is_on_front)| **is_on_front && point.percent().is_finite());
    let mut front: Vec<[f64; 2]> = front.map(|(point, _)| at(point)).collect();
    front.sort_by(|a, b| a[0].total_cmp(&b[0]));
    // Nothing better was measured between two points of the front.
    let front = Series::new("Pareto front", Look::line(Hue::Grey, LineStyle::Solid), front).stepped();
    let mut series = vec![front];
    for kind in DecoderKind::ALL {
        for &precision in kind.precisions() {
            for preset in Preset::ALL.into_iter().map(Some).chain([None]) {
                let is_of = |(point, _): &(&TradeOffPoint, &bool)| {
                    (point.report.kind, point.report.precision, point.preset) == (kind, precision, preset)
                };
                let points = points().filter(is_of).map(|(point, is_on_front)| {
                    let note = format!("{}\n{}", point_name(point), point_facts(point).join("\n"));
                    let mut drawn = PlotPoint::from(at(point)).noted(note);
                    drawn.label = is_on_front.then(|| named(point, ""));
                    drawn
                });
                let look = Look::marker(Hue::of_decoder(kind), marker(preset, precision));
                let mut name = kind.name(precision).to_owned();
                if let Some(preset) = preset {
                    name += &format!(", {preset} preset");
                }
                series.push(Series::new(name, look, points).listed(Some(kind.name(Precision::Double))));
            }
        }
    }
    let questions = [
        format!("fastest under {}", format_percent(limits.percent)),
        format!("most accurate under {}", frame_time(limits.microseconds)),
    ];
    // The questions and their limits are about decoding.
    let is_decoding = cost == TradeOffCost::Decoding;
    for (answer, name) in level.answers(limits).into_iter().zip(questions) {
        if let Some(answer) = answer.and_then(|answer| level.points.get(answer)) {
            let mut point = PlotPoint::from(at(answer));
            point.label = is_decoding.then(|| name.clone());
            series.push(Series::new(name, Look::marker(Hue::Blue, Marker::Halo), [point]).listed(None));
        }
    }
    let error = match level.noise {
        Some(_) => "Z error (%)",
        None => "mean absolute error (% of range)",
    };
    let model_based = level.points.first().and_then(|point| point.model_based);
    let model_based = model_based.filter(|errors| !errors.is_rounding());
    let model_based = model_based.and_then(|errors| errors.z_percent).map(|percent| {
        let at = LineAt::Y(percent);
        Series::across("model-based", at, Hue::Ink, LineStyle::Dashed)
    });
    series.extend(model_based);
    // Limits are shown if they are within the range of the points.
    let is_among = |limit: f64, axis: usize| {
        let values = level.points.iter().map(|point| at(point)[axis]);
        let (low, high) = ends(values.filter(|value| value.log10().is_finite()));
        is_decoding && (low..=high).contains(&limit)
    };
    let [time, percent] = [limits.microseconds, limits.percent];
    let limits = [
        (is_among(time, 0), "longest time", LineAt::X(time)),
        (is_among(percent, 1), "largest error", LineAt::Y(percent)),
    ];
    series.extend(
        limits
            .into_iter()
            .filter(|(is_shown, ..)| *is_shown)
            .map(|(_, name, at)| {
                let line = Series::across(name, at, Hue::Blue, LineStyle::Dotted);
                line.listed(Some("limits asked for"))
            }),
    );
    Plot::new(PlotAxis::logarithmic(cost.name()), PlotAxis::logarithmic(error), series)
}

/// `Network f32, best preset, 12 hidden`.
pub fn point_name(point: &TradeOffPoint) -> String {
    let how = match (point.preset, point.method()) {
        (Some(preset), _) => format!(", {preset} preset"),
        (None, Some(method)) => format!(", {}", method.short_name()),
        (None, None) => String::new(),
    };
    named(point, &how)
}

/// The decoder of a point with its hidden nodes, and `how` it was trained.
fn named(point: &TradeOffPoint, how: &str) -> String {
    let name = point.report.kind.name(point.report.precision);
    match point.hidden() {
        Some(hidden) => format!("{name}{how}, {hidden} hidden"),
        None => format!("{name}{how}"),
    }
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
