use eframe::egui::{Align2, FontId, Id, Rect, Sense, Stroke, Ui, WidgetInfo, accesskit::Role, pos2};
use egui_plot::{PlotPoint, PlotResponse};

use crate::{
    app::theme::{Theme, space, type_size},
    training::Stage,
};

/// Marks in a chart over epochs where the method changed: a thin upright line with the short name of the next method.
pub fn stage_marks_ui<R>(ui: &Ui, plot: &PlotResponse<R>, stages: &[Stage]) {
    let palette = Theme::of(ui).palette;
    let frame = *plot.transform.frame();
    let font = FontId::proportional(type_size().small);
    for stage in stages.iter().skip(1) {
        // The last weights of the method before are those the next one goes on from.
        let changed = stage.first_epoch.saturating_sub(1);
        let x = plot
            .transform
            .position_from_point(&PlotPoint::new(changed as f64, 0.0))
            .x;
        if !frame.x_range().contains(x) {
            continue;
        }
        let painter = ui.painter().with_clip_rect(frame);
        painter.vline(x, frame.y_range(), Stroke::new(1.0, palette.dim));
        // On the other side where there is no room on the right.
        let is_near_edge = frame.right() - x < space(12);
        let (align, offset) = if is_near_edge {
            (Align2::RIGHT_TOP, -space(1))
        } else {
            (Align2::LEFT_TOP, space(1))
        };
        let place = pos2(x + offset, frame.top() + 1.0);
        let name = painter.text(place, align, stage.method.short_name(), font.clone(), palette.text);
        let id = Id::unique(("stage", plot.response.id, stage.first_epoch));
        let response = ui.interact(
            Rect::from_x_y_ranges(name.x_range(), name.y_range()),
            id,
            Sense::hover(),
        );
        let label = format!("{} from epoch {changed}", stage.method.short_name());
        response.widget_info(|| WidgetInfo::labeled(Role::Label, true, &label));
        response.on_hover_text(format!("{} goes on from epoch {changed}", stage.method.name()));
    }
}

/// What [`crate::training::EpochRecord::parameter`] is through all methods of a training.
pub fn parameter_name(stages: &[Stage]) -> &'static str {
    let mut names = stages.iter().map(|stage| stage.method.parameter_name());
    let first = names.next().unwrap_or("parameter");
    if names.all(|name| name == first) {
        first
    } else {
        "rate or damping"
    }
}
