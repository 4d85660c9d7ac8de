//! The points of a level of noise, fastest first.

use eframe::egui::{
    Align2, Color32, CursorIcon, FontId, Rect, ScrollArea, Sense, Stroke, Ui, WidgetInfo, accesskit::Role, pos2, vec2,
};

use super::{
    TradeAction,
    chart::colour,
    names::{frame_time, point_name, training_time},
};
use crate::{
    app::{
        Action,
        state::State,
        theme::{Theme, semibold, space, type_size},
    },
    evaluation::{TradeCost, TradeLevel, TradePoint},
    export::format_number,
};

const HEADINGS: [&str; 4] = ["Z %", "× limit", "a frame", "training"];
const FIGURE_WIDTH: f32 = 74.0;

fn figures(point: &TradePoint) -> [String; 4] {
    [
        format_number(point.report.errors.z_percent),
        format_number(point.to_reference()),
        frame_time(point.report.frame_us),
        training_time(point.training_seconds),
    ]
}

/// Lays out the table over the available space.
pub fn table_ui(ui: &mut Ui, state: &State, level: &TradeLevel) -> Vec<Action> {
    let mut actions = Vec::new();
    let palette = Theme::of(ui).palette;
    let fronts = TradeCost::ALL.map(|cost| level.front(cost));
    let mut order: Vec<usize> = (0..level.points.len()).collect();
    order.sort_by(|&a, &b| {
        level.points[a]
            .report
            .frame_us
            .total_cmp(&level.points[b].report.frame_us)
    });
    ui.spacing_mut().item_spacing.y = 0.0;
    // The strip of the scroll bar stays free.
    let width = ui.available_width() - space(3);
    let small = FontId::proportional(type_size().small);
    let (line, _) = ui.allocate_exact_size(vec2(width, space(5)), Sense::hover());
    for (column, heading) in HEADINGS.into_iter().enumerate() {
        let at = figure_place(line, column);
        ui.painter()
            .text(at, Align2::RIGHT_CENTER, heading, small.clone(), palette.dim);
    }
    ui.painter()
        .hline(line.x_range(), line.bottom(), Stroke::new(1.0, palette.line));
    let body = ScrollArea::vertical()
        .id_salt("trade table")
        .auto_shrink([false, false]);
    body.show_rows(ui, space(6), order.len(), |ui, range| {
        for &number in &order[range] {
            let on_fronts = [fronts[0][number], fronts[1][number]];
            if row_ui(ui, state, (number, &level.points[number]), on_fronts, width) {
                actions.push(TradeAction::Mark(Some(number)).into());
            }
        }
    });
    actions
}

/// The right end of a figure.
fn figure_place(line: Rect, column: usize) -> eframe::egui::Pos2 {
    let from_right = (HEADINGS.len() - 1 - column) as f32 * FIGURE_WIDTH;
    pos2(line.right() - from_right, line.center().y)
}

/// Whether the row was clicked.
fn row_ui(ui: &mut Ui, state: &State, (number, point): (usize, &TradePoint), on_fronts: [bool; 2], width: f32) -> bool {
    let palette = Theme::of(ui).palette;
    let (line, response) = ui.allocate_exact_size(vec2(width, space(6)), Sense::click());
    let (name, figures) = (point_name(point), figures(point));
    let is_marked = state.trade.marked == Some(number);
    response.widget_info(|| {
        let label = format!("{name}: {}", figures.join(", "));
        WidgetInfo::selected(Role::Row, true, is_marked, label)
    });
    if is_marked {
        ui.painter().rect_filled(line, 3.0, palette.selected);
    } else if response.hovered() {
        ui.painter().rect_filled(line, 3.0, palette.raised);
    }
    let dot = pos2(line.left() + space(2), line.center().y);
    ui.painter()
        .circle_filled(dot, 3.0, colour(point.report.kind, &palette));
    let is_chosen = on_fronts.contains(&true);
    let font = |is_strong: bool| {
        if is_strong {
            semibold(type_size().note)
        } else {
            FontId::proportional(type_size().note)
        }
    };
    let text = if is_chosen { palette.text } else { palette.dim };
    let names = line.with_max_x(figure_place(line, 0).x - FIGURE_WIDTH + space(6));
    let at = pos2(line.left() + space(4), line.center().y);
    ui.painter_at(names)
        .text(at, Align2::LEFT_CENTER, &name, font(is_chosen), text);
    for (column, figure) in figures.iter().enumerate() {
        // A cost is strong where nothing else costs as little for as small an error.
        let is_strong = (column == 2 && on_fronts[0]) || (column == 3 && on_fronts[1]);
        let colour: Color32 = if is_strong { palette.accent } else { text };
        let at = figure_place(line, column);
        ui.painter()
            .text(at, Align2::RIGHT_CENTER, figure, font(is_strong), colour);
    }
    ui.painter()
        .hline(line.x_range(), line.bottom(), Stroke::new(0.5, palette.line));
    let response = response.on_hover_cursor(CursorIcon::PointingHand);
    let response = response.on_hover_text(
        "Click to mark it in the charts. Where a time is blue, no other point has as small an error in as little time.",
    );
    response.clicked()
}
