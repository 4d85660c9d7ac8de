//! What the window shows, as a figure for print.

use std::path::Path;

use super::{
    charts::{self, BottomTab},
    export_kind::file_name,
    state::TrainView,
    surfaces::surface_figure,
};
use crate::{
    app::{
        plotting::plot_style::thinned,
        shared::{FileTask, FileWords, RunResult, RunView, SURFACES, Shared},
        test_view::Frame,
    },
    export::figures::{Hue, Marker, PictureError, PictureFormat, Plot, PlotAxis, PlotPoint, Series, Span, node_plot},
    figure::surface::ViewMode,
    training::EpochRecord,
};

/// Which of the pictures in view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShownPicture {
    /// Actual surface of the snapshot, and the decoupled one or the error beside it.
    Surfaces,
    /// The chart below them.
    Chart,
}

impl ShownPicture {
    /// What the file is called.
    pub fn words(self) -> FileWords {
        match self {
            Self::Surfaces => SURFACES,
            Self::Chart => FileWords {
                name: "Chart, PNG or SVG…",
                kind: "picture of the chart",
                description: "The chart in view, for print: on a light ground, as PNG or SVG as the name ends.",
                extensions: &["png", "svg"],
            },
        }
    }

    /// The picture as it is in view; `None` before a training.
    pub fn task(self, view: &TrainView, shared: &Shared) -> Option<FileTask> {
        let run = shared.shown_run()?;
        let result = run.result.as_ref()?;
        let words = self.words();
        let what = match (self, shared.look.mode, view.tab) {
            (Self::Surfaces, ViewMode::ThreeD, _) => "surfaces",
            (Self::Surfaces, ViewMode::Top, _) => "surfaces-top",
            (Self::Chart, _, BottomTab::Loss) => "loss",
            (Self::Chart, _, BottomTab::TrainingState) => "training-state",
            (Self::Chart, _, BottomTab::ErrorHistogram) => "histogram",
            (Self::Chart, _, BottomTab::Regression) => "regression",
            (Self::Chart, _, BottomTab::Nodes) => "nodes",
        };
        let name = file_name(what, words, &run.settings);
        if self == Self::Surfaces {
            return Some(FileTask::surfaces(surface_figure(view, shared), name));
        }
        let plot = chart(view, run, result)?;
        let write = move |path: &Path| -> Result<(), PictureError> {
            let format = PictureFormat::of_path(path)?;
            plot.draw().save(format, path)
        };
        Some(FileTask::save(words, name, write))
    }
}

fn chart(view: &TrainView, run: &RunView, result: &RunResult) -> Option<Plot> {
    let pairs = || view.drawn.pairs_mm().unwrap_or_default();
    Some(match view.tab {
        BottomTab::Loss => loss(run, result),
        BottomTab::TrainingState => training_state(run),
        BottomTab::ErrorHistogram => histogram(pairs()),
        BottomTab::Regression => regression(pairs()),
        BottomTab::Nodes => {
            let z_mm = |frame: &Frame| -> Vec<f64> { frame.nodes_mm.iter().map(|node| node.z).collect() };
            let (decoupled, _) = view.drawn.frames.decoupled.as_ref()?;
            let spread = view.error_bars_mm();
            node_plot(&z_mm(&view.drawn.frames.actual), &z_mm(decoupled), spread)
        }
    })
}

/// A quantity of each epoch, given the largest that is drawn.
type OfEpoch = fn(&EpochRecord, f64) -> Option<f64>;

fn curve(name: &str, hue: Hue, history: &[EpochRecord], highest: f64, of: OfEpoch) -> Option<Series> {
    let points = thinned(history).filter_map(|epoch| {
        let bar = None;
        Some(PlotPoint {
            x: epoch.epoch as f64,
            y: of(&epoch, highest)?,
            bar,
        })
    });
    let points: Vec<PlotPoint> = points.collect();
    (!points.is_empty()).then(|| Series {
        points,
        ..line(name, hue, Vec::new())
    })
}

fn line(name: &str, hue: Hue, points: Vec<[f64; 2]>) -> Series {
    let points = points.into_iter().map(|[x, y]| PlotPoint { x, y, bar: None });
    Series {
        name: name.to_owned(),
        hue,
        has_line: true,
        is_dashed: false,
        marker: None,
        points: points.collect(),
    }
}

fn loss(run: &RunView, result: &RunResult) -> Plot {
    let curves: [(&str, Hue, OfEpoch); 3] = [
        ("training", Hue::Blue, |epoch, highest| {
            Some(epoch.training_mse.min(highest))
        }),
        ("validation", Hue::Green, |epoch, highest| {
            Some(epoch.validation_mse?.min(highest))
        }),
        ("test", Hue::Orange, |epoch, highest| Some(epoch.test_mse?.min(highest))),
    ];
    let best = result.best_epoch as f64;
    let highest = charts::highest_mse(&run.history);
    let curves = curves.into_iter();
    Plot {
        x: PlotAxis::linear("epoch"),
        y: PlotAxis::logarithmic("mean squared error (scaled)"),
        series: curves
            .filter_map(|(name, hue, of)| curve(name, hue, &run.history, highest, of))
            .collect(),
        spans: vec![Span {
            name: "best weights".to_owned(),
            from: best,
            to: best,
        }],
        width_pt: Plot::WIDTH_PT,
    }
}

fn training_state(run: &RunView) -> Plot {
    let name = charts::parameter_name(&run.stages);
    let curves: [(&str, Hue, OfEpoch); 2] = [
        ("gradient", Hue::Blue, |epoch, highest| {
            Some(epoch.gradient_norm.min(highest))
        }),
        (name, Hue::Orange, |epoch, _| {
            Some(charts::drawn_parameter(epoch.parameter))
        }),
    ];
    let highest = charts::highest_gradient(&run.history);
    let curves = curves.into_iter();
    Plot {
        x: PlotAxis::linear("epoch"),
        y: PlotAxis::logarithmic(format!("gradient, {name}")),
        series: curves
            .filter_map(|(name, hue, of)| curve(name, hue, &run.history, highest, of))
            .collect(),
        spans: Vec::new(),
        width_pt: Plot::WIDTH_PT,
    }
}

/// The outline of the histogram in the window.
fn histogram(pairs_mm: &[(f64, f64)]) -> Plot {
    let errors: Vec<f64> = pairs_mm.iter().map(|(actual, decoupled)| decoupled - actual).collect();
    let (counts, width) = charts::histogram(&errors);
    let half = 0.5 * counts.len() as f64;
    let edge = |bin: usize| width * (bin as f64 - half);
    let mut outline = vec![[edge(0), 0.0]];
    for (bin, &count) in counts.iter().enumerate() {
        outline.extend([edge(bin), edge(bin + 1)].map(|edge| [edge, count as f64]));
    }
    outline.push([edge(counts.len()), 0.0]);
    Plot {
        x: PlotAxis::linear("error of z (mm), decoupled − actual"),
        y: PlotAxis::linear("nodes of the test set"),
        series: vec![line("nodes", Hue::Blue, outline)],
        spans: vec![Span {
            name: "no error".to_owned(),
            from: 0.0,
            to: 0.0,
        }],
        width_pt: Plot::WIDTH_PT,
    }
}

fn regression(pairs_mm: &[(f64, f64)]) -> Plot {
    let dots = thinned(pairs_mm).map(|(actual, decoupled)| [actual, decoupled]);
    let nodes = Series {
        has_line: false,
        marker: Some(Marker::Disc),
        ..line("nodes", Hue::Blue, dots.collect())
    };
    let actual = || pairs_mm.iter().map(|pair| pair.0).filter(|z| z.is_finite());
    let ends = [actual().reduce(f64::min), actual().reduce(f64::max)];
    let ends = ends.into_iter().flatten().map(|end| [end, end]);
    let equal = Series {
        is_dashed: true,
        ..line("equal", Hue::Grey, ends.collect())
    };
    Plot {
        x: PlotAxis::linear("actual z (mm)"),
        y: PlotAxis::linear("decoupled z (mm)"),
        series: vec![nodes, equal],
        spans: Vec::new(),
        width_pt: Plot::WIDTH_PT,
    }
}
