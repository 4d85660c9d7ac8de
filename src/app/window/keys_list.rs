use eframe::egui::{Frame, Grid, Id, Margin, Modal, RichText, ScrollArea, Ui};

use crate::app::{
    shared::Action,
    theme::{semibold, space, type_size},
    widgets::dim_ui,
};

/// Keys that the part of the window in focus hears.
const IN_FOCUS: [(&str, &str); 8] = [
    ("Turn a surface", "Arrows"),
    ("Zoom a surface", "+ and −"),
    ("Usual camera", "Home"),
    ("Set a field to its usual value", "Double-click"),
    ("Copy a value, a table or a picture", "Right click"),
    ("Next control", "Tab"),
    ("Previous control", "Shift+Tab"),
    ("Close what lies above the window", "Escape"),
];

/// Shows all keys over the window. Returns true if the user wants it closed.
pub(super) fn keys_list_ui(ui: &Ui, actions: &[Action]) -> bool {
    let frame = Frame::popup(ui.style()).inner_margin(Margin::same(16));
    let modal = Modal::new(Id::unique("keys")).frame(frame).show(ui.ctx(), |ui| {
        ui.set_width(space(96));
        ui.label(RichText::new("Keys").font(semibold(type_size().title)));
        ui.add_space(space(2));
        ScrollArea::vertical().max_height(space(120)).show(ui, |ui| {
            let columns = Grid::new("keys").num_columns(2).min_col_width(space(40));
            columns.spacing([space(4), space(2)]).show(ui, |ui| {
                for action in actions {
                    let Some(keys) = action.keys else { continue };
                    ui.label(&action.name);
                    dim_ui(ui, &ui.ctx().format_shortcut(&keys));
                    ui.end_row();
                }
                for (name, keys) in IN_FOCUS {
                    ui.label(name);
                    dim_ui(ui, keys);
                    ui.end_row();
                }
            });
        });
    });
    modal.should_close()
}
