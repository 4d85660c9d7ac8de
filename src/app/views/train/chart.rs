use super::state::TrainView;
use crate::{
    app::shared::Shared,
    figure::{
        Hue, LineAt, LineStyle, PlotFigure, ReferenceLine, error_histogram_figure, loss_figure, node_figure,
        regression_figure, training_state_figure,
    },
};

/// The charts below the surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BottomTab {
    /// Error against epoch.
    #[default]
    Loss,
    /// Gradient, damping or rate, and validation failures against epoch.
    TrainingState,
    /// Distribution of the errors of z.
    ErrorHistogram,
    /// Decoupled against actual z.
    Regression,
    /// The nodes of the snapshot: the paper's Fig. 6.
    Nodes,
    /// Readings of the snapshot, where there is no room for a card of their own.
    Readings,
}

impl BottomTab {
    /// The word for the chart in a file's name.
    pub(super) fn file_word(self) -> &'static str {
        match self {
            Self::Loss => "loss",
            Self::TrainingState => "training-state",
            Self::ErrorHistogram => "histogram",
            Self::Regression => "regression",
            Self::Nodes => "nodes",
            Self::Readings => "readings",
        }
    }
}

/// The chart on show; `None` before there is anything to draw.
pub(super) fn chart_figure(view: &TrainView, shared: &Shared) -> Option<PlotFigure> {
    let trained = || shared.shown_run().zip(view.result(shared));
    Some(match view.tab {
        BottomTab::Loss => {
            let (run, result) = trained()?;
            let mut figure = loss_figure(&run.history, &run.stages, result.best_epoch);
            if let (Some(epoch), Some(plot)) = (view.scrub.epoch(), figure.plots.first_mut()) {
                let at = LineAt::X(epoch as f64);
                plot.lines
                    .push(ReferenceLine::new("network on show", at, Hue::Orange, LineStyle::Solid));
            }
            figure
        }
        BottomTab::TrainingState => {
            let (run, _) = trained()?;
            training_state_figure(&run.history, &run.stages)
        }
        BottomTab::ErrorHistogram => error_histogram_figure(view.drawn.pairs_mm()?),
        BottomTab::Regression => regression_figure(view.drawn.pairs_mm()?),
        BottomTab::Nodes => {
            let nodes_per_row = shared.test().map_or(1, |test| test.sensor.scale.nodes_per_row());
            let frames = view.frames();
            let decoupled_mm = frames.decoupled.as_ref().map(|(decoupled, _)| &*decoupled.nodes_mm);
            let bars_mm = view.error_bars_mm();
            node_figure(&frames.actual.nodes_mm, decoupled_mm, bars_mm, nodes_per_row)
        }
        BottomTab::Readings => return None,
    })
}
