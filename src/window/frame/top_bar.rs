use eframe::egui::{Id, Label, RichText, Ui, WidgetInfo, accesskit::Role};

use crate::window::{
    shared::{Command, Offer, ViewKind},
    theme::{semibold, space, type_size},
    widgets::{ghost_button, segmented_ui},
};

/// Width from which everything fits, in points.
const WIDE: f32 = 1280.0;

/// Width below which the names of the views are closer together.
const TIGHT: f32 = 1100.0;

/// Width below which the column on the left is hidden at first, and only what has no keys is left.
pub(super) const SMALL: f32 = 800.0;

/// Name, views, and at the right end the tools of the displayed view, before those of the window itself. Returns the command that the user clicked.
pub(super) fn top_bar_ui(
    ui: &mut Ui,
    shown: ViewKind,
    offers: &[Offer],
    tools_ui: impl FnOnce(&mut Ui),
) -> Option<Command> {
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
            segmented_ui(ui, "View", &views, shown, false)
        };
        let form = (width < SMALL).then(|| command_button_ui(ui, offers, Command::Form, "»"));
        let picked = ui.scope(views_ui).inner.map(Command::Show).or(form.flatten());
        // They keep the order of reading, which the Tab key follows; their width is that of the frame before.
        let id = Id::unique("width of the tools");
        let before = ui.data(|data| data.get_temp(id)).unwrap_or(0.0);
        ui.add_space((ui.available_width() - before).max(0.0));
        let reached = ui.horizontal(|ui| {
            ui.set_height(space(7));
            let mut reached = None;
            let mut button_ui = |ui: &mut Ui, command: Command, text: &str| {
                reached = reached.take().or(command_button_ui(ui, offers, command, text));
            };
            tools_ui(ui);
            if is_wide {
                ui.add_space(space(2));
            }
            button_ui(ui, Command::Search, if is_wide { "Search" } else { "…" });
            if width >= SMALL {
                button_ui(ui, Command::Keys, "?");
            }
            reached
        });
        let now = reached.response.rect.width();
        if (now - before).abs() > 0.5 {
            ui.data_mut(|data| data.insert_temp(id, now));
            ui.ctx().request_discard("other tools");
        }
        picked.or(reached.inner)
    })
    .inner
}

/// A small button for a command of the window, with its name and its keys under the pointer.
fn command_button_ui(ui: &mut Ui, offers: &[Offer], command: Command, text: &str) -> Option<Command> {
    let is_possible = offers.iter().any(|offer| offer.command == command && offer.is_possible);
    let about = command.about();
    let hint = about.tooltip(ui.ctx());
    let button = ui.add_enabled(is_possible, ghost_button(text));
    button.widget_info(|| WidgetInfo::labeled(Role::Button, is_possible, &about.name));
    let button = button.on_hover_text(&hint).on_disabled_hover_text(&hint);
    button.clicked().then_some(command)
}
