use super::{
    bottom_tab::BottomTab,
    inspect::{section_of, with_lights},
    state::TrainView,
};
use crate::window::shared::Shared;
use decoupler_files::figure::{
    Figure, HeatMap, Hue, LineAt, LineStyle, PlotFigure, ReferenceLine, error_histogram_figure, loss_figure,
    node_figure, regression_figure, sample_figure, target_histogram_figure, target_regression_figure,
    training_state_figure,
};

/// A chart below the surfaces.
#[expect(clippy::large_enum_variant, reason = "only one is displayed")]
pub(super) enum Chart {
    Plots(PlotFigure),
    Map(HeatMap),
}

impl From<Chart> for Figure {
    fn from(chart: Chart) -> Self {
        match chart {
            Chart::Plots(plots) => plots.into(),
            Chart::Map(map) => map.into(),
        }
    }
}

/// The displayed chart, with what is lit standing out; `None` before there is anything to draw.
pub(super) fn chart(view: &TrainView, shared: &Shared) -> Option<Chart> {
    if view.tab == BottomTab::ErrorMap {
        let charts = view.result(shared)?.charts.as_ref()?;
        let map = charts.error_map.as_ref().ok()?;
        return Some(Chart::Map(HeatMap::clone(map).coloured(shared.look.colours)));
    }
    Some(Chart::Plots(with_lights(figure(view, shared)?, view, shared)))
}

fn figure(view: &TrainView, shared: &Shared) -> Option<PlotFigure> {
    let trained = || shared.shown_run().zip(view.result(shared));
    Some(match view.tab {
        BottomTab::Loss => {
            let (run, result) = trained()?;
            let mut figure = loss_figure(run.outline.records(), &run.stages, result.best_epoch);
            if let (Some(epoch), Some(plot)) = (view.scrub.epoch(), figure.plots.first_mut()) {
                let at = LineAt::X(epoch as f64);
                plot.lines.push(ReferenceLine::new(
                    "displayed network",
                    at,
                    Hue::Orange,
                    LineStyle::Solid,
                ));
            }
            figure
        }
        BottomTab::TrainingState => {
            let (run, _) = trained()?;
            training_state_figure(run.outline.records(), &run.stages)
        }
        BottomTab::ErrorHistogram => {
            let (pairs, bar) = (view.drawn.pairs()?, view.lights.bar);
            match shared.recorded_test() {
                None => error_histogram_figure(pairs, bar),
                Some(test) => target_histogram_figure(pairs, bar, test.problem.targets.get(view.target_of(test))?),
            }
        }
        BottomTab::Regression => {
            let pairs = view.drawn.pairs()?;
            match shared.recorded_test() {
                None => regression_figure(pairs),
                Some(test) => {
                    let target = view.target_of(test);
                    let channel = test.problem.targets.get(target)?;
                    let line = view.result(shared)?.charts.as_ref()?.lines.get(target)?;
                    let samples: (usize, &dyn Fn(usize) -> (f64, f64)) = (pairs.len(), &|pair| pairs[pair]);
                    target_regression_figure(samples, line, &channel.name, channel.unit.as_deref())
                }
            }
        }
        BottomTab::Sample => all_targets_figure(view, shared)?,
        BottomTab::Nodes => {
            let nodes_per_row = shared.test().map_or(1, |test| test.sensor.scale.nodes_per_row());
            let frames = view.frames();
            let decoupled_mm = frames.decoupled.as_ref().map(|(decoupled, _)| &*decoupled.nodes_mm);
            let bars_mm = view.error_bars_mm();
            node_figure(&frames.actual.nodes_mm, decoupled_mm, bars_mm, nodes_per_row)
        }
        BottomTab::Section => section_of(&view.section, shared.test()?, view.frames(), shared.look),
        BottomTab::ErrorMap | BottomTab::Readings => return None,
    })
}

/// All displayed targets of the sample of a recording, actual and decoded.
pub(super) fn all_targets_figure(view: &TrainView, shared: &Shared) -> Option<PlotFigure> {
    let (test, result) = (shared.recorded_test()?, view.result(shared)?);
    if view.snapshot >= test.set.samples() {
        return None;
    }
    let actual = test.set.targets().row(view.snapshot).to_vec();
    let decoded = result.answers.row(view.snapshot).to_vec();
    Some(sample_figure(&test.problem.targets, &actual, &decoded, &test.ranges))
}
