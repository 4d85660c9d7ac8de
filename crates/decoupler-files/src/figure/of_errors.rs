//! Distribution of the errors of nodes or of a target of a recording, and decoded against actual values with the fitted
//! line.

use decoupler_core::{dataset::Dataset, problem::Channel, text::format_number};
use ndarray::Array2;

use super::{
    Hue, LineStyle, Look, Marker,
    axis::PlotAxis,
    plot::{LineAt, Plot, PlotFigure, PlotPoint, ReferenceLine, Series, thinned_places},
};

const BINS: usize = 41;

/// Maximum number of samples of a recording used in a figure; from a larger test set, evenly spaced samples are used.
const MAX_PAIRS: usize = 20_000;

/// Returns the spacing of the samples that are used.
fn stride(test: &Dataset) -> usize {
    test.samples().div_ceil(MAX_PAIRS).max(1)
}

/// Returns actual and decoded values of a target, in its unit. `answers` has the shape of the targets of `test`.
pub fn target_pairs(test: &Dataset, answers: &Array2<f64>, target: usize) -> Vec<(f64, f64)> {
    let actual = test.targets();
    (0..test.samples())
        .step_by(stride(test))
        .map(|sample| (actual[[sample, target]], answers[[sample, target]]))
        .collect()
}

/// Returns the sample that one of [`target_pairs`] belongs to; `None` beyond the last.
pub fn pair_sample(test: &Dataset, pair: usize) -> Option<usize> {
    Some(pair * stride(test)).filter(|&sample| sample < test.samples())
}

/// Bins of a histogram of errors, symmetric about 0, with the same number on either side of the middle one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorBins {
    /// In the unit of the values.
    width: f64,
}

impl ErrorBins {
    /// Returns the bins that contain all finite errors of these pairs of actual and decoded values.
    pub fn new(pairs: &[(f64, f64)]) -> Self {
        let errors = pairs.iter().map(|(actual, decoded)| (decoded - actual).abs());
        let largest = errors.filter(|error| error.is_finite()).fold(0.0, f64::max);
        Self {
            // Without errors, any width will do.
            width: if largest > 0.0 { largest } else { 1.0 } / (BINS / 2) as f64,
        }
    }

    /// Number of bins.
    pub const COUNT: usize = BINS;

    /// Returns the bin of an error; `None` if it is not a number or beyond them.
    pub fn bin(&self, error: f64) -> Option<usize> {
        let bin = (error / self.width).round() + (BINS / 2) as f64;
        (0.0..BINS as f64).contains(&bin).then_some(bin as usize)
    }

    /// Returns the range of errors in a bin, in the unit of the values.
    pub fn range(&self, bin: usize) -> [f64; 2] {
        [-0.5, 0.5].map(|half| self.width * (bin as f64 - (BINS / 2) as f64 + half))
    }

    /// Returns the pairs in a bin, those with the largest error first.
    pub fn pairs_in(&self, bin: usize, pairs: &[(f64, f64)]) -> Vec<usize> {
        let error = |pair: usize| pairs[pair].1 - pairs[pair].0;
        let mut found: Vec<usize> = (0..pairs.len())
            .filter(|&pair| self.bin(error(pair)) == Some(bin))
            .collect();
        found.sort_by(|&one, &other| error(other).abs().total_cmp(&error(one).abs()));
        found
    }

    fn counts(&self, pairs: &[(f64, f64)]) -> [usize; BINS] {
        let mut counts = [0; BINS];
        let bins = pairs.iter().filter_map(|(actual, decoded)| self.bin(decoded - actual));
        bins.for_each(|bin| counts[bin] += 1);
        counts
    }
}

/// Distribution of the errors of z (decoupled − actual) of nodes, in [`ErrorBins`]; the bar `chosen` is highlighted.
pub fn error_histogram_figure(pairs_mm: &[(f64, f64)], chosen: Option<usize>) -> PlotFigure {
    histogram(pairs_mm, chosen, "error of z (mm), decoupled − actual", "nodes")
}

/// Distribution of the errors of a target (decoded − actual), in [`ErrorBins`]; the bar `chosen` is highlighted.
pub fn target_histogram_figure(pairs: &[(f64, f64)], chosen: Option<usize>, target: &Channel) -> PlotFigure {
    let axis = format!("error of {}, decoded − actual", target.title());
    histogram(pairs, chosen, &axis, "samples")
}

/// The histogram of this many `counted`.
fn histogram(pairs: &[(f64, f64)], chosen: Option<usize>, axis: &str, counted: &str) -> PlotFigure {
    let bins = ErrorBins::new(pairs);
    let counts = bins.counts(pairs);
    let bars = |name: &str, hue: Hue, is_shown: &dyn Fn(usize) -> bool| {
        let points = (0..BINS).filter(|&bin| is_shown(bin)).map(|bin| {
            let middle = bins.width * (bin as f64 - (BINS / 2) as f64);
            PlotPoint::from([middle, counts[bin] as f64]).of_item(bin)
        });
        Series {
            bar_width: Some(0.92 * bins.width),
            ..Series::new(name, Look::area(hue), points).listed(None)
        }
    };
    let mut series = vec![bars(counted, Hue::Blue, &|bin| Some(bin) != chosen)];
    if let Some(chosen) = chosen {
        series.push(bars(&format!("chosen {counted}"), Hue::Orange, &|bin| bin == chosen));
    }
    let no_error = ReferenceLine::new("no error", LineAt::X(0.0), Hue::Grey, LineStyle::Dashed);
    Plot::new(
        PlotAxis::linear(axis),
        PlotAxis::linear(format!("{counted} of the test set")).including([0.0]),
        series,
    )
    .with_lines([no_error])
    .into()
}

/// Least-squares line through pairs of actual and decoded values, and the range of the actual ones. A regression figure
/// needs both for all pairs, so they are computed once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegressionLine {
    /// Smallest and largest finite actual value.
    ends: Option<[f64; 2]>,
    fit: Option<Fit>,
}

/// The line, if both sides vary.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Fit {
    /// Pearson's correlation coefficient.
    correlation: f64,
    slope: f64,
    /// In the unit of the values.
    offset: f64,
}

impl RegressionLine {
    /// Fits the line to pairs of actual and decoded values.
    pub fn of(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> Self {
        let actual = || pairs.clone().map(|pair| pair.0).filter(|value| value.is_finite());
        let ends = actual().reduce(f64::min).zip(actual().reduce(f64::max));
        Self {
            ends: ends.map(|(low, high)| [low, high]),
            fit: Fit::of(pairs),
        }
    }
}

impl Fit {
    /// Returns the line, or `None` if one side does not vary.
    fn of(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> Option<Self> {
        let (mut count, mut sum_a, mut sum_d) = (0.0, 0.0, 0.0);
        for (a, d) in pairs.clone() {
            count += 1.0;
            sum_a += a;
            sum_d += d;
        }
        let (mean_a, mean_d) = (sum_a / count, sum_d / count);
        let (mut aa, mut dd, mut ad) = (0.0, 0.0, 0.0);
        for (a, d) in pairs {
            aa += (a - mean_a).powi(2);
            dd += (d - mean_d).powi(2);
            ad += (a - mean_a) * (d - mean_d);
        }
        let slope = ad / aa;
        let fit = Self {
            correlation: ad / (aa * dd).sqrt(),
            slope,
            offset: mean_d - slope * mean_a,
        };
        let is_finite = fit.correlation.is_finite() && fit.offset.is_finite();
        is_finite.then_some(fit)
    }
}

/// Decoupled against actual z, with the line on which they would be equal and the line fitted to them.
pub fn regression_figure(pairs_mm: &[(f64, f64)]) -> PlotFigure {
    let line = RegressionLine::of(pairs_mm.iter().copied());
    let what = ["decoupled", "nodes of the test set"];
    regression((pairs_mm.len(), &|pair| pairs_mm[pair]), &line, ("z", Some("mm")), what)
}

/// Decoded against actual values of the target of this name and unit, with the line on which they would be equal and `line`
/// through all of them. `pair` is called only for the samples that are drawn.
pub fn target_regression_figure(
    samples: (usize, &dyn Fn(usize) -> (f64, f64)),
    line: &RegressionLine,
    name: &str,
    unit: Option<&str>,
) -> PlotFigure {
    regression(samples, line, (name, unit), ["decoded", "samples of the test set"])
}

/// Values decoded by a network, called `answer`, against actual values of a quantity (its name and unit), in pairs of
/// `what`.
fn regression(
    (count, pair): (usize, &dyn Fn(usize) -> (f64, f64)),
    fitted: &RegressionLine,
    (name, unit): (&str, Option<&str>),
    [answer, what]: [&str; 2],
) -> PlotFigure {
    let dots = thinned_places(count).map(|place| {
        let (actual, decoded) = pair(place);
        PlotPoint::from([actual, decoded]).of_item(place)
    });
    let line = |name: &str, look: Look, of: &dyn Fn(f64) -> f64| {
        let ends = fitted.ends.into_iter().flatten();
        Series::new(name, look, ends.map(|actual| [actual, of(actual)]))
    };
    let mut series = vec![
        Series::new(what, Look::marker(Hue::Blue, Marker::Dot), dots),
        line("equal", Look::line(Hue::Ink, LineStyle::Dashed), &|actual| actual),
    ];
    let mut notes = Vec::new();
    if let Some(fit) = fitted.fit {
        let look = Look::line(Hue::Orange, LineStyle::Solid);
        series.push(line("fitted line", look, &|actual| fit.slope * actual + fit.offset));
        let sign = if fit.offset < 0.0 { '−' } else { '+' };
        let [slope, offset] = [fit.slope, fit.offset.abs()].map(format_number);
        let unit = unit.map_or_else(String::new, |unit| format!(" {unit}"));
        notes = vec![
            format!("Correlation R = {}", format_number(fit.correlation)),
            format!("Fitted line: {answer} = {slope} · actual {sign} {offset}{unit}"),
        ];
    }
    let title = match unit {
        Some(unit) => format!("{name} ({unit})"),
        None => name.to_owned(),
    };
    decoded_against_actual(&title, answer, series, notes)
}

/// One plot of `series` with equal scales: decoded values, called `answer`, against actual values of the quantity `title`.
pub(super) fn decoded_against_actual(title: &str, answer: &str, series: Vec<Series>, notes: Vec<String>) -> PlotFigure {
    PlotFigure {
        plots: vec![Plot {
            has_equal_scales: true,
            ..Plot::new(
                PlotAxis::linear(format!("actual {title}")),
                PlotAxis::linear(format!("{answer} {title}")),
                series,
            )
        }],
        notes,
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    #[test]
    fn every_finite_error_is_counted_once_and_zero_is_in_the_middle() {
        let pairs = [0.0, 0.0, 1.0, -1.0, 0.5, f64::NAN].map(|error| (4.0, 4.0 + error));
        let bins = ErrorBins::new(&pairs);
        let counts = bins.counts(&pairs);
        assert_eq!(counts.iter().sum::<usize>(), 5);
        assert_eq!((counts[0], counts[BINS / 2], counts[BINS - 1]), (1, 2, 1));
        assert!((bins.width - 0.05).abs() < 1e-15);
        assert_eq!(ErrorBins::new(&[]).counts(&[]), [0; BINS]);
        assert_eq!(ErrorBins::new(&[(4.0, 4.0); 3]).counts(&[(4.0, 4.0); 3])[BINS / 2], 3);
    }

    #[test]
    fn a_bar_contains_the_nodes_whose_errors_it_spans() {
        let pairs: Vec<(f64, f64)> = (0..200).map(|i| (4.0, 4.0 + (f64::from(i) * 0.731).sin())).collect();
        let bins = ErrorBins::new(&pairs);
        let mut held = 0;
        for bin in 0..ErrorBins::COUNT {
            let [low, high] = bins.range(bin);
            let found = bins.pairs_in(bin, &pairs);
            held += found.len();
            let errors: Vec<f64> = found.iter().map(|&pair| pairs[pair].1 - pairs[pair].0).collect();
            assert!(
                errors.iter().all(|error| (low..=high).contains(error)),
                "{low} to {high}: {errors:?}"
            );
            assert!(
                errors.windows(2).all(|pair| pair[0].abs() >= pair[1].abs()),
                "{errors:?}"
            );
        }
        assert_eq!(held, pairs.len());
        let figure = error_histogram_figure(&pairs, Some(3));
        let bars = figure.plots[0]
            .series
            .iter()
            .map(|series| series.points.len())
            .collect::<Vec<_>>();
        assert_eq!(bars, [ErrorBins::COUNT - 1, 1]);
    }

    #[test]
    fn bars_of_a_target_lead_back_to_its_samples() {
        const SAMPLES: usize = 50_000;
        let actual = Array2::from_shape_fn((SAMPLES, 2), |(sample, target)| (sample + target) as f64);
        let test = Dataset::new(actual.clone(), actual.clone(), None, (0..SAMPLES).collect()).unwrap();
        let mut answers = actual;
        answers[[30_000, 1]] += 2.0;
        let pairs = target_pairs(&test, &answers, 1);
        assert!(pairs.len() <= MAX_PAIRS, "{}", pairs.len());
        let off = pairs.iter().position(|(actual, decoded)| actual != decoded).unwrap();
        assert_eq!(pair_sample(&test, off), Some(30_000));
        assert_eq!(pair_sample(&test, pairs.len()), None);
        let force = Channel::new("force", Some("N"));
        let figure = target_histogram_figure(&pairs, ErrorBins::new(&pairs).bin(2.0), &force);
        let plot = &figure.plots[0];
        assert_eq!(plot.x.name, "error of force (N), decoded − actual");
        assert_eq!((plot.series[1].points[0].x, plot.series[1].points[0].y), (2.0, 1.0));
    }

    #[test]
    fn the_fit_finds_a_line_unless_values_are_constant() {
        let fit = |pairs: &[(f64, f64)]| RegressionLine::of(pairs.iter().copied()).fit;
        let line: Vec<_> = (0..9).map(|i| (f64::from(i), 3.0 * f64::from(i) - 1.0)).collect();
        let found = fit(&line).unwrap();
        assert!((found.correlation - 1.0).abs() < 1e-15);
        assert!((found.slope - 3.0).abs() < 1e-14 && (found.offset + 1.0).abs() < 1e-13);
        assert_eq!(fit(&[(1.0, 2.0), (1.0, 3.0)]), None);
        assert_eq!(fit(&[]), None);
        assert_eq!(
            regression_figure(&[(1.0, 2.0), (1.0, 3.0)]).keys().len(),
            2,
            "no fitted line"
        );
    }

    #[test]
    fn the_regression_names_its_target_with_the_unit_if_there_is_one() {
        let pairs = [(0.0, 1.0), (1.0, 3.0), (2.0, 5.0)];
        let line = RegressionLine::of(pairs.into_iter());
        let figure = target_regression_figure((3, &|sample| pairs[sample]), &line, "force", Some("N"));
        assert_eq!(figure.plots[0].x.name, "actual force (N)");
        assert_eq!(figure.notes[1], "Fitted line: decoded = 2.00 · actual + 1.00 N");
        let without = target_regression_figure((3, &|sample| pairs[sample]), &line, "c2", None);
        assert_eq!(without.plots[0].y.name, "decoded c2");
    }

    #[test]
    fn a_figure_of_a_million_samples_draws_few_and_fits_its_line_to_all() {
        const SAMPLES: usize = 1_000_000;
        let pair = |sample: usize| {
            let actual = (sample as f64 * 0.618_033_988_749_895).fract();
            // Rare samples, which thinning by a fixed step misses, change the line.
            let decoded = if sample % 1000 == 1 { 1.0 - actual } else { actual };
            (actual, decoded)
        };
        let line = RegressionLine::of((0..SAMPLES).map(pair));
        let asked = Cell::new(0);
        let counted = |sample| {
            asked.set(asked.get() + 1);
            pair(sample)
        };
        let figure = target_regression_figure((SAMPLES, &counted), &line, "x", None);
        assert!(asked.get() <= 2001, "{} samples used", asked.get());
        assert_eq!(figure.plots[0].series[0].points.len(), asked.get());
        // Least squares: the slope is 1 − 2 · 0.001 for actual values that are independent of the sample.
        let fit = line.fit.unwrap();
        assert!((fit.slope - 0.998).abs() < 2e-5, "{fit:?}");
    }
}
