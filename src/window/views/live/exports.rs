use std::sync::Arc;

use super::{
    LiveView,
    cards::surface_figure,
    engine::LiveTargets,
    files::{save_recording, save_zero},
    readings_card::figure_of,
    targets_card,
};
use crate::window::shared::{
    Ask, Effect, Export, ExportGroup, FileTask, FileWords, Shared, csv_export, picture_exports,
};
use decoupler_core::evaluation::Channel;
use decoupler_files::{
    export::{Cell, Table, TableColumn},
    figure::Figure,
};

/// The pictures of the latest frame, the recording and the unloaded state.
pub fn live_exports<'a>(view: &'a LiveView, shared: &'a Shared) -> Vec<Export<'a>> {
    if let Some(targets) = &view.shown.targets {
        return target_exports(targets, shared);
    }
    let frame = view.shown.frame.as_ref();
    let frame = frame.ok_or_else(|| "There is no frame yet: start a source.".to_owned());
    let surfaces = frame
        .clone()
        .map(|frame| || Figure::from(surface_figure(frame, None, shared.look)));
    let readings = frame
        .map(|frame| || Figure::from(figure_of(frame, view.drops.largest_percent()).coloured(shared.look.colours)));
    let recording = view.recorded.as_ref().map(save_recording);
    let zero = view.zero.as_ref().map(save_zero);
    let files = [
        file_export(
            "Recording",
            "CSV",
            recording,
            "Nothing is recorded: press Record while a source runs.",
        ),
        file_export(
            "Unloaded state",
            "JSON",
            zero,
            "There is none: press Re-zero while a source runs.",
        ),
    ];
    picture_exports("Surface", "live-surface".to_owned(), surfaces)
        .chain(picture_exports("Readings", "live-readings".to_owned(), readings))
        .chain(files)
        .collect()
}

const VALUES: FileWords = FileWords {
    kind: "decoded values",
    description: "The displayed decoded values with their times, in full precision, as CSV.",
    extensions: &["csv"],
};

/// The displayed values of a network of a recording.
fn target_exports<'a>(targets: &'a LiveTargets, shared: &'a Shared) -> Vec<Export<'a>> {
    let chart = Ok(move || Figure::from(targets_card::chart(targets)));
    let mut exports: Vec<Export<'a>> = picture_exports("Decoded values", "live-values".to_owned(), chart).collect();
    if let Some(figure) = targets_card::surface_figure(targets, None, shared.look) {
        let surface = Ok(move || Figure::from(figure.clone()));
        exports.extend(picture_exports("Surface", "live-surface".to_owned(), surface));
    }
    let values = Ok(move || values_table(targets));
    exports.push(csv_export("Decoded values", VALUES, "live-values".to_owned(), values));
    exports
}

fn values_table(targets: &LiveTargets) -> Table {
    let names = targets.problem.targets.iter().map(Channel::title);
    let row = |(time_s, values): &(f64, Arc<[f64]>)| {
        let values = std::iter::once(time_s).chain(values.iter());
        values.map(|&value| Cell::from(value)).collect()
    };
    Table {
        columns: std::iter::once("time_s".to_owned())
            .chain(names)
            .map(TableColumn::field)
            .collect(),
        rows: targets.history.iter().map(row).collect(),
    }
}

fn file_export(name: &str, form: &str, task: Option<FileTask>, reason: &str) -> Export<'static> {
    Export {
        group: ExportGroup::Tables,
        name: name.to_owned(),
        form: form.to_owned(),
        description: task.as_ref().map_or("", |task| task.words.description),
        ask: task
            .map(|task| -> Ask<'static> { Box::new(move || Effect::ChooseFile(task)) })
            .ok_or_else(|| reason.to_owned()),
    }
}
