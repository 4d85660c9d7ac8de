use eframe::egui::{Ui, WidgetInfo, accesskit::Role};

use super::draft::{Draft, file_name};
use crate::window::{
    shared::{Effect, FileTask, FileWords},
    widgets::{dim_ui, ghost_button},
};

pub(super) const POSITIONS: FileWords = FileWords {
    kind: "file of positions",
    description: "A table of text with the header target,x,y: the name of each target, and where it lies on the skin in \
                  millimetres.",
    extensions: &["csv", "txt", "tsv"],
};

/// The file of positions, if there is one.
pub(super) fn positions_summary(draft: &Draft) -> String {
    let positions = draft.plan.import.positions.as_ref();
    positions.map_or_else(|| "none".to_owned(), |path| file_name(path))
}

/// The choice of the file with the positions of targets.
pub(super) fn positions_ui(ui: &mut Ui, task: FileTask, effects: &mut Vec<Effect>) {
    dim_ui(
        ui,
        "Targets that are deformations or forces at places of the skin, such as taxels: with their positions the actual and \
         the decoded surface of each test sample are shown. The file has the header target,x,y, in millimetres.",
    );
    ui.horizontal(|ui| {
        let button = ui.add(ghost_button("Positions file…"));
        if button.on_hover_text(POSITIONS.description).clicked() {
            effects.push(Effect::ChooseFile(task.clone()));
        }
        let typed = ui.add(ghost_button("Type path…"));
        typed.widget_info(|| WidgetInfo::labeled(Role::Button, true, "Type the path of the positions"));
        if typed
            .on_hover_text("Type the path instead of choosing the file.")
            .clicked()
        {
            effects.push(Effect::TypePath(task));
        }
    });
}
