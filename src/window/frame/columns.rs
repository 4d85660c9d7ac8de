use std::ops::RangeInclusive;

use eframe::egui::{CursorIcon, Id, Rect, Sense, Stroke, Ui, WidgetInfo, accesskit::Role};

use super::remembered::Remembered;
use crate::window::{
    shared::Columns,
    theme::{Theme, space},
};

/// Widths of the column on the left between which its names stand clear of their values.
const FORM_POINTS: RangeInclusive<f32> = space(62)..=space(110);

/// Width of the column on the right, unless the user has drawn it wider or narrower.
const REPORT_POINTS: f32 = space(96);

/// Widths of the column on the right at which its table is whole.
const REPORT_LIMITS_POINTS: RangeInclusive<f32> = space(82)..=space(140);

/// Least width of the middle, which columns drawn wider leave to it.
const MIN_MIDDLE_POINTS: f32 = space(176);

/// Widths of the columns in this window: those that the user has drawn, as far as the middle allows.
pub(super) fn widths_points(columns: &Columns, remembered: &Remembered, window: f32) -> [f32; 2] {
    let room = window - MIN_MIDDLE_POINTS;
    let beside = if columns.has_report {
        *REPORT_LIMITS_POINTS.start()
    } else {
        0.0
    };
    let form = drawn(remembered.form_points, &FORM_POINTS, room - beside).unwrap_or(columns.form_width);
    let report = drawn(remembered.report_points, &REPORT_LIMITS_POINTS, room - form).unwrap_or(REPORT_POINTS);
    [form, report]
}

fn drawn(width: Option<f32>, limits: &RangeInclusive<f32>, room: f32) -> Option<f32> {
    let (&least, &most) = (limits.start(), limits.end());
    Some(width?.clamp(least, room.clamp(least, most)))
}

/// The edge of a column, to be dragged: `panel` is at the left of the window or at the right. A double click gives
/// the column its usual width, which is none of its own.
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
    fn columns_are_as_wide_as_they_were_drawn_within_limits_that_leave_the_middle_its_own() {
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
