use super::{export_kind::file_name, state::TrainView};
use crate::{
    app::shared::{CHART, FileTask, Shared},
    figure::{PlotFigure, error_histogram_figure, loss_figure, node_figure, regression_figure, training_state_figure},
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
        }
    }
}

/// The chart on show; `None` before there is anything to draw.
pub(super) fn chart_figure(view: &TrainView, shared: &Shared) -> Option<PlotFigure> {
    let trained = || shared.shown_run().and_then(|run| Some((run, run.result.as_ref()?)));
    Some(match view.tab {
        BottomTab::Loss => {
            let (run, result) = trained()?;
            loss_figure(&run.history, &run.stages, result.best_epoch)
        }
        BottomTab::TrainingState => {
            let (run, _) = trained()?;
            training_state_figure(&run.history, &run.stages)
        }
        BottomTab::ErrorHistogram => error_histogram_figure(view.drawn.pairs_mm()?),
        BottomTab::Regression => regression_figure(view.drawn.pairs_mm()?),
        BottomTab::Nodes => {
            let nodes_per_row = shared.test().map_or(1, |test| test.sensor.scale.nodes_per_row());
            let frames = &view.drawn.frames;
            let decoupled_mm = frames.decoupled.as_ref().map(|(decoupled, _)| &*decoupled.nodes_mm);
            let bars_mm = view.error_bars_mm();
            node_figure(&frames.actual.nodes_mm, decoupled_mm, bars_mm, nodes_per_row)
        }
    })
}

/// The file of the chart as it is in view; `None` before a training.
pub(super) fn chart_task(view: &TrainView, shared: &Shared) -> Option<FileTask> {
    let run = shared.shown_run().filter(|run| run.result.is_some())?;
    let name = file_name(view.tab.file_word(), CHART, &run.settings);
    Some(FileTask::picture(CHART, name, chart_figure(view, shared)?))
}
