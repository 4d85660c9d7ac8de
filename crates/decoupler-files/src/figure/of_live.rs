//! The figure of decoded values over time.

use std::sync::Arc;

use super::{
    axis::PlotAxis,
    look::{Hue, Key, LineStyle, Look},
    plot::{Plot, Series},
    plot_figure::PlotFigure,
};
use decoupler_core::evaluation::Channel;

const HUES: [Hue; 6] = [Hue::Blue, Hue::Orange, Hue::Green, Hue::Violet, Hue::Cyan, Hue::Red];
/// Most targets that have colours and names of their own; of more, all are fine lines.
const MAX_NAMES: usize = 2 * HUES.len();

/// Values of all targets over time, `history` being times in seconds with a value for each target: a plot for each unit.
pub fn targets_over_time_figure(targets: &[Channel], history: &[(f64, Arc<[f64]>)]) -> PlotFigure {
    let mut units: Vec<&Option<String>> = Vec::new();
    for target in targets {
        if !units.contains(&&target.unit) {
            units.push(&target.unit);
        }
    }
    let has_names = targets.len() <= MAX_NAMES;
    let look = |target: usize| {
        let style = match target / HUES.len() {
            _ if !has_names => LineStyle::Fine,
            0 => LineStyle::Solid,
            _ => LineStyle::Dashed,
        };
        Look::line(HUES[target % HUES.len()], style)
    };
    let series = |target: usize| {
        let points = history.iter().map(|(time_s, values)| [*time_s, values[target]]);
        Series::new(targets[target].name.clone(), look(target), points)
    };
    let plot = |unit: &Option<String>| {
        let of_unit = (0..targets.len()).filter(|&target| targets[target].unit == *unit);
        let name = match unit {
            Some(unit) => format!("decoded value ({unit})"),
            None => "decoded value".to_owned(),
        };
        Plot::new(
            PlotAxis::linear("time (s)"),
            PlotAxis::linear(name),
            of_unit.map(series).collect(),
        )
    };
    let keys = (0..targets.len()).filter(|_| has_names);
    PlotFigure {
        plots: units.into_iter().map(plot).collect(),
        keys: keys
            .map(|target| Key::new(targets[target].title(), look(target)))
            .collect(),
        notes: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_of_one_unit_share_a_plot() {
        let channel = |name: &str, unit: &str| Channel {
            name: name.to_owned(),
            unit: Some(unit.to_owned()),
        };
        let targets = [channel("x", "mm"), channel("force", "N"), channel("y", "mm")];
        let history = [(0.0, Arc::from([1.0, 2.0, 3.0])), (0.5, Arc::from([4.0, 5.0, 6.0]))];
        let figure = targets_over_time_figure(&targets, &history);
        let names = |plot: &Plot| Vec::from_iter(plot.series.iter().map(|series| series.name.clone()));
        assert_eq!(
            figure.plots.iter().map(names).collect::<Vec<_>>(),
            [vec!["x", "y"], vec!["force"]]
        );
        let last = &figure.plots[0].series[1].points[1];
        assert_eq!([last.x, last.y], [0.5, 6.0]);
        assert_eq!(figure.keys.len(), 3);
    }
}
