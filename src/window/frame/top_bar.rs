use eframe::egui::{Align, Label, Layout, RichText, Sense, Stroke, Ui, Vec2, WidgetInfo, accesskit::Role};

use crate::window::{
    shared::Action,
    theme::{Theme, semibold, space, type_size},
    widgets::{ghost_button, segmented_ui},
};

/// Width from which on there is room for everything, in points.
const WIDE: f32 = 1280.0;

/// Width below which the names of the views stand closer.
const TIGHT: f32 = 1100.0;

/// Width below which every point counts.
const NARROW: f32 = 1000.0;

/// Names of the actions that change the theme.
pub(super) const LIGHT: &str = "Light theme";
pub(super) const DARK: &str = "Dark theme";

/// Click of the user in the top bar.
pub(super) enum Reach {
    /// The view in this place.
    View(usize),
    /// The action of this name.
    Action(String),
}

/// Name, views, and the tools of the displayed one, which `tools_ui` lays out from right to left, before what the window
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
        // Where there is little room, what the list of actions does too goes first.
        let (is_wide, is_narrow) = (width >= WIDE, width < NARROW);
        if !is_narrow {
            mark_ui(ui);
        }
        // The title of the window says it too.
        if is_wide {
            ui.add(Label::new(RichText::new("Decoupler").font(semibold(type_size().title))).selectable(false));
        }
        ui.add_space(space(2));
        let views_ui = |ui: &mut Ui| {
            if width < TIGHT {
                ui.spacing_mut().button_padding.x = space(1);
            }
            segmented_ui(ui, "View", views, shown, false)
        };
        let picked = ui.scope(views_ui).inner.map(Reach::View);
        let reached = ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let mut reached = None;
            let mut button_ui = |ui: &mut Ui, name: &str, text: &str| {
                reached = reached.take().or(action_button_ui(ui, actions, name, text));
            };
            button_ui(ui, "Keys", "?");
            if is_wide {
                let (text, name) = if Theme::of(ui).is_dark {
                    ("Light", LIGHT)
                } else {
                    ("Dark", DARK)
                };
                button_ui(ui, name, text);
            }
            button_ui(ui, "Search actions", if is_wide { "Search" } else { "…" });
            if is_wide {
                button_ui(ui, "Redo change of settings", "↻");
                button_ui(ui, "Undo change of settings", "↺");
                ui.add_space(space(2));
            }
            tools_ui(ui);
            reached
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
