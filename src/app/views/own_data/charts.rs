use std::sync::Arc;

use super::{
    curves::Curves,
    model::{Positions, Tested, Trained, position_pair},
};
use crate::figure::{
    Figure, HeatMap, PlotFigure, loss_figure, sample_figure, target_regression_figure, training_state_figure,
};

/// Charts of a network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum ChartTab {
    /// Error against epoch.
    #[default]
    Loss,
    /// The method's own quantities against epoch.
    TrainingState,
    /// Decoded against actual values of a target.
    Regression,
    /// Surfaces of one sample through the targets that have positions.
    Surfaces,
    /// All targets of one sample.
    Sample,
    /// Error over the position.
    Map,
}

/// The chart on show.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ChartChoice {
    pub(super) tab: ChartTab,
    /// Target of the regression.
    pub(super) target: usize,
    /// Test sample of which surfaces or all targets are shown, from 0.
    pub(super) sample: usize,
}

/// A chart, or why there is none.
pub(super) enum Chart {
    Plots(PlotFigure),
    Map(Arc<HeatMap>),
    /// Surfaces, which the look of all views belongs to.
    Surfaces,
    None(&'static str),
}

impl ChartTab {
    const ALL: [(Self, &'static str); 6] = [
        (Self::Loss, "Loss"),
        (Self::TrainingState, "Training state"),
        (Self::Regression, "Regression"),
        (Self::Surfaces, "Surfaces"),
        (Self::Sample, "Sample"),
        (Self::Map, "Error map"),
    ];

    /// Charts offered for a network: surfaces where targets have positions, a map of errors where none has.
    pub(super) fn offered(trained: &Trained) -> Vec<(Self, &'static str)> {
        let has_positions = !matches!(trained.positions(), Positions::None);
        let mut offered = Self::ALL.to_vec();
        // Targets that have positions are no positions themselves.
        let of_others = if has_positions { Self::Map } else { Self::Surfaces };
        offered.retain(|(tab, _)| *tab != of_others);
        offered
    }

    /// Word in names of files.
    pub(super) fn file_word(self) -> &'static str {
        match self {
            Self::Loss => "loss",
            Self::TrainingState => "training-state",
            Self::Regression => "regression",
            Self::Surfaces => "surfaces",
            Self::Sample => "sample",
            Self::Map => "error-map",
        }
    }
}

impl ChartChoice {
    /// Chooses the chart that says most about a network.
    pub(super) fn fit(&mut self, trained: &Trained) {
        let targets = &trained.file.targets;
        // Where a probe was, in the plane or in space. Of more columns without names the first two are rarely that.
        let is_probe = targets.len() <= 3;
        self.target = 0;
        self.tab = match trained.positions() {
            Positions::Surface(_) => ChartTab::Surfaces,
            Positions::NoSurface(_) => ChartTab::Sample,
            Positions::None if is_probe && position_pair(targets).is_some() => ChartTab::Map,
            Positions::None => ChartTab::Regression,
        };
    }

    /// The sample on show, which is one of these.
    pub(super) fn sample_of(&self, tested: &Tested) -> usize {
        self.sample.min(tested.set().samples().saturating_sub(1))
    }

    /// The chart of a network.
    pub(super) fn chart(&self, trained: &Trained, curves: &Curves) -> Chart {
        const NO_SAMPLES: &str = "There are no test samples at hand: the recording of this network was not found.";
        let record = &trained.file.training;
        let targets = &trained.file.targets;
        match (self.tab, &trained.tested) {
            (ChartTab::Loss, _) => Chart::Plots(loss_figure(curves.records(), &record.stages, record.best_epoch)),
            (ChartTab::TrainingState, _) => Chart::Plots(training_state_figure(curves.records(), &record.stages)),
            (_, None) => Chart::None(NO_SAMPLES),
            (ChartTab::Regression, Some(tested)) => {
                let target = self.target.min(targets.len().saturating_sub(1));
                let channel = &targets[target];
                let pair = |sample| tested.pair(sample, target);
                let line = &tested.lines[target];
                let samples = tested.set().samples();
                let unit = channel.unit.as_deref();
                Chart::Plots(target_regression_figure((samples, &pair), line, &channel.name, unit))
            }
            (ChartTab::Surfaces, Some(_)) => Chart::Surfaces,
            (ChartTab::Sample, Some(tested)) => {
                let sample = self.sample_of(tested);
                let actual = tested.set().targets().row(sample).to_vec();
                let decoded = tested.answers.row(sample).to_vec();
                Chart::Plots(sample_figure(targets, &actual, &decoded, &tested.ranges))
            }
            (ChartTab::Map, Some(tested)) => match &tested.error_map {
                Ok(map) => Chart::Map(Arc::clone(map)),
                Err(reason) => Chart::None(reason),
            },
        }
    }
}

impl Chart {
    /// The chart as a figure to be exported.
    pub(super) fn into_figure(self) -> Option<Figure> {
        match self {
            Self::Plots(plots) => Some(plots.into()),
            Self::Map(map) => Some(HeatMap::clone(&map).into()),
            Self::Surfaces | Self::None(_) => None,
        }
    }
}
