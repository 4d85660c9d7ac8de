use decoupler_files::figure::{
    Figure, HeatMap, Hue, LineAt, LineStyle, PlotFigure, ReferenceLine, error_histogram_figure, loss_figure,
    node_figure, regression_figure, sample_figure, target_histogram_figure, target_regression_figure,
    training_state_figure,
};

use super::{
    inspect::{section_of, with_lights},
    state::TrainView,
};
use crate::window::{
    shared::{Shared, SourceKind},
    test_view::Positions,
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

/// The charts below the surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BottomTab {
    /// Error against epoch.
    #[default]
    Loss,
    /// Gradient, damping or rate, and validation failures against epoch.
    TrainingState,
    /// Distribution of the errors of z, or of a target.
    ErrorHistogram,
    /// Decoupled against actual z, or decoded against actual values of a target.
    Regression,
    /// All targets of a sample of a recording, where surfaces take the place above.
    Sample,
    /// Error over the position, where targets of a recording are a position.
    ErrorMap,
    /// The nodes of the snapshot: the paper's Fig. 6.
    Nodes,
    /// A section through the surfaces of the snapshot.
    Section,
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
            Self::Sample => "sample",
            Self::ErrorMap => "error-map",
            Self::Nodes => "nodes",
            Self::Section => "section",
            Self::Readings => "readings",
        }
    }

    const OF_ARRAY: [(Self, &'static str); 7] = [
        (Self::Loss, "Loss"),
        (Self::TrainingState, "Training state"),
        (Self::ErrorHistogram, "Histogram"),
        (Self::Regression, "Regression"),
        (Self::Nodes, "Nodes"),
        (Self::Section, "Section"),
        (Self::Readings, "Readings"),
    ];

    const OF_RECORDING: [(Self, &'static str); 6] = [
        (Self::Loss, "Loss"),
        (Self::TrainingState, "Training state"),
        (Self::ErrorHistogram, "Histogram"),
        (Self::Regression, "Regression"),
        (Self::Sample, "Sample"),
        (Self::ErrorMap, "Error map"),
    ];

    /// The charts of the current source, with their names. Readings are among them unless they have a card of their own.
    pub(super) fn offered(shared: &Shared, has_readings: bool) -> Vec<(Self, &'static str)> {
        let all = match shared.source {
            SourceKind::Array => &Self::OF_ARRAY[..],
            SourceKind::Recording => &Self::OF_RECORDING,
        };
        let is_offered = |tab: Self| match tab {
            Self::Readings => has_readings,
            // Without surfaces the sample takes their place.
            Self::Sample => has_target_surface(shared),
            Self::ErrorMap => has_error_map(shared),
            _ => true,
        };
        all.iter().copied().filter(|(tab, _)| is_offered(*tab)).collect()
    }
}

fn has_error_map(shared: &Shared) -> bool {
    let charts = shared.result().and_then(|result| result.charts.as_ref());
    charts.is_some_and(|charts| charts.error_map.is_ok())
}

/// Returns true if a surface goes through the displayed targets of the recording.
pub(super) fn has_target_surface(shared: &Shared) -> bool {
    let test = shared.recorded_test();
    test.is_some_and(|test| matches!(test.positions, Positions::Surface(_)))
}
