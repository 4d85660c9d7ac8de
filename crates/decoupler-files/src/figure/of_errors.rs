//! Distribution of the errors of nodes or of a target of a recording, and decoded against actual values with the fitted
//! line.

use decoupler_core::text::{format_number, format_r2};
use decoupler_core::{dataset::Dataset, evaluation::NodeAddress, problem::Channel};
use glam::DVec2;
use ndarray::Array2;

use super::{
    Ink, LineStyle, Look, Marker,
    axis::{PlotAxis, ends},
    plot::{Form, LineAt, Plot, PlotFigure, PlotPoint, Series, thinned_places},
    titled, with_unit,
};

/// Values that a network decodes.
#[derive(Clone, Copy, Debug)]
pub enum Decoded<'a> {
    /// z of the nodes of an array, in millimetres.
    Nodes,
    /// A target of a recording, in its unit.
    Target(&'a Channel),
}

impl Decoded<'_> {
    /// Returns the name of a value, its unit, the name of the network's answer, and that of many samples.
    fn words(&self) -> (&str, Option<&str>, [&'static str; 2]) {
        match self {
            Self::Nodes => ("z", Some("mm"), ["decoded", "nodes"]),
            Self::Target(target) => (&target.name, target.unit.as_deref(), ["decoded", "samples"]),
        }
    }
}

/// Returns the spacing of the values used in a figure: from a larger test set, at most 20 000 evenly spaced ones.
fn stride(values: usize) -> usize {
    values.div_ceil(20_000).max(1)
}

/// Returns actual and decoded values of a test set: those of a target in its unit, or z of all nodes of an array in
/// millimetres. `answers` has the shape of the targets of `test`.
pub fn value_pairs(test: &Dataset, answers: &Array2<f64>, target: Option<usize>) -> Vec<(f64, f64)> {
    let actual = test.targets();
    let (first, step) = target.map_or((2, 3), |target| (target, test.outputs()));
    let pairs = actual.iter().copied().zip(answers.iter().copied());
    let stride = stride(actual.len() / step.max(1));
    pairs.skip(first).step_by(step.max(1) * stride).collect()
}

/// Returns the sample that one of the [`value_pairs`] of a target belongs to; `None` beyond the last.
pub fn pair_sample(test: &Dataset, pair: usize) -> Option<usize> {
    Some(pair * stride(test.samples())).filter(|&sample| sample < test.samples())
}

/// Returns the node that one of the [`value_pairs`] of an array belongs to; `None` beyond the last.
pub fn pair_address(test: &Dataset, pair: usize) -> Option<NodeAddress> {
    let (place, per_sample) = (pair * stride(test.targets().len() / 3), (test.outputs() / 3).max(1));
    let (sample, node) = (place / per_sample, place % per_sample);
    let (snapshot, row) = (*test.groups().get(sample)?, test.row_wire(sample).unwrap_or(0));
    Some(NodeAddress { snapshot, row, node })
}

/// Number of bars of a histogram of errors.
const BARS: usize = 41;

/// Distribution of the errors (decoded − actual) in bars of the same width, the middle one around 0.
pub fn histogram_figure(pairs: &[(f64, f64)], of: Decoded<'_>) -> PlotFigure {
    let (name, unit, [answer, samples]) = of.words();
    let errors = pairs.iter().map(|(actual, decoded)| decoded - actual);
    let errors = errors.filter(|error| error.is_finite());
    let largest = errors.clone().fold(0.0, |largest: f64, error| largest.max(error.abs()));
    // Without errors, any width will do.
    let half = if largest > 0.0 { largest } else { 1.0 };
    let width = half / (BARS / 2) as f64;
    let mut counts = [0; BARS];
    errors.for_each(|error| counts[((error / width).round() + (BARS / 2) as f64) as usize] += 1);
    let bars = counts.iter().enumerate().map(|(bar, &count)| {
        let middle = width * (bar as f64 - (BARS / 2) as f64);
        PlotPoint::from([middle, f64::from(count)]).of_item(bar)
    });
    let mut bars = Series::new(samples, Look::line(Ink::Blue, None), bars).listed(None);
    bars.form = Form::Bars(0.92 * width);
    let x = PlotAxis::linear(format!("error of {}, {answer} − actual", titled(name, unit)));
    let y = PlotAxis::linear(samples).including([0.0]);
    let no_error = Series::across("no error", LineAt::X(0.0), Ink::Grey, LineStyle::Dashed);
    Plot::new(x, y, [bars, no_error]).into()
}

/// Least-squares line through pairs of actual and decoded values, and the range of the actual ones. A regression figure
/// needs both for all pairs, so they are computed once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegressionLine {
    /// Smallest and largest finite actual value; infinite without one.
    ends: [f64; 2],
    /// Pearson's correlation coefficient. Like the line, it is NaN or infinite unless both sides vary.
    correlation: f64,
    slope: f64,
    /// In the unit of the values.
    offset: f64,
}

impl RegressionLine {
    /// Fits the line to pairs of actual and decoded values.
    pub fn of(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> Self {
        let pairs = pairs.map(DVec2::from);
        let actual = pairs.clone().map(|pair| pair.x);
        let mean = pairs.clone().sum::<DVec2>() / pairs.clone().count() as f64;
        let (mut squares, mut product) = (DVec2::ZERO, 0.0);
        for deviation in pairs.map(|pair| pair - mean) {
            squares += deviation * deviation;
            product += deviation.x * deviation.y;
        }
        let slope = product / squares.x;
        Self {
            ends: ends(actual.filter(|value| value.is_finite())).into(),
            correlation: product / (squares.x * squares.y).sqrt(),
            slope,
            offset: mean.y - slope * mean.x,
        }
    }
}

/// Decoded against actual values, with the line on which they would be equal and `fitted` through all of them. `pair` is
/// called only for the samples that are drawn.
pub fn regression_figure(
    (count, pair): (usize, &dyn Fn(usize) -> (f64, f64)),
    fitted: &RegressionLine,
    of: Decoded<'_>,
) -> PlotFigure {
    let (name, unit, [answer, samples]) = of.words();
    let dots = thinned_places(count).map(|place| {
        let (actual, decoded) = pair(place);
        PlotPoint::from([actual, decoded]).of_item(place)
    });
    let line = |name: &str, look: Look, of: &dyn Fn(f64) -> f64| {
        let ends = fitted.ends.into_iter().filter(|end| end.is_finite());
        Series::new(name, look, ends.map(|actual| [actual, of(actual)]))
    };
    let name_of_dots = format!("{samples} of the test set");
    let dots = Series::new(name_of_dots, Look::marker(Ink::Blue, Marker::Dot), dots);
    let equal = line("equal", Look::line(Ink::Text, LineStyle::Dashed), &|actual| actual);
    let (mut series, mut notes) = (vec![dots, equal], Vec::new());
    let fit = *fitted;
    if fit.correlation.is_finite() && fit.offset.is_finite() {
        let look = Look::line(Ink::Orange, LineStyle::Solid);
        series.push(line("fitted line", look, &|actual| fit.slope * actual + fit.offset));
        let sign = if fit.offset < 0.0 { '−' } else { '+' };
        let [slope, offset] = [fit.slope, fit.offset.abs()].map(format_number);
        let offset = with_unit(offset, unit);
        notes.push(format!("Correlation R = {}", format_r2(fit.correlation)));
        notes.push(format!("Fitted line: {answer} = {slope} · actual {sign} {offset}"));
    }
    decoded_against_actual(&titled(name, unit), answer, series, notes)
}

/// One plot of `series` with equal scales: decoded values, called `answer`, against actual values of the quantity `title`.
pub(super) fn decoded_against_actual(title: &str, answer: &str, series: Vec<Series>, notes: Vec<String>) -> PlotFigure {
    let [x, y] = ["actual", answer].map(|what| PlotAxis::linear(format!("{what} {title}")));
    let mut plot = Plot::new(x, y, series);
    plot.has_equal_scales = true;
    PlotFigure::new([plot], notes)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    #[test]
    fn every_finite_error_is_counted_once_and_zero_is_in_the_middle() {
        let finite = (0..200).map(|i| (f64::from(i) * 0.731).sin()).chain([0.0, 1.0, -1.0]);
        let pairs = Vec::from_iter(finite.chain([f64::NAN]).map(|error| (4.0, 4.0 + error)));
        let figure = histogram_figure(&pairs, Decoded::Nodes);
        let bars = &figure.plots[0].series[0];
        let Form::Bars(width) = bars.form else {
            panic!("{bars:?}");
        };
        for bar in &bars.points {
            let within = |(actual, decoded): &&(f64, f64)| (decoded - actual - bar.x).abs() < 0.5 * width / 0.92;
            assert_eq!(pairs.iter().filter(within).count() as f64, bar.y, "{bar:?}");
        }
        assert_eq!(bars.points.iter().map(|bar| bar.y).sum::<f64>(), 203.0);
        assert_eq!(
            histogram_figure(&[(4.0, 4.0); 3], Decoded::Nodes).plots[0].series[0].points[BARS / 2].y,
            3.0
        );
    }

    #[test]
    fn bars_of_a_target_lead_back_to_its_samples() {
        const SAMPLES: usize = 50_000;
        let actual = Array2::from_shape_fn((SAMPLES, 2), |(sample, target)| (sample + target) as f64);
        let test = Dataset::new(actual.clone(), actual.clone(), None, (0..SAMPLES).collect()).unwrap();
        let mut answers = actual;
        answers[[30_000, 1]] += 2.0;
        let pairs = value_pairs(&test, &answers, Some(1));
        assert!(pairs.len() <= 20_000, "{}", pairs.len());
        let off = pairs.iter().position(|(actual, decoded)| actual != decoded).unwrap();
        assert_eq!(pair_sample(&test, off), Some(30_000));
        assert_eq!(pair_sample(&test, pairs.len()), None);
        let force = Channel::new("force", Some("N"));
        let figure = histogram_figure(&pairs, Decoded::Target(&force));
        let plot = &figure.plots[0];
        assert_eq!(plot.x.name, "error of force (N), decoded − actual");
        let last = plot.series[0].points.last().unwrap();
        assert_eq!((last.x, last.y), (2.0, 1.0));
    }

    #[test]
    fn a_pair_leads_back_to_its_node() {
        use decoupler_core::{
            dataset::{Seed, Stream},
            scene::Scene,
            sensor::SensorModel,
        };
        let sensor = SensorModel::new("10x6_3x18".parse().unwrap());
        let test = Dataset::simulate(&sensor, &Scene::default(), 20, &mut Seed(0).rng(Stream::Test)).unwrap();
        let mut decoupled = test.targets().to_owned();
        // The third node of row-wire 4 in the second snapshot.
        decoupled[[13, 8]] += 0.25;
        let pairs = value_pairs(&test, &decoupled, None);
        let off = pairs
            .iter()
            .position(|(actual, decoupled)| actual != decoupled)
            .unwrap();
        let expected = NodeAddress {
            snapshot: 1,
            row: 3,
            node: 2,
        };
        assert_eq!(pair_address(&test, off), Some(expected));
        assert_eq!(pair_address(&test, pairs.len()), None);
    }

    fn of_nodes(pairs: &[(f64, f64)]) -> PlotFigure {
        let line = RegressionLine::of(pairs.iter().copied());
        regression_figure((pairs.len(), &|pair| pairs[pair]), &line, Decoded::Nodes)
    }

    #[test]
    fn the_fit_finds_a_line_unless_values_are_constant() {
        let fit = |pairs: &[(f64, f64)]| RegressionLine::of(pairs.iter().copied());
        let line: Vec<_> = (0..9).map(|i| (f64::from(i), 3.0 * f64::from(i) - 1.0)).collect();
        let found = fit(&line);
        assert!((found.correlation - 1.0).abs() < 1e-15);
        assert!((found.slope - 3.0).abs() < 1e-14 && (found.offset + 1.0).abs() < 1e-13);
        assert!(of_nodes(&[]).keys().is_empty());
        assert_eq!(of_nodes(&[(1.0, 2.0), (1.0, 3.0)]).keys().len(), 2, "no fitted line");
    }

    #[test]
    fn the_regression_names_its_target_with_the_unit_if_there_is_one() {
        let pairs = [(0.0, 1.0), (1.0, 3.0), (2.0, 5.0)];
        let line = RegressionLine::of(pairs.into_iter());
        let (force, unnamed) = (Channel::new("force", Some("N")), Channel::new("c2", None));
        let figure = regression_figure((3, &|sample| pairs[sample]), &line, Decoded::Target(&force));
        assert_eq!(figure.plots[0].x.name, "actual force (N)");
        assert_eq!(figure.notes[1], "Fitted line: decoded = 2.00 · actual + 1.00 N");
        let without = regression_figure((3, &|sample| pairs[sample]), &line, Decoded::Target(&unnamed));
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
        let figure = regression_figure((SAMPLES, &counted), &line, Decoded::Target(&Channel::new("x", None)));
        assert!(asked.get() <= 2001, "{} samples used", asked.get());
        assert_eq!(figure.plots[0].series[0].points.len(), asked.get());
        // Least squares: the slope is 1 − 2 · 0.001 for actual values that are independent of the sample.
        assert!((line.slope - 0.998).abs() < 2e-5, "{line:?}");
    }
}
