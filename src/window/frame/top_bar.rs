//! The top bar, and the widths of the columns below it.

use std::ops::RangeInclusive;

use eframe::egui::{
    Align, CursorIcon, Id, Label, Layout, Rect, RichText, Sense, Stroke, Ui, Vec2, WidgetInfo, accesskit::Role,
};

use super::remembered::Remembered;
use crate::window::{
    shared::{Action, Columns},
    theme::{Theme, semibold, space, type_size},
    widgets::{ghost_button, segmented_ui},
};

/// Width from which everything fits, in points.
const WIDE: f32 = 1280.0;

/// Width below which the names of the views are closer together.
const TIGHT: f32 = 1100.0;

/// Width below which the mark is left out.
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

/// Name, views, and the tools of the displayed view, which `tools_ui` lays out from right to left, before the tools of the
/// window itself.
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
        // In a narrow window, tools that are also in the list of actions are left out first.
        let (is_wide, is_narrow) = (width >= WIDE, width < NARROW);
        if !is_narrow {
            mark_ui(ui);
        }
        // The title of the window repeats the name.
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
    // Three wires crossed by three, with one node pressed: the sensor in miniature.
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

/// Widths of the column on the left at which its names do not touch their values.
const FORM_POINTS: RangeInclusive<f32> = space(62)..=space(110);

/// Default width of the column on the right.
const REPORT_POINTS: f32 = space(96);

/// Widths of the column on the right at which its table fits.
const REPORT_LIMITS_POINTS: RangeInclusive<f32> = space(82)..=space(140);

/// Minimum width of the middle, which wider columns must leave.
const MIN_MIDDLE_POINTS: f32 = space(176);

/// Returns the widths of the columns in this window: those chosen by the user, as far as the middle allows.
pub(super) fn widths_points(columns: &Columns, remembered: &Remembered, window: f32) -> [f32; 2] {
    let room = window - MIN_MIDDLE_POINTS;
    let for_report = if columns.has_report {
        *REPORT_LIMITS_POINTS.start()
    } else {
        0.0
    };
    let form = drawn(remembered.form_points, &FORM_POINTS, room - for_report).unwrap_or(columns.form_width);
    let report = drawn(remembered.report_points, &REPORT_LIMITS_POINTS, room - form).unwrap_or(REPORT_POINTS);
    [form, report]
}

fn drawn(width: Option<f32>, limits: &RangeInclusive<f32>, room: f32) -> Option<f32> {
    let (&min, &max) = (limits.start(), limits.end());
    Some(width?.clamp(min, room.clamp(min, max)))
}

/// The draggable edge of a column: `panel` is on the left or on the right of the window. A double click restores the
/// default width by clearing `width`.
pub(super) fn edge_ui(ui: &Ui, label: &str, panel: Rect, is_left: bool, width: &mut Option<f32>) {
    let edge = if is_left { panel.right() } else { panel.left() };
    // The scroll bar of the column on the left ends where this begins.
    let strip = Rect::from_x_y_ranges(edge - 2.0..=edge + 4.0, panel.y_range());
    let response = ui.interact(strip, Id::unique(label), Sense::CLICK | Sense::DRAG);
    response.widget_info(|| WidgetInfo::labeled(Role::Splitter, true, label));
    let response = response.on_hover_and_drag_cursor(CursorIcon::ResizeHorizontal);
    if response.hovered() || response.dragged() {
        let stroke = Stroke::new(2.0, Theme::of(ui).palette.accent);
        ui.painter().vline(edge, panel.y_range(), stroke);
    }
    if response.double_clicked() {
        *width = None;
    } else if response.dragged()
        && let Some(pointer) = response.interact_pointer_pos()
    {
        let wished = if is_left {
            pointer.x - panel.left()
        } else {
            panel.right() - pointer.x
        };
        *width = Some(wished.round());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn widths(form: Option<f32>, report: Option<f32>, window: f32) -> [f32; 2] {
        let columns = Columns {
            form_width: 272.0,
            has_report: true,
        };
        let remembered = Remembered {
            form_points: form,
            report_points: report,
            ..Remembered::default()
        };
        widths_points(&columns, &remembered, window)
    }

    #[test]
    fn columns_have_the_chosen_widths_within_limits_that_leave_room_for_the_middle() {
        assert_eq!(widths(None, None, 1440.0), [272.0, 384.0], "the usual widths");
        assert_eq!(widths(Some(300.0), Some(400.0), 1440.0), [300.0, 400.0]);
        for wish in [-1e30, 0.0, 1e4, f32::INFINITY] {
            for window in [960.0, 1400.0, 1440.0, 3000.0] {
                let [form, report] = widths(Some(wish), Some(wish), window);
                assert!(FORM_POINTS.contains(&form) && REPORT_LIMITS_POINTS.contains(&report));
                let is_least = (form, report) == (*FORM_POINTS.start(), *REPORT_LIMITS_POINTS.start());
                assert!(
                    window - form - report >= MIN_MIDDLE_POINTS || is_least,
                    "{form}, {report} of {window}"
                );
            }
        }
    }
}
