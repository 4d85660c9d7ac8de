//! Figures of a training over its epochs.

use super::{
    axis::{PlotAxis, TickRule},
    decimation::outline,
    look::{Hue, Key, LineStyle, Look},
    plot::{LineAt, Plot, ReferenceLine, Series},
    plot_figure::PlotFigure,
};
use decoupler_core::training::{EpochRecord, Stage};

/// Factor above the error or gradient of the start from which a curve is drawn at the upper edge, so that a diverged
/// training leaves the rest of its curves readable.
const MAX_GROWTH: f64 = 1e3;
/// Learning rates, dampings and scales beyond these are drawn at the edge.
const PARAMETERS: std::ops::RangeInclusive<f64> = 1e-20..=1e12;

const MSE: &str = "mse (scaled)";

/// Picks one of an epoch's quantities.
type OfEpoch = fn(&EpochRecord) -> Option<f64>;

/// The curve of a quantity over the epochs.
fn curve(name: impl Into<String>, look: Look, history: &[EpochRecord], of: OfEpoch) -> Series {
    let outstanding = outline(history, of).into_iter().map(|place| &history[place]);
    let points = outstanding.filter_map(|epoch| Some([epoch.epoch as f64, of(epoch)?]));
    Series::new(name, look, points)
}

/// A logarithmic axis on which what grew far beyond its value at the start is drawn at the upper edge.
fn bounded(axis: PlotAxis, at_start: Option<f64>) -> PlotAxis {
    let highest = MAX_GROWTH * at_start.unwrap_or(0.0);
    if highest > 0.0 {
        axis.limited(0.0..=highest)
    } else {
        axis
    }
}

/// A line where the method changed, with the short name of the next method.
fn stage_lines(stages: &[Stage]) -> Vec<ReferenceLine> {
    let changes = stages.iter().skip(1).map(|stage| {
        // The last weights of the method before are those from which the next one continues.
        let changed = stage.first_epoch.saturating_sub(1);
        let name = format!("{} from epoch {changed}", stage.method.name());
        ReferenceLine {
            label: Some(stage.method.short_name().to_owned()),
            ..ReferenceLine::new(name, LineAt::X(changed as f64), Hue::Grey, LineStyle::Fine)
        }
    });
    changes.collect()
}

/// Training, validation and test error against epoch, the epoch of the best weights, and each change of method. Errors
/// far above that of the start run along the upper edge.
pub fn loss_figure(history: &[EpochRecord], stages: &[Stage], best_epoch: usize) -> PlotFigure {
    let curves: [(&str, Hue, OfEpoch); 3] = [
        ("training", Hue::Blue, |epoch| Some(epoch.training_mse)),
        ("validation", Hue::Green, |epoch| epoch.validation_mse),
        ("test", Hue::Orange, |epoch| epoch.test_mse),
    ];
    let series = curves.map(|(name, hue, of)| curve(name, Look::line(hue, LineStyle::Solid), history, of));
    let series: Vec<Series> = series.into_iter().filter(|curve| !curve.points.is_empty()).collect();
    let best = "best weights";
    let keys = series.iter().map(|series| Key::new(&series.name, series.look));
    let keys = keys.chain([Key::new(best, Look::line(Hue::Grey, LineStyle::Dashed))]);
    let y = bounded(
        PlotAxis::logarithmic(MSE),
        history.first().map(|start| start.training_mse),
    );
    let best = ReferenceLine::new(
        format!("{best}, epoch {best_epoch}"),
        LineAt::X(best_epoch as f64),
        Hue::Grey,
        LineStyle::Dashed,
    );
    PlotFigure {
        keys: keys.collect(),
        plots: vec![Plot {
            lines: stage_lines(stages).into_iter().chain([best]).collect(),
            ..Plot::new(PlotAxis::linear("epoch"), y, series)
        }],
        notes: Vec::new(),
    }
}

/// Length of the gradient, damping or learning rate, and validation failures against epoch.
pub fn training_state_figure(history: &[EpochRecord], stages: &[Stage]) -> PlotFigure {
    let parameter = parameter_name(stages);
    let gradient = bounded(
        PlotAxis::logarithmic("gradient"),
        history.first().map(|start| start.gradient_norm),
    );
    let failures = "validation failures";
    let plot = |y: PlotAxis, series: Series| Plot {
        lines: stage_lines(stages),
        ..Plot::new(PlotAxis::linear("epoch"), y, vec![series])
    };
    let look = |hue| Look::line(hue, LineStyle::Solid);
    PlotFigure {
        plots: vec![
            plot(
                gradient,
                curve("gradient", look(Hue::Blue), history, |epoch| Some(epoch.gradient_norm)),
            ),
            plot(
                PlotAxis::logarithmic(parameter).limited(PARAMETERS),
                curve(parameter, look(Hue::Orange), history, |epoch| Some(epoch.parameter)),
            ),
            plot(
                // A little more than from 0 to 1, so that no line lies on the frame.
                PlotAxis::linear(failures)
                    .including([-0.1, 1.1])
                    .ticked(TickRule::Whole),
                Series::new(failures, look(Hue::Green), failure_steps(history)),
            ),
        ],
        ..PlotFigure::default()
    }
}

/// Training and test error against epoch of two runs, by their names, in one plot.
pub fn compared_losses_figure(runs: [Option<(&str, &[EpochRecord])>; 2]) -> PlotFigure {
    let mut series = Vec::new();
    let present = runs.into_iter().zip([Hue::Blue, Hue::Orange]);
    for ((name, history), hue) in present.filter_map(|(run, hue)| Some((run?, hue))) {
        let curves: [(&str, LineStyle, OfEpoch); 2] = [
            ("training", LineStyle::Dashed, |epoch| Some(epoch.training_mse)),
            ("test", LineStyle::Solid, |epoch| epoch.test_mse),
        ];
        let curves =
            curves.map(|(error, style, of)| curve(format!("{name}, {error}"), Look::line(hue, style), history, of));
        series.extend(curves.into_iter().filter(|curve| !curve.points.is_empty()));
    }
    PlotFigure {
        keys: series
            .iter()
            .map(|series| Key::new(&series.name, series.look))
            .collect(),
        plots: vec![Plot::new(PlotAxis::linear("epoch"), PlotAxis::logarithmic(MSE), series)],
        notes: Vec::new(),
    }
}

/// Returns the name of [`EpochRecord::parameter`] in all methods of a training.
fn parameter_name(stages: &[Stage]) -> &'static str {
    let mut names = stages.iter().map(|stage| stage.method.parameter_name());
    let first = names.next().unwrap_or("parameter");
    if names.all(|name| name == first) {
        first
    } else {
        "rate or damping"
    }
}

/// Validation failures hold from one epoch to the next: `[epoch, failures]` at both ends of each step.
fn failure_steps(history: &[EpochRecord]) -> Vec<[f64; 2]> {
    let mut points: Vec<[f64; 2]> = Vec::new();
    let of = |epoch: &EpochRecord| Some(epoch.validation_failures as f64);
    for epoch in outline(history, of).into_iter().map(|place| &history[place]) {
        let (at, failures) = (epoch.epoch as f64, epoch.validation_failures as f64);
        if let Some(&[_, before]) = points.last().filter(|[_, before]| *before != failures) {
            points.push([at, before]);
        }
        points.push([at, failures]);
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    fn epoch(epoch: usize, training_mse: f64, validation_failures: usize) -> EpochRecord {
        EpochRecord {
            epoch,
            training_mse,
            validation_mse: None,
            test_mse: None,
            gradient_norm: training_mse,
            parameter: 1e300,
            effective_parameters: None,
            validation_failures,
        }
    }

    #[test]
    fn the_axes_of_a_diverged_training_span_what_can_be_read() {
        let history = [epoch(0, 1.5, 0), epoch(1, 0.5, 0), epoch(2, 1e300, 0)];
        let loss = loss_figure(&history, &[], 1);
        assert!((loss.plots[0].y.place(1e300).unwrap() - 1500_f64.log10()).abs() < 1e-12);
        let state = training_state_figure(&history, &[]);
        let highest = |plot: &Plot| *plot.ranges()[1].end();
        assert!(highest(&state.plots[0]) < 4.0);
        assert!((12.0..14.0).contains(&highest(&state.plots[1])));
        let words = loss.plots[0].words(&loss.plots[0].series[0], &loss.plots[0].series[0].points[2]);
        assert!(
            words.contains("1.00e300"),
            "the pointer reads the actual error: {words}"
        );
        let start_without_error = loss_figure(&[epoch(0, 0.0, 0), epoch(1, 1e9, 0)], &[], 0);
        assert_eq!(start_without_error.plots[0].y.place(1e9), Some(9.0));
    }

    #[test]
    fn nothing_held_out_has_no_curve_and_no_key() {
        let figure = loss_figure(&[epoch(0, 1.0, 0)], &[], 0);
        let keys: Vec<&str> = figure.keys.iter().map(|key| &*key.name).collect();
        assert_eq!(keys, ["training", "best weights"]);
        assert_eq!(figure.plots[0].series.len(), 1);
    }

    #[test]
    fn failures_rise_upright() {
        let history = [epoch(0, 1.0, 0), epoch(1, 1.0, 1), epoch(2, 1.0, 1), epoch(3, 1.0, 0)];
        let expected = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [2.0, 1.0], [3.0, 1.0], [3.0, 0.0]];
        assert_eq!(failure_steps(&history), expected);
        assert!(failure_steps(&[]).is_empty());
    }
}
