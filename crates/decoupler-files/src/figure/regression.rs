//! Decoded against actual values, with the line fitted to them.

use super::{
    axis::PlotAxis,
    look::{Hue, Key, LineStyle, Look, Marker},
    plot::{Plot, PlotFigure, PlotPoint, Series, thinned_places},
};
use decoupler_core::text::format_number;

/// Least-squares line through pairs of actual and decoded values, and the range of the actual ones: what a regression figure
/// takes from all pairs, however many, and so is made once for them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegressionLine {
    /// Smallest and largest finite actual value.
    ends: Option<[f64; 2]>,
    fit: Option<Fit>,
}

/// The line where both sides vary.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Fit {
    /// Pearson's.
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
    /// `None` where one side does not vary.
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
/// through all of them. There are this many samples, of which few enough to be seen are asked for their actual and decoded
/// value.
pub fn target_regression_figure(
    samples: (usize, &dyn Fn(usize) -> (f64, f64)),
    line: &RegressionLine,
    name: &str,
    unit: Option<&str>,
) -> PlotFigure {
    regression(samples, line, (name, unit), ["decoded", "samples of the test set"])
}

/// Actual values of a quantity (its name and unit), and against them what a network makes of the readings, called `answer`,
/// in pairs of `what`.
fn regression(
    (count, pair): (usize, &dyn Fn(usize) -> (f64, f64)),
    fitted: &RegressionLine,
    (name, unit): (&str, Option<&str>),
    [answer, what]: [&str; 2],
) -> PlotFigure {
    let dots = thinned_places(count).map(|place| {
        let (actual, decoded) = pair(place);
        PlotPoint {
            item: Some(place),
            ..PlotPoint::from([actual, decoded])
        }
    });
    let line = |name: &str, look: Look, of: &dyn Fn(f64) -> f64| {
        let ends = fitted.ends.into_iter().flatten();
        Series::new(name, look, ends.map(|actual| [actual, of(actual)]))
    };
    let mut series = vec![
        Series {
            points: dots.collect(),
            ..Series::new(what, Look::marker(Hue::Blue, Marker::Dot), [])
        },
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
    PlotFigure {
        keys: series
            .iter()
            .map(|series| Key::new(&series.name, series.look))
            .collect(),
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
    fn the_fit_finds_a_line_and_none_without_variation() {
        let fit = |pairs: &[(f64, f64)]| RegressionLine::of(pairs.iter().copied()).fit;
        let line: Vec<_> = (0..9).map(|i| (f64::from(i), 3.0 * f64::from(i) - 1.0)).collect();
        let found = fit(&line).unwrap();
        assert!((found.correlation - 1.0).abs() < 1e-15);
        assert!((found.slope - 3.0).abs() < 1e-14 && (found.offset + 1.0).abs() < 1e-13);
        assert_eq!(fit(&[(1.0, 2.0), (1.0, 3.0)]), None);
        assert_eq!(fit(&[]), None);
        assert_eq!(
            regression_figure(&[(1.0, 2.0), (1.0, 3.0)]).keys.len(),
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
    fn a_figure_of_a_million_samples_looks_at_few_and_its_line_is_through_all() {
        const SAMPLES: usize = 1_000_000;
        let pair = |sample: usize| {
            let actual = (sample as f64 * 0.618_033_988_749_895).fract();
            // Rare samples that no thinning by a fixed step sees turn the line.
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
        assert!(asked.get() <= 2001, "{} samples looked at", asked.get());
        assert_eq!(figure.plots[0].series[0].points.len(), asked.get());
        // Least squares: the slope is 1 − 2 · 0.001 for actual values spread evenly whatever the sample.
        let fit = line.fit.unwrap();
        assert!((fit.slope - 0.998).abs() < 2e-5, "{fit:?}");
    }
}
