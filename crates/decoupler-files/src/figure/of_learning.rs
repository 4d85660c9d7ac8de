//! The figure of the error against the number of training samples.

use super::{
    axis::PlotAxis,
    look::{Hue, Key, LineStyle, Look, Marker},
    plot::{Plot, PlotFigure, PlotPoint, Series},
};
use decoupler_core::{
    evaluation::recorded::LearningCurve,
    text::{counted, format_number},
};

/// Test error of the target of this name and unit by the number of training samples: the mean of the fits, a bar from the
/// best to the worst, and the law fitted to them up to twice the samples.
pub fn learning_curve_figure(curve: &LearningCurve, name: &str, unit: Option<&str>) -> PlotFigure {
    const LAW_POINTS: usize = 60;
    let (fits, law) = (
        Look::marker(Hue::Blue, Marker::Disc),
        Look::line(Hue::Grey, LineStyle::Dashed),
    );
    let with_unit = |value: f64| match unit {
        Some(unit) => format!("{} {unit}", format_number(value)),
        None => format_number(value),
    };
    let points = curve.points.iter().map(|point| {
        let [best, worst] = point.range;
        PlotPoint {
            bar: Some(point.range),
            note: Some(format!(
                "{}: RMSE {}, {} to {}",
                counted(point.samples, "training sample"),
                with_unit(point.rmse),
                with_unit(best),
                with_unit(worst)
            )),
            ..PlotPoint::from([point.samples as f64, point.rmse])
        }
    });
    let measured = Series {
        points: points.collect(),
        ..Series::new("measured", fits, [])
    };
    let mut keys = vec![Key::new("mean of the fits, from best to worst", fits)];
    let mut series = Vec::new();
    if let (Some(fitted), [first, .., last]) = (curve.law, &curve.points[..]) {
        let (first, last) = (first.samples as f64, 2.0 * last.samples as f64);
        let along = (0..=LAW_POINTS).map(|step| first * (last / first).powf(step as f64 / LAW_POINTS as f64));
        let points = along.map(|samples| [samples, fitted.at(samples)]);
        series.push(Series::new("fitted law", law, points));
        keys.push(Key::new("law fitted to them, up to twice the samples", law));
    }
    series.push(measured);
    let error = unit.map_or_else(|| format!("RMSE of {name}"), |unit| format!("RMSE of {name} ({unit})"));
    PlotFigure {
        plots: vec![Plot::new(
            PlotAxis::logarithmic("training samples"),
            PlotAxis::logarithmic(error),
            series,
        )],
        keys,
        notes: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use decoupler_core::evaluation::recorded::{LearningPoint, PowerLaw};

    #[test]
    fn the_law_runs_from_the_fewest_samples_to_twice_the_most() {
        let point = |samples: usize| LearningPoint {
            samples,
            rmse: 4.0 / (samples as f64).sqrt(),
            range: [0.9, 1.1],
        };
        let law = PowerLaw {
            floor: 0.0,
            scale: 4.0,
            exponent: 0.5,
        };
        let curve = LearningCurve {
            points: vec![point(100), point(200), point(400)],
            law: Some(law),
            doubling: None,
        };
        let figure = learning_curve_figure(&curve, "force", Some("N"));
        let [law, measured] = &figure.plots[0].series[..] else {
            panic!("{figure:?}");
        };
        let (first, last) = (&law.points[0], &law.points[law.points.len() - 1]);
        assert!((first.x - 100.0).abs() < 1e-9 && (last.x - 800.0).abs() < 1e-9);
        assert!((last.y - 4.0 / 800.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(measured.points.len(), 3);
        assert_eq!(
            measured.points[2].note.as_deref(),
            Some("400 training samples: RMSE 0.200 N, 0.900 N to 1.10 N")
        );
        assert_eq!(figure.plots[0].y.name, "RMSE of force (N)");
        let without = LearningCurve { law: None, ..curve };
        assert_eq!(learning_curve_figure(&without, "c2", None).plots[0].series.len(), 1);
    }
}
