use eframe::egui::Ui;
use serde_json::Value;

use super::SweepFolder;
use crate::window::{
    shared::{Contents, Effect, FileTask, FileWords},
    theme::space,
    widgets::{dim_ui, ghost_button, section_heading_ui},
};
use decoupler_files::export::atomic_write;

/// The specification of a sweep.
const SPECIFICATION: FileWords = FileWords {
    kind: "specification",
    description: "This sweep for the terminal, on one machine or many: decoupler sweep --spec FILE --out FOLDER trains it, \
                  and --engine writes the job script of a cluster.",
    extensions: &["json"],
};

/// The file of a specification.
fn specification_task(specification: Value) -> FileTask {
    let contents = Contents::new(move |path| {
        atomic_write(path, |writer| {
            serde_json::to_writer_pretty(&mut *writer, &specification)?;
            writeln!(writer)
        })
    });
    FileTask::save(SPECIFICATION, "sweep", contents)
}

/// Sweeps on other machines: saves the sweep of the form as a specification, opens a folder that is being filled.
pub(in crate::window::views::experiments) fn folder_form_ui(
    ui: &mut Ui,
    folder: &SweepFolder,
    specification: &Result<Value, String>,
    effects: &mut Vec<Effect>,
) {
    section_heading_ui(ui, "On many machines");
    dim_ui(
        ui,
        "The command decoupler sweep trains a specification on any number of machines and fills a folder, which is shown here.",
    );
    let refusal = specification.as_ref().err().map_or("", String::as_str);
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.y = space(1);
        let save = ui.add_enabled(refusal.is_empty(), ghost_button("Save specification…"));
        let save = save
            .on_hover_text(SPECIFICATION.description)
            .on_disabled_hover_text(refusal);
        if let (true, Ok(specification)) = (save.clicked(), specification) {
            effects.push(Effect::ChooseFile(specification_task(specification.clone())));
        }
        let open = ui.add(ghost_button("Open sweep folder…"));
        let open = open.on_hover_text("Shows the trials of a folder that decoupler sweep fills, as they finish.");
        if open.clicked() {
            effects.push(Effect::ChooseFile(folder.choose()));
        }
    });
}
