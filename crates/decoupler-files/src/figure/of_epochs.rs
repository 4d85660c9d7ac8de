//! Figures of a training over its epochs.

use decoupler_core::training::{EpochRecord, Stage};

use super::{
    Hue, Key, LineStyle, Look,
    axis::{PlotAxis, TickRule},
    colour_map::{STRETCHES, extremes, outline},
    plot::{LineAt, Plot, PlotFigure, ReferenceLine, Series},
};

/// Factor above the initial error or gradient from which a curve is drawn at the upper edge, which keeps the curves of
/// a diverged training readable.
const MAX_GROWTH: f64 = 1e3;
/// Learning rates, dampings and scales beyond these are drawn at the edge.
const PARAMETERS: std::ops::RangeInclusive<f64> = 1e-20..=1e12;

const MSE: &str = "mse (scaled)";

/// Picks one of an epoch's quantities.
type OfEpoch = fn(&EpochRecord) -> Option<f64>;

/// The curve of a quantity over the epochs.
fn curve(name: impl Into<String>, look: Look, history: &[EpochRecord], of: OfEpoch) -> Series {
    let kept = outline(history, of).into_iter().map(|place| &history[place]);
    let points = kept.filter_map(|epoch| Some([epoch.epoch as f64, of(epoch)?]));
    Series::new(name, look, points)
}

/// Limits a logarithmic axis: values far above the initial one are drawn at the upper edge.
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
        // The next method continues from the last weights of the previous one.
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
/// far above the initial one are drawn at the upper edge.
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
                // A little more than from 0 to 1: lines do not coincide with the frame.
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

/// Validation failures are constant from one epoch to the next: returns `[epoch, failures]` at both ends of each step.
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

/// Quantities whose extremes are kept.
const QUANTITIES: [fn(&EpochRecord) -> Option<f64>; 6] = [
    |epoch| Some(epoch.training_mse),
    |epoch| epoch.validation_mse,
    |epoch| epoch.test_mse,
    |epoch| Some(epoch.gradient_norm),
    |epoch| Some(epoch.parameter),
    |epoch| Some(epoch.validation_failures as f64),
];

/// The epochs of a training that its curves need: for each stretch, those at which a quantity has its minimum or
/// maximum. Memory is bounded for trainings of any length, and adding an epoch takes constant time.
#[derive(Clone, Debug, Default)]
pub struct EpochOutline {
    /// Epochs of all stretches in order; the last stretch is still open.
    kept: Vec<EpochRecord>,
    /// Start of each stretch in `kept`.
    begins: Vec<usize>,
    /// Number of epochs in a stretch, and in the open one so far.
    stretch: usize,
    open: usize,
}

impl EpochOutline {
    /// Creates an empty outline.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds epochs. If they overlap earlier ones, because another start has become the best, the earlier ones are
    /// dropped.
    pub fn extend(&mut self, epochs: &[EpochRecord]) {
        if let Some(first) = epochs.first() {
            self.forget_from(first.epoch);
        }
        for epoch in epochs {
            if self.begins.is_empty() || self.open == self.stretch {
                self.begin();
            }
            self.kept.push(*epoch);
            self.open += 1;
            let from = self.begins.last().copied().unwrap_or(0);
            // Reduced whenever it has doubled, so each epoch is processed only a few times.
            if self.kept.len() - from > 4 * QUANTITIES.len() {
                self.reduce(from);
            }
        }
    }

    /// The epochs kept, in order.
    pub fn records(&self) -> &[EpochRecord] {
        &self.kept
    }

    /// Begins a new stretch; if there are too many, merges pairs of them first.
    fn begin(&mut self) {
        if let Some(&from) = self.begins.last() {
            self.reduce(from);
        }
        self.stretch = self.stretch.max(1);
        if self.begins.len() == 2 * STRETCHES {
            self.stretch *= 2;
            let whole = std::mem::take(&mut self.kept);
            let begins = std::mem::take(&mut self.begins);
            for pair in begins.chunks(2) {
                let from = self.kept.len();
                self.begins.push(from);
                let next = begins.partition_point(|begin| *begin <= pair[pair.len() - 1]);
                let end = begins.get(next).copied().unwrap_or(whole.len());
                self.kept.extend_from_slice(&whole[pair[0]..end]);
                self.reduce(from);
            }
        }
        self.begins.push(self.kept.len());
        self.open = 0;
    }

    /// Reduces the last stretch, which begins at `from`, to its ends and extremes.
    fn reduce(&mut self, from: usize) {
        let last = &self.kept[from..];
        let mut extreme = Vec::with_capacity(3 * QUANTITIES.len());
        // Both ends are kept: the curve begins and ends where it did.
        extreme.extend([0, last.len().saturating_sub(1)]);
        for of in QUANTITIES {
            extremes(last, of, |place| extreme.push(place));
        }
        extreme.sort_unstable();
        extreme.dedup();
        let reduced: Vec<EpochRecord> = extreme.iter().filter_map(|&place| last.get(place).copied()).collect();
        self.kept.truncate(from);
        self.kept.extend(reduced);
    }

    fn forget_from(&mut self, epoch: usize) {
        if self.kept.last().is_none_or(|last| last.epoch < epoch) {
            return;
        }
        let kept = self.kept.partition_point(|record| record.epoch < epoch);
        self.kept.truncate(kept);
        self.begins.retain(|begin| *begin < kept);
        self.open = self.begins.last().map_or(0, |begin| kept - begin);
    }
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
        let keys: Vec<&str> = figure.keys.iter().map(|key| &*key.name).collect();
        assert_eq!(keys, ["training", "best weights"]);
        assert_eq!(figure.plots[0].series.len(), 1);
    }

    #[test]
    fn failures_rise_in_vertical_steps() {
        let history = [epoch(0, 1.0, 0), epoch(1, 1.0, 1), epoch(2, 1.0, 1), epoch(3, 1.0, 0)];
        let expected = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [2.0, 1.0], [3.0, 1.0], [3.0, 0.0]];
        assert_eq!(failure_steps(&history), expected);
        assert!(failure_steps(&[]).is_empty());
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
        let mut outline = EpochOutline::new();
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
        let mut outline = EpochOutline::new();
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
