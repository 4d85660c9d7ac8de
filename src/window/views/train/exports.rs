//! Exports of the current training.

use decoupler_core::{
    dataset::Simulation,
    evaluation::{DecoderReport, RunSettings},
    sensor::SensorModel,
};
use decoupler_files::{
    export::{decoder_table, error_table},
    figure::{Figure, surface::ViewMode},
};

use super::{
    charts_card::{BottomTab, all_targets_figure, chart, has_target_surface},
    surfaces::surface_figure,
    view::TrainView,
};
use crate::window::shared::{
    Ask, Contents, Effect, Export, ExportGroup, FileTask, FileWords, NetworkSource, Phase, Purpose, RunResult, RunView,
    Shared, SourceKind, copy_exports, csv_export, error_table_export, file_stem, loss_export, network_exports,
    picture_exports,
};

/// A saved training that can be resumed.
pub const CHECKPOINT: FileWords = FileWords {
    kind: "checkpoint",
    description: "The training in its current state, paused or ended. Resumed here or in a terminal (train --checkpoint FILE \
                  --resume), it gives bit-identical results.",
    extensions: &["checkpoint"],
};

const OPENED: FileWords = FileWords {
    description: "Opens a training saved here or by train --checkpoint in a terminal, with its settings and its \
                  history, and pauses it. A resumed training gives bit-identical results.",
    ..CHECKPOINT
};

const DECODERS: FileWords = FileWords {
    kind: "decoder table",
    description: "Errors and times of the measured decoders with every digit, as CSV.",
    extensions: &["csv"],
};

/// Task of saving the checkpoint of `run`.
pub(super) fn checkpoint_task(run: &RunView) -> FileTask {
    FileTask::save_run(CHECKPOINT, &file_stem("training", &run.setup), run.id, |run| {
        let file = run.checkpoint_file()?;
        Ok(Contents::new(move |path| file.save(path)))
    })
}

/// Task of opening a checkpoint.
pub(super) fn open_task(shared: &Shared) -> FileTask {
    let setup = shared
        .run
        .as_ref()
        .map_or_else(|| shared.draft.into(), |run| run.setup.clone());
    FileTask {
        words: OPENED,
        suggestion: OPENED.file_name(&file_stem("training", &setup)),
        purpose: Purpose::Open,
    }
}

/// Returns all exports of the current training.
pub(super) fn train_exports<'a>(view: &'a TrainView, shared: &'a Shared) -> Vec<Export<'a>> {
    let shown = shared.shown_run().and_then(|run| Some((run, run.result.as_ref()?)));
    let shown = shown.ok_or_else(|| "Nothing is trained yet: press Train first.".to_owned());
    let run = shown.clone().map(|(run, _)| run);
    let stem = |what: &str| {
        run.as_ref()
            .map_or_else(|_| String::new(), |run| file_stem(what, &run.setup))
    };
    let mut exports = networks(view, &shown);
    let (name, what) = match shared.look.mode {
        _ if shared.source == SourceKind::Recording && !has_target_surface(shared) => ("Sample", "sample"),
        ViewMode::ThreeD => ("Surfaces", "surfaces"),
        ViewMode::Top => ("Surfaces", "surfaces-top"),
    };
    let surfaces = run.clone().map(|_| || upper_figure(view, shared));
    exports.extend(picture_exports(name, stem(what), surfaces));
    let chart = run.clone().and_then(|_| {
        let figure = Figure::from(chart(view, shared).ok_or("This chart has nothing to show yet.")?);
        Ok(move || figure.clone())
    });
    exports.extend(picture_exports("Chart", stem(view.tab.file_word()), chart));
    let errors = shown.clone().map(|(run, latest)| {
        let result = view.result(shared).unwrap_or(latest);
        move || error_table(&run.error_table(result))
    });
    let of_epoch = view.scrub.result().map(|past| format!("-epoch{}", past.epochs_run));
    let of_errors = stem("errors") + &of_epoch.unwrap_or_default();
    exports.push(error_table_export(of_errors, errors.clone()));
    exports.push(loss_export(stem("loss"), run.clone().map(|run| run.history.as_slice())));
    exports.extend(copy_exports("Error table", errors));
    let decoders = shown.map(|(run, _)| run).and_then(|run| {
        let reports = measured(view);
        if reports.is_empty() {
            return Err("No decoder is measured yet: unfold “More decoders”.".to_owned());
        }
        Ok(move || decoder_table(&run.problem, &reports, run.baselines.model_based.as_ref()))
    });
    exports.push(csv_export(
        "Decoder table",
        DECODERS,
        stem("decoders"),
        decoders.clone(),
    ));
    exports.extend(copy_exports("Decoder table", decoders));
    let standing = run.and_then(|run| match shared.phase {
        Phase::Paused | Phase::Calibrating | Phase::Ended(_) => Ok(run),
        Phase::Died => Err("The training was lost with its thread: train again.".to_owned()),
        _ => Err("A training under way cannot be saved: pause it first.".to_owned()),
    });
    exports.push(Export {
        group: ExportGroup::Training,
        name: "Checkpoint".to_owned(),
        form: "resumable".to_owned(),
        description: CHECKPOINT.description,
        ask: standing.map(|run| -> Ask<'a> { Box::new(|| Effect::ChooseFile(checkpoint_task(run))) }),
    });
    exports
}

/// Returns the figure above the charts: the surfaces, or all targets of a sample.
fn upper_figure(view: &TrainView, shared: &Shared) -> Figure {
    let surfaces = surface_figure(view, shared);
    match all_targets_figure(view, shared) {
        Some(targets) if surfaces.surfaces.is_empty() => targets.into(),
        _ => surfaces.into(),
    }
}

/// Returns the exports of the best network, and before them those of a past epoch while it is displayed.
fn networks<'a>(view: &'a TrainView, shown: &Result<(&'a RunView, &'a RunResult), String>) -> Vec<Export<'a>> {
    let source = shown
        .as_ref()
        .map(|(run, _)| NetworkSource::Training(run.id, Box::new(run.setup.clone())));
    let mut exports = network_exports("", &source.map_err(String::clone), move || measured(view));
    let Ok((run, latest)) = shown else { return exports };
    let in_group = |group: ExportGroup| {
        move |mut export: Export<'a>| {
            if export.group == ExportGroup::Network {
                export.group = group;
            }
            export
        }
    };
    exports = exports
        .into_iter()
        .map(in_group(ExportGroup::BestNetwork(latest.best_epoch)))
        .collect();
    if let Some(epoch) = view.scrub.result().map(|past| past.epochs_run) {
        let source = NetworkSource::Past(run.id, Box::new(run.setup.clone()), epoch, run.past.clone());
        // The decoders were measured together with the best network.
        let past = network_exports("", &Ok(source), Vec::new).into_iter();
        let past = past
            .map(in_group(ExportGroup::DisplayedNetwork(epoch)))
            .map(|export| Export {
                name: format!("{} of epoch {epoch}", export.name),
                ..export
            });
        exports.extend(past);
        // Each has its own part of the menu.
        exports.sort_by_key(|export| export.group);
    }
    exports
}

/// Reports of the decoders measured so far.
fn measured(view: &TrainView) -> Vec<DecoderReport> {
    let results = view.decoders.measured.iter().flatten();
    let reports = results.filter_map(|result| result.report.as_ref()?.as_ref().ok());
    reports.cloned().collect()
}

/// A figure of the paper that the window can show: its configuration, and how its results are displayed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PaperFigure {
    /// Surfaces of 10×10_5×30 from above.
    Four,
    /// Nodes of 10×6_3×18.
    Six,
    /// Surfaces of 10×6_3×18 in space.
    Seven,
    /// The same from above.
    Eight,
}

impl PaperFigure {
    /// In the paper's order.
    pub const ALL: [Self; 4] = [Self::Four, Self::Six, Self::Seven, Self::Eight];

    /// Returns its array and how it is displayed.
    pub fn name(self) -> &'static str {
        match self {
            Self::Four => "10×10, top view",
            Self::Six => "10×6, nodes",
            Self::Seven => "10×6, 3-D",
            Self::Eight => "10×6, top view",
        }
    }

    /// Returns a description of the figure in a sentence.
    pub fn description(self) -> &'static str {
        match self {
            Self::Four => {
                "Fig. 4: trains 10×10_5×30 with 12 hidden nodes and shows actual and decoupled surface from above. Unlike the \
                 paper's spline, ours includes a plane: level nodes give a level surface."
            }
            Self::Six => {
                "Fig. 6: trains 10×6_3×18 with 12 hidden nodes and shows every node: actual as squares, decoupled as \
                 discs."
            }
            Self::Seven => {
                "Fig. 7: trains 10×6_3×18 with 12 hidden nodes and shows actual and decoupled surface in space. Unlike the \
                 paper's spline, ours includes a plane: level nodes give a level surface."
            }
            Self::Eight => {
                "Fig. 8: trains 10×6_3×18 with 12 hidden nodes and shows actual and decoupled surface from above. Unlike the \
                 paper's spline, ours includes a plane: level nodes give a level surface."
            }
        }
    }

    /// Returns the settings of the training for the figure.
    pub fn settings(self) -> RunSettings {
        let scale = match self {
            Self::Four => "10×10_5×30",
            Self::Six | Self::Seven | Self::Eight => "10×6_3×18",
        };
        let scale = scale.parse().expect("the paper's arrays are possible");
        RunSettings::from(Simulation {
            sensor: SensorModel::new(scale),
            ..Simulation::default()
        })
    }

    /// Returns how its surfaces are viewed; `None` if it shows none.
    pub fn mode(self) -> Option<ViewMode> {
        match self {
            Self::Four | Self::Eight => Some(ViewMode::Top),
            Self::Seven => Some(ViewMode::ThreeD),
            Self::Six => None,
        }
    }

    /// Returns its chart; `None` if it shows none.
    pub fn tab(self) -> Option<BottomTab> {
        (self == Self::Six).then_some(BottomTab::Nodes)
    }
}
