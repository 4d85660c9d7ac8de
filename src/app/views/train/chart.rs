use super::{
    bottom_tab::BottomTab,
    inspect::{section_of, with_lights},
    state::TrainView,
};
use crate::{
    app::shared::Shared,
    figure::{
        Hue, LineAt, LineStyle, PlotFigure, ReferenceLine, error_histogram_figure, loss_figure, node_figure,
        regression_figure, training_state_figure,
    },
};

/// The chart on show, with what is lit standing out; `None` before there is anything to draw.
pub(super) fn chart_figure(view: &TrainView, shared: &Shared) -> Option<PlotFigure> {
    Some(with_lights(figure(view, shared)?, view, shared))
}

fn figure(view: &TrainView, shared: &Shared) -> Option<PlotFigure> {
    let trained = || shared.shown_run().zip(view.result(shared));
    Some(match view.tab {
        BottomTab::Loss => {
            let (run, result) = trained()?;
            let mut figure = loss_figure(run.outline.records(), &run.stages, result.best_epoch);
            if let (Some(epoch), Some(plot)) = (view.scrub.epoch(), figure.plots.first_mut()) {
                let at = LineAt::X(epoch as f64);
                plot.lines
                    .push(ReferenceLine::new("network on show", at, Hue::Orange, LineStyle::Solid));
            }
            figure
        }
        BottomTab::TrainingState => {
            let (run, _) = trained()?;
            training_state_figure(run.outline.records(), &run.stages)
        }
        BottomTab::ErrorHistogram => error_histogram_figure(view.drawn.pairs_mm()?, view.lights.bar),
        BottomTab::Regression => regression_figure(view.drawn.pairs_mm()?),
        BottomTab::Nodes => {
            let nodes_per_row = shared.test().map_or(1, |test| test.sensor.scale.nodes_per_row());
            let frames = view.frames();
            let decoupled_mm = frames.decoupled.as_ref().map(|(decoupled, _)| &*decoupled.nodes_mm);
            let bars_mm = view.error_bars_mm();
            node_figure(&frames.actual.nodes_mm, decoupled_mm, bars_mm, nodes_per_row)
        }
        BottomTab::Section => section_of(&view.section, shared.test()?, view.frames(), shared.look),
        BottomTab::Readings => return None,
    })
}
