//! The top bar, and the widths of the columns below it.

use std::ops::RangeInclusive;

use eframe::egui::{
    Align, CursorIcon, Id, Label, Layout, Rect, RichText, Sense, Stroke, Ui, Vec2, WidgetInfo, accesskit::Role,
};

use super::remembered::Remembered;
use crate::window::{
    shared::{Columns, Command, Offer, ViewKind},
    theme::{Theme, semibold, space, type_size},
    widgets::{ghost_button, segmented_ui},
};

/// Width from which everything fits, in points.
const WIDE: f32 = 1280.0;

/// Width below which the names of the views are closer together.
const TIGHT: f32 = 1100.0;

/// Width below which the mark is left out.
const NARROW: f32 = 1000.0;

/// Name, views, and the tools of the displayed view, which `tools_ui` lays out from right to left, before the tools of the
/// window itself. Returns the command that the user clicked.
pub(super) fn top_bar_ui(
    ui: &mut Ui,
    shown: ViewKind,
    offers: &[Offer],
    tools_ui: impl FnOnce(&mut Ui),
) -> Option<Command> {
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
            let views = ViewKind::ALL.map(|view| (view, view.name()));
            segmented_ui(ui, "View", &views, shown, false)
        };
        let picked = ui.scope(views_ui).inner.map(Command::Show);
        let reached = ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let mut reached = None;
            let mut button_ui = |ui: &mut Ui, command: Command, text: &str| {
                reached = reached.take().or(command_button_ui(ui, offers, command, text));
            };
            button_ui(ui, Command::Keys, "?");
            if is_wide && Theme::of(ui).is_dark {
                button_ui(ui, Command::Light, "Light");
            } else if is_wide {
                button_ui(ui, Command::Dark, "Dark");
            }
            button_ui(ui, Command::Search, if is_wide { "Search" } else { "…" });
            if is_wide {
                button_ui(ui, Command::Redo, "↻");
                button_ui(ui, Command::Undo, "↺");
                ui.add_space(space(2));
            }
            tools_ui(ui);
            reached
        });
        picked.or(reached.inner)
    })
    .inner
}

/// A small button for a command of the window, with its name and its keys under the pointer.
fn command_button_ui(ui: &mut Ui, offers: &[Offer], command: Command, text: &str) -> Option<Command> {
    let is_possible = offers.iter().any(|offer| offer.command == command && offer.is_possible);
    let about = command.about();
    let hint = match about.keys {
        Some(keys) => format!("{} ({}).", about.name, ui.ctx().format_shortcut(&keys)),
        None => format!("{}.", about.name),
    };
    let button = ui.add_enabled(is_possible, ghost_button(text));
    button.widget_info(|| WidgetInfo::labeled(Role::Button, is_possible, &about.name));
    let button = button.on_hover_text(&hint).on_disabled_hover_text(&hint);
    button.clicked().then_some(command)
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
