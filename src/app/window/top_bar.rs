use eframe::egui::{Align, Label, Layout, RichText, Sense, Stroke, Ui, Vec2, WidgetInfo, accesskit::Role};

use crate::app::{
    shared::Action,
    theme::{Theme, semibold, space, type_size},
    widgets::{ghost_button, segmented_ui},
};

/// What the user reaches for in the top bar.
pub(super) enum Reach {
    /// The view in this place.
    View(usize),
    /// The action of this name.
    Action(String),
}

/// Name, views, and the tools of the one on show, which `tools_ui` lays out from right to left, before what the window
/// itself does.
pub(super) fn top_bar_ui(
    ui: &mut Ui,
    views: &[(usize, &str)],
    shown: usize,
    actions: &[Action],
    tools_ui: impl FnOnce(&mut Ui),
) -> Option<Reach> {
    ui.horizontal_centered(|ui| {
        ui.add_space(space(1));
        let width = ui.available_width();
        mark_ui(ui);
        // The title of the window says it too: where there is little room the buttons go first.
        if width > 2.0 * space(150) {
            ui.add(Label::new(RichText::new("Decoupler").font(semibold(type_size().title))).selectable(false));
        }
        ui.add_space(space(4));
        let picked = segmented_ui(ui, "View", views, shown, false).map(Reach::View);
        let reached = ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            ui.add_space(space(1));
            let keys = action_button_ui(ui, actions, "Keys", "?");
            let theme = theme_ui(ui);
            let search = if width > 2.0 * space(165) { "Search" } else { "…" };
            let search = action_button_ui(ui, actions, "Search actions", search);
            let redo = action_button_ui(ui, actions, "Redo change of settings", "↻");
            let undo = action_button_ui(ui, actions, "Undo change of settings", "↺");
            ui.add_space(space(2));
            tools_ui(ui);
            keys.or(theme).or(search).or(redo).or(undo)
        });
        picked.or(reached.inner)
    })
    .inner
}

/// A small button for an action of the window, with its name and its keys under the pointer.
fn action_button_ui(ui: &mut Ui, actions: &[Action], name: &str, text: &str) -> Option<Reach> {
    let action = actions.iter().find(|action| action.name == name)?;
    let keys = action.keys.map(|keys| ui.ctx().format_shortcut(&keys));
    let hint = keys.map_or_else(|| format!("{name}."), |keys| format!("{name} ({keys})."));
    let button = ui.add_enabled(action.is_possible, ghost_button(text));
    let is_possible = action.is_possible;
    button.widget_info(|| WidgetInfo::labeled(Role::Button, is_possible, name));
    let button = button.on_hover_text(&hint).on_disabled_hover_text(&hint);
    button.clicked().then(|| Reach::Action(name.to_owned()))
}

fn mark_ui(ui: &mut Ui) {
    let theme = Theme::of(ui);
    let (rect, _) = ui.allocate_exact_size(Vec2::splat(space(5)), Sense::hover());
    // Three wires crossed by three, with one node pressed: the sensor in small.
    let painter = ui.painter();
    let stroke = Stroke::new(1.2, theme.palette.dim);
    let inner = rect.shrink(space(1) - 1.0);
    for step in 0..3 {
        let share = 0.5 * step as f32;
        painter.hline(inner.x_range(), inner.top() + share * inner.height(), stroke);
        painter.vline(inner.left() + share * inner.width(), inner.y_range(), stroke);
    }
    painter.circle_filled(inner.center(), 3.5, theme.palette.accent);
}

fn theme_ui(ui: &mut Ui) -> Option<Reach> {
    let (text, label, action) = if Theme::of(ui).is_dark {
        ("Light", "Switch to the light theme", "Light theme")
    } else {
        ("Dark", "Switch to the dark theme", "Dark theme")
    };
    let button = ui.add(ghost_button(text)).on_hover_text(label);
    button.clicked().then(|| Reach::Action(action.to_owned()))
}
