//! The table of an experiment: every column orders it, every row can be marked.

use std::cmp::Ordering;

use eframe::egui::{
    Align2, Color32, CursorIcon, FontId, Rect, Response, ScrollArea, Sense, Stroke, Ui, WidgetInfo, accesskit::Role,
    pos2, vec2,
};

use super::{ExperimentLook, Outcome, SortBy, open_cell::open_cell};
use crate::app::{
    shared::{Effect, Shared},
    theme::{Theme, semibold, space, type_size},
};

/// Lays out the table over the available space; it scrolls where it is larger.
pub fn table_ui(ui: &mut Ui, outcome: &Outcome, look: &mut ExperimentLook, shared: &Shared, effects: &mut Vec<Effect>) {
    let order = order(outcome, look.sort);
    let (places, total) = columns(ui, outcome);
    let row_height = space(6);
    ScrollArea::horizontal().id_salt("experiment table").show(ui, |ui| {
        ui.set_width(total);
        ui.spacing_mut().item_spacing.y = 0.0;
        heading_ui(ui, outcome, &mut look.sort, &places, total);
        let body = ScrollArea::vertical()
            .id_salt("experiment rows")
            .auto_shrink([false, true]);
        body.show_rows(ui, row_height, order.len(), |ui, range| {
            for &cell in &order[range] {
                let is_marked = look.marked == Some(cell);
                let row = row_ui(ui, outcome, cell, is_marked, &places, total);
                if row.clicked() {
                    look.marked = Some(cell);
                }
                if row.double_clicked() {
                    open_cell(shared, outcome, cell, effects);
                }
            }
        });
    });
}

/// The cells in the order of the table; those without the figure come last.
fn order(outcome: &Outcome, sort: SortBy) -> Vec<usize> {
    let mut order: Vec<usize> = (0..outcome.table.rows.len()).collect();
    if let Some(column) = sort.column {
        let value = |cell: usize| outcome.table.values[cell].get(column).copied().flatten();
        order.sort_by(|&one, &other| match (value(one), value(other)) {
            (Some(one), Some(other)) if sort.is_descending => other.total_cmp(&one),
            (Some(one), Some(other)) => one.total_cmp(&other),
            (one, other) => other.is_some().cmp(&one.is_some()).then(Ordering::Equal),
        });
    }
    order
}

/// The left and right end of each column, and the width of all.
fn columns(ui: &Ui, outcome: &Outcome) -> (Vec<[f32; 2]>, f32) {
    let width = |text: &str, font: FontId| {
        let galley = ui.painter().layout_no_wrap(text.to_owned(), font, Color32::WHITE);
        galley.size().x
    };
    let widths: Vec<f32> = outcome
        .table
        .headings
        .iter()
        .enumerate()
        .map(|(column, heading)| {
            let cells = outcome.table.rows.iter();
            // The longest text is the widest but for a point or two, which the gap takes.
            let longest = cells
                .map(|row| row[column].as_str())
                .max_by_key(|text| text.chars().count());
            let cell = width(longest.unwrap_or_default(), semibold(type_size().note));
            cell.max(width(heading, semibold(type_size().small)) + space(2))
        })
        .collect();
    let used: f32 = widths.iter().sum();
    let gap = ((ui.available_width() - used) / widths.len().max(1) as f32).clamp(space(2), space(8));
    let mut left = 0.0;
    let places = widths.iter().map(|width| {
        let right = left + width + gap;
        let place = [left, right];
        left = right;
        place
    });
    let places: Vec<_> = places.collect();
    (places, left + space(2))
}

fn heading_ui(ui: &mut Ui, outcome: &Outcome, sort: &mut SortBy, places: &[[f32; 2]], total: f32) {
    let palette = Theme::of(ui).palette;
    let axes = outcome.results.experiment.axes().count();
    let (line, _) = ui.allocate_exact_size(vec2(total, space(6)), Sense::hover());
    for (column, (heading, place)) in outcome.table.headings.iter().zip(places).enumerate() {
        let rect = cell_rect(line, *place);
        let response = ui.interact(rect, ui.scope_id().with(("heading", column)), Sense::click());
        let is_sorted = sort.column == Some(column);
        response.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("Order by {heading}")));
        let response = response
            .on_hover_cursor(CursorIcon::PointingHand)
            .on_hover_text("Order the table by this column");
        if response.clicked() {
            let is_descending = is_sorted && !sort.is_descending;
            *sort = SortBy {
                column: Some(column),
                is_descending,
            };
        }
        let colour = if is_sorted || response.hovered() {
            palette.text
        } else {
            palette.dim
        };
        let text = match (is_sorted, sort.is_descending) {
            (false, _) => (*heading).to_owned(),
            (true, false) => format!("{heading} ↑"),
            (true, true) => format!("{heading} ↓"),
        };
        let font = if is_sorted {
            semibold(type_size().small)
        } else {
            FontId::proportional(type_size().small)
        };
        cell_text(ui, rect, column < axes, text, font, colour);
    }
    ui.painter()
        .hline(line.x_range(), line.bottom(), Stroke::new(1.0, palette.line));
}

/// What is varied stands at the left of its column, figures at the right.
fn cell_text(ui: &Ui, rect: Rect, is_name: bool, text: String, font: FontId, colour: Color32) {
    let (place, anchor) = if is_name {
        (rect.left_center() + vec2(space(1), 0.0), Align2::LEFT_CENTER)
    } else {
        (rect.right_center(), Align2::RIGHT_CENTER)
    };
    ui.painter().text(place, anchor, text, font, colour);
}

fn cell_rect(line: Rect, [left, right]: [f32; 2]) -> Rect {
    Rect::from_min_max(
        pos2(line.left() + left, line.top()),
        pos2(line.left() + right, line.bottom()),
    )
}

fn row_ui(ui: &mut Ui, outcome: &Outcome, cell: usize, is_marked: bool, places: &[[f32; 2]], total: f32) -> Response {
    let palette = Theme::of(ui).palette;
    let (line, response) = ui.allocate_exact_size(vec2(total, space(6)), Sense::click());
    let texts = &outcome.table.rows[cell];
    let axes = outcome.results.experiment.axes().count();
    let name = texts[..axes].join(", ");
    response.widget_info(|| WidgetInfo::selected(Role::Row, true, is_marked, format!("Cell {name}")));
    let response = response.on_hover_cursor(CursorIcon::PointingHand);
    if is_marked {
        ui.painter().rect_filled(line, 3.0, palette.selected);
    } else if response.hovered() {
        ui.painter().rect_filled(line, 3.0, palette.raised);
    }
    let loses = loses_to_linear_map(outcome, cell);
    for (column, ((heading, text), place)) in outcome.table.headings.iter().zip(texts).zip(places).enumerate() {
        let rect = cell_rect(line, *place);
        let is_median = heading.starts_with("Z") && heading.ends_with("median");
        let colour = match *heading {
            _ if is_median => palette.accent,
            heading if heading.ends_with("publ.") => palette.dim,
            heading if heading.starts_with("linear") && loses => palette.warning,
            _ => palette.text,
        };
        let font = if is_median || column < axes {
            semibold(type_size().note)
        } else {
            FontId::proportional(type_size().note)
        };
        cell_text(ui, rect, column < axes, text.clone(), font, colour);
        if column >= axes {
            let figure = ui.interact(rect, ui.scope_id().with(("figure", cell, column)), Sense::hover());
            figure.widget_info(|| WidgetInfo::labeled(Role::Label, true, format!("{name}, {heading}: {text}")));
            if heading.starts_with("linear") && loses {
                figure.on_hover_text("The linear map does better here than the network");
            }
        }
    }
    ui.painter()
        .hline(line.x_range(), line.bottom(), Stroke::new(0.5, palette.line));
    response
}

fn loses_to_linear_map(outcome: &Outcome, cell: usize) -> bool {
    let summary = &outcome.summaries[cell];
    let both = summary.z_percent.median.zip(summary.linear_z_percent);
    both.is_some_and(|(network, linear)| network > linear)
}
