use super::{
    LiveView,
    cards::surface_figure,
    files::{save_recording, save_zero},
    readings_card::figure_of,
};
use crate::{
    app::shared::{Ask, Effect, Export, ExportGroup, FileTask, Shared, picture_exports},
    figure::Figure,
};

/// The pictures of the latest frame, the recording and the unloaded state.
pub fn live_exports<'a>(view: &'a LiveView, shared: &'a Shared) -> Vec<Export<'a>> {
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
