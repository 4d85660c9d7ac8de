//! Figures of a training over its epochs.

use std::borrow::Cow;

use decoupler_core::training::{EpochRecord, Stage};

use super::{
    Ink, LineStyle, Look,
    axis::PlotAxis,
    plot::{LineAt, Plot, PlotFigure, Series},
};

/// Learning rates, dampings and scales beyond these are drawn at the edge.
const PARAMETERS: std::ops::RangeInclusive<f64> = 1e-20..=1e12;

/// Picks one of an epoch's quantities.
type OfEpoch = fn(&EpochRecord) -> Option<f64>;

const TRAINING: OfEpoch = |epoch| Some(epoch.training_mse);
const VALIDATION: OfEpoch = |epoch| epoch.validation_mse;
const TEST: OfEpoch = |epoch| epoch.test_mse;
const GRADIENT: OfEpoch = |epoch| Some(epoch.gradient_norm);
const PARAMETER: OfEpoch = |epoch| Some(epoch.parameter);
const FAILURES: OfEpoch = |epoch| Some(epoch.validation_failures as f64);

/// The curve of a quantity over the epochs.
fn curve(name: impl Into<String>, ink: Ink, style: LineStyle, history: &[EpochRecord], of: OfEpoch) -> Series {
    let point = |epoch: &EpochRecord| Some([epoch.epoch as f64, of(epoch)?]);
    let points = history.iter().filter_map(point);
    Series::new(name, Look::line(ink, style), points)
}

/// A logarithmic axis that keeps the curves of a diverged training readable: values far above the initial one are drawn at
/// the upper edge.
fn bounded(name: &str, history: &[EpochRecord], of: OfEpoch) -> PlotAxis {
    let axis = PlotAxis::logarithmic(name);
    match history.first().and_then(of) {
        Some(start) if start > 0.0 => axis.limited(0.0..=1e3 * start),
        _ => axis,
    }
}

/// A plot against the epoch.
fn over_epochs(y: PlotAxis, series: impl IntoIterator<Item = Series>) -> Plot {
    Plot::new(PlotAxis::linear("epoch"), y, series)
}

/// A line where the method changed, with the short name of the next method.
fn stage_lines(stages: &[Stage]) -> impl Iterator<Item = Series> {
    stages.iter().skip(1).map(|stage| {
        // The next method continues from the last weights of the previous one.
        let changed = stage.first_epoch.saturating_sub(1);
        let name = format!("{} from epoch {changed}", stage.method.name());
        let line = Series::across(name, LineAt::X(changed as f64), Ink::Grey, LineStyle::Fine);
        line.labelled(stage.method.short_name())
    })
}

/// Training, validation and test error against epoch, the epoch of the best weights, and each change of method. Errors
/// far above the initial one are drawn at the upper edge.
pub fn loss_figure(history: &[EpochRecord], stages: &[Stage], best_epoch: usize) -> PlotFigure {
    let drawn = &*outlined(history);
    let curves = [
        ("training", Ink::Blue, TRAINING),
        ("validation", Ink::Green, VALIDATION),
        ("test", Ink::Orange, TEST),
    ];
    let curves = curves.map(|(name, ink, of)| curve(name, ink, LineStyle::Solid, drawn, of));
    let name = format!("best weights, epoch {best_epoch}");
    let best = Series::across(name, LineAt::X(best_epoch as f64), Ink::Grey, LineStyle::Dashed);
    let best = best.listed(Some("best weights"));
    let series = curves.into_iter().chain(stage_lines(stages)).chain([best]);
    over_epochs(bounded("mse (scaled)", history, TRAINING), series).into()
}

/// Length of the gradient, damping or learning rate, and validation failures against epoch.
pub fn training_state_figure(history: &[EpochRecord], stages: &[Stage]) -> PlotFigure {
    let drawn = &*outlined(history);
    // A little more than from 0 to 1: lines do not coincide with the frame.
    let failures = PlotAxis::integers("validation failures").including([-0.1, 1.1]);
    let parameter = PlotAxis::logarithmic(parameter_name(stages)).limited(PARAMETERS);
    let curve = |ink: Ink, of: OfEpoch| curve("", ink, LineStyle::Solid, drawn, of).listed(None);
    let plots = [
        (bounded("gradient", history, GRADIENT), curve(Ink::Blue, GRADIENT)),
        (parameter, curve(Ink::Orange, PARAMETER)),
        (failures, curve(Ink::Green, FAILURES).stepped()),
    ];
    let plots = plots.map(|(y, mut curve)| {
        curve.name.clone_from(&y.name);
        over_epochs(y, std::iter::once(curve).chain(stage_lines(stages)))
    });
    PlotFigure::new(plots, [])
}

/// Training and test error against epoch of two runs, by their names, in one plot.
pub fn compared_losses_figure(runs: [Option<(&str, &[EpochRecord])>; 2]) -> PlotFigure {
    let curves = [
        ("training", LineStyle::Dashed, TRAINING),
        ("test", LineStyle::Solid, TEST),
    ];
    let runs = runs.into_iter().zip([Ink::Blue, Ink::Orange]);
    let series = runs.filter_map(|(run, ink)| run.map(|(name, history)| (name, outlined(history), ink)));
    let series = series.flat_map(|(run, drawn, ink)| {
        curves.map(|(name, style, of)| curve(format!("{run}, {name}"), ink, style, &drawn, of))
    });
    over_epochs(PlotAxis::logarithmic("mse (scaled)"), series).into()
}

/// Returns the name of [`EpochRecord::parameter`] in all methods of a training.
fn parameter_name(stages: &[Stage]) -> &'static str {
    let mut names = stages.iter().map(|stage| stage.method.parameter_name());
    let first = names.next().unwrap_or("parameter");
    let is_common = names.all(|name| name == first);
    if is_common { first } else { "rate or damping" }
}

/// Quantities whose extremes are kept.
const QUANTITIES: [OfEpoch; 6] = [TRAINING, VALIDATION, TEST, GRADIENT, PARAMETER, FAILURES];

/// Number of stretches into which a long training is divided: about one for each pixel of a chart.
const STRETCHES: usize = 1024;
/// Number of epochs above which a training is reduced to the extremes of its stretches, which are at most half as many.
const MAX_EPOCHS: usize = 40 * STRETCHES;

/// The epochs of a training that its curves need: of a long one, those at which a quantity has its minimum or maximum
/// within a stretch, and the first of them without a finite value. Memory is bounded for trainings of any length.
#[derive(Clone, Debug, Default)]
pub struct EpochOutline {
    kept: Vec<EpochRecord>,
}

impl EpochOutline {
    /// Adds epochs. If they overlap earlier ones, because another start has become the best, the earlier ones are
    /// dropped.
    pub fn extend(&mut self, epochs: &[EpochRecord]) {
        if let Some(first) = epochs.first() {
            let before = self.kept.partition_point(|record| record.epoch < first.epoch);
            self.kept.truncate(before);
        }
        for epochs in epochs.chunks(MAX_EPOCHS / 2) {
            self.kept.extend_from_slice(epochs);
            if self.kept.len() > MAX_EPOCHS {
                let width = self.kept[self.kept.len() - 1].epoch / STRETCHES + 1;
                let are_near = |one: &EpochRecord, other: &EpochRecord| one.epoch / width == other.epoch / width;
                self.kept = self.kept.chunk_by(are_near).flat_map(extremes).collect();
            }
        }
    }

    /// The epochs kept, in order.
    pub fn records(&self) -> &[EpochRecord] {
        &self.kept
    }
}

/// Returns the epochs of a history that are drawn.
fn outlined(history: &[EpochRecord]) -> Cow<'_, [EpochRecord]> {
    if history.len() <= MAX_EPOCHS {
        return history.into();
    }
    let mut outline = EpochOutline::default();
    outline.extend(history);
    outline.kept.into()
}

/// Returns both ends of a stretch, and the epochs at which a quantity has its minimum or maximum or is first missing.
fn extremes(stretch: &[EpochRecord]) -> Vec<EpochRecord> {
    let mut places = vec![0, stretch.len() - 1];
    for of in QUANTITIES {
        let values = stretch.iter().map(|epoch| of(epoch).filter(|value| value.is_finite()));
        let finite = values.clone().enumerate();
        let finite = finite.filter_map(|(place, value)| Some((place, value?)));
        let ends = super::extremes(finite, |(_, value)| *value);
        places.extend(ends.into_iter().flat_map(|(lowest, highest)| [lowest.0, highest.0]));
        places.extend(values.clone().position(|value| value.is_none()));
    }
    places.sort_unstable();
    places.dedup();
    places.into_iter().map(|place| stretch[place]).collect()
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
    fn the_axes_of_a_diverged_training_stay_readable() {
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
    fn without_held_out_samples_there_is_no_curve_and_no_key() {
        let figure = loss_figure(&[epoch(0, 1.0, 0)], &[], 0);
        let keys: Vec<&str> = figure.keys().into_iter().map(|(key, _)| key).collect();
        assert_eq!(keys, ["training", "best weights"]);
        assert_eq!(figure.plots[0].series.len(), 2);
    }

    #[test]
    fn failures_rise_in_vertical_steps() {
        let history = [epoch(0, 1.0, 0), epoch(1, 1.0, 1), epoch(2, 1.0, 1), epoch(3, 1.0, 0)];
        let expected = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [2.0, 1.0], [3.0, 1.0], [3.0, 0.0]];
        let figure = training_state_figure(&history, &[]);
        let steps = &figure.plots[2].series[0].points;
        assert_eq!(Vec::from_iter(steps.iter().map(|point| [point.x, point.y])), expected);
        assert!(training_state_figure(&[], &[]).plots[2].series.is_empty());
    }

    fn epoch_of(epoch: usize, training_mse: f64) -> EpochRecord {
        EpochRecord {
            epoch,
            training_mse,
            validation_mse: Some(0.5),
            test_mse: None,
            gradient_norm: 1.0 / (epoch + 1) as f64,
            parameter: if epoch == 71_234 { 1e6 } else { 1e-3 },
            effective_parameters: None,
            validation_failures: epoch % 3,
        }
    }

    fn history(epochs: usize) -> Vec<EpochRecord> {
        let mse = |at: usize| match at {
            31_337 => 9.0,
            150_001 => 1e-9,
            _ => 1.0 + 0.1 * (at as f64 * 0.01).sin(),
        };
        (0..epochs).map(|at| epoch_of(at, mse(at))).collect()
    }

    #[test]
    fn a_long_training_keeps_its_peaks_within_bounded_memory() {
        let history = history(200_000);
        let mut outline = EpochOutline::default();
        for chunk in history.chunks(777) {
            outline.extend(chunk);
        }
        let kept = outline.records();
        assert!(kept.len() < 60_000, "{}", kept.len());
        assert!(kept.windows(2).all(|pair| pair[0].epoch < pair[1].epoch));
        for peak in [0, 31_337, 71_234, 150_001, 199_999] {
            assert!(kept.iter().any(|record| *record == history[peak]), "epoch {peak}");
        }
        // Between any two of them, no value is outside the range that they span.
        for (number, stretch) in history.chunks(2048).enumerate() {
            let largest = stretch.iter().map(|record| record.training_mse).fold(0.0, f64::max);
            let near = number.saturating_sub(1) * 2048..(number + 2) * 2048;
            let shown = kept.iter().filter(|record| near.contains(&record.epoch));
            assert!(shown.map(|record| record.training_mse).fold(0.0, f64::max) >= largest);
        }
    }

    #[test]
    fn a_short_training_is_kept_whole_and_replaced_by_a_better_start() {
        let history = history(1000);
        let mut outline = EpochOutline::default();
        outline.extend(&history[..400]);
        outline.extend(&history[400..]);
        assert_eq!(outline.records(), history);
        let other: Vec<EpochRecord> = (0..600).map(|at| epoch_of(at, 2.0)).collect();
        outline.extend(&other);
        assert_eq!(outline.records(), other);
        let tail: Vec<EpochRecord> = (500..700).map(|at| epoch_of(at, 3.0)).collect();
        outline.extend(&tail);
        let expected: Vec<EpochRecord> = other[..500].iter().chain(&tail).copied().collect();
        assert_eq!(outline.records(), expected);
    }
}
