use eframe::egui::{Id, Label, RichText, Ui};

use crate::window::{
    shared::{Command, Effect, Shared, ViewKind, command_button_ui},
    theme::{semibold, space, type_size},
    widgets::{ghost_button, segmented_ui},
};

/// Width from which everything fits, in points.
const WIDE: f32 = 1280.0;

/// Width below which the names of the views are closer together.
const TIGHT: f32 = 1100.0;

/// Width below which the column on the left is hidden at first, and only what has no keys is left.
pub(super) const SMALL: f32 = 800.0;

/// Name, views, and at the right end the tools of the displayed view, before those of the window itself.
pub(super) fn top_bar_ui(
    ui: &mut Ui,
    shared: &Shared,
    effects: &mut Vec<Effect>,
    tools_ui: impl FnOnce(&mut Ui, &mut Vec<Effect>),
) {
    let button_ui = |ui: &mut Ui, command: Command, text: &str, effects: &mut Vec<Effect>| {
        let name = command.about().name;
        command_button_ui(ui, shared, command, ghost_button(text), Some(&name), effects);
    };
    ui.horizontal_centered(|ui| {
        ui.add_space(space(1));
        let width = ui.available_width();
        // In a narrow window, tools that are also in the list of actions are left out first. The title of the window repeats
        // the name.
        let is_wide = width >= WIDE;
        if is_wide {
            ui.add(Label::new(RichText::new("Decoupler").font(semibold(type_size().title))).selectable(false));
        }
        ui.add_space(space(2));
        let views_ui = |ui: &mut Ui| {
            if width < TIGHT {
                ui.spacing_mut().button_padding.x = space(1);
            }
            let views = ViewKind::ALL.map(|view| (view, view.name()));
            segmented_ui(ui, "View", &views, shared.shown, false)
        };
        if shared.obstacle(&Command::Form).is_none() {
            button_ui(ui, Command::Form, "»", effects);
        }
        let picked = ui.scope(views_ui).inner;
        effects.extend(picked.map(|view| Effect::Do(Command::Show(view))));
        // They keep the order of reading, which the Tab key follows; their width is that of the frame before.
        let id = Id::unique("width of the tools");
        let before = ui.data(|data| data.get_temp(id)).unwrap_or(0.0);
        ui.add_space((ui.available_width() - before).max(0.0));
        let tools = ui.horizontal(|ui| {
            ui.set_height(space(7));
            tools_ui(ui, effects);
            if is_wide {
                ui.add_space(space(2));
            }
            button_ui(ui, Command::Search, if is_wide { "Search" } else { "…" }, effects);
            if width >= SMALL {
                button_ui(ui, Command::Keys, "?", effects);
            }
        });
        let now = tools.response.rect.width();
        if (now - before).abs() > 0.5 {
            ui.data_mut(|data| data.insert_temp(id, now));
            ui.ctx().request_discard("other tools");
        }
    });
}
