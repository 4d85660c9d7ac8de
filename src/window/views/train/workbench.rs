use eframe::egui::{Sense, Ui};

use super::{
    charts_card::{charts_card_ui, readings_of_view_ui},
    press::readings_head_ui,
    report::report_ui,
    state::TrainView,
    surfaces::surfaces_ui,
};
use crate::window::{
    shared::{Effect, Shared, SourceKind},
    theme::space,
    widgets::card_ui,
};

/// Position of the report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorkbenchLayout {
    /// In a column of its own, right of the workbench.
    ReportBeside,
    /// On a card below the surfaces, next to the charts: narrow windows leave the surfaces their width.
    ReportBelow,
}

impl WorkbenchLayout {
    /// That of a window this many points wide.
    pub fn of_width(width: f32) -> Self {
        /// A column next to the surfaces must leave them this window.
        const MIN_FOR_COLUMN: f32 = 1400.0;
        if width < MIN_FOR_COLUMN {
            Self::ReportBelow
        } else {
            Self::ReportBeside
        }
    }
}

/// The middle of the window: both surfaces above, the charts below, and next to them the readings of an array.
pub fn workbench_ui(ui: &mut Ui, view: &mut TrainView, shared: &Shared, effects: &mut Vec<Effect>) {
    let layout = WorkbenchLayout::of_width(ui.ctx().content_rect().width());
    let whole = ui.available_rect_before_wrap();
    let gap = space(2);
    let (share, least) = match layout {
        WorkbenchLayout::ReportBeside => (0.32, space(40)),
        WorkbenchLayout::ReportBelow => (0.42, space(54)),
    };
    let lower_height = (share * whole.height()).clamp(least, space(75));
    let (upper, lower) = whole.split_top_bottom_at_y(whole.bottom() - lower_height);
    surfaces_ui(ui, upper.with_max_y(upper.max.y - gap), view, shared, effects);
    let has_sensor = shared.source == SourceKind::Array;
    let (charts, has_readings) = match layout {
        WorkbenchLayout::ReportBeside if !has_sensor => (lower, false),
        WorkbenchLayout::ReportBeside => {
            let width = (0.4 * lower.width()).floor();
            let (charts, readings) = lower.split_left_right_at_x(lower.right() - width);
            card_ui(ui, readings, |ui| {
                readings_head_ui(ui, view.drops_percent());
                readings_of_view_ui(ui, view, shared);
            });
            (charts.with_max_x(charts.max.x - gap), false)
        }
        WorkbenchLayout::ReportBelow => {
            let width = (0.45 * lower.width()).clamp(space(82), space(96));
            let (charts, report) = lower.split_left_right_at_x(lower.right() - width);
            card_ui(ui, report, |ui| report_ui(ui, view, shared, effects));
            (charts.with_max_x(charts.max.x - gap), has_sensor)
        }
    };
    card_ui(ui, charts, |ui| {
        charts_card_ui(ui, view, shared, has_readings, effects);
    });
    ui.allocate_rect(whole, Sense::hover());
}
