//! A small table of numbers: names on the left, columns as wide as their widest cell, digits aligned on the right.

use eframe::egui::{
    Align, Color32, FontId, Label, Layout, Rect, RichText, Sense, Shape, Stroke, Ui, UiBuilder, Vec2, WidgetInfo,
    accesskit::Role, pos2, vec2,
};

use super::{fields::capitalised, value_under::value_under};
use crate::app::theme::{Theme, semibold, space, type_size};

/// A heading and what it means.
pub struct Column {
    pub heading: &'static str,
    pub meaning: &'static str,
}

/// A named row with one cell for each column.
pub struct Row {
    pub name: &'static str,
    /// Meaning of the column or row, shown under the pointer; empty for none.
    pub meaning: &'static str,
    pub cells: Vec<String>,
    pub colour: Color32,
    pub is_strong: bool,
    /// Meaning of a warning mark behind the name; empty for none.
    pub mark: &'static str,
}

/// Lays out the table over the available width, in smaller type where that is narrow.
pub fn table_ui(ui: &mut Ui, columns: &[Column], rows: &[Row]) {
    let widths = TableWidths::fitting(ui, columns, &Vec::from_iter(rows));
    captioned_table_ui(ui, "", columns, rows, &widths);
}

/// Type size and widths of a table, or of several below each other.
pub struct TableWidths {
    size: f32,
    names: f32,
    columns: Vec<f32>,
}

/// As [`table_ui`], for one of several tables that differ by `caption`: assistive technology reads it with every figure.
/// With the same `widths` their columns are aligned.
pub fn captioned_table_ui(ui: &mut Ui, caption: &str, columns: &[Column], rows: &[Row], widths: &TableWidths) {
    let palette = Theme::of(ui).palette;
    let whole = ui.available_width();
    let row_height = space(6);
    let (size, names, widths) = (widths.size, widths.names, &widths.columns);
    // What is left over is shared among the gaps before the columns.
    let gap = ((whole - names - widths.iter().sum::<f32>()) / columns.len() as f32).max(space(1));
    let line = |ui: &mut Ui, cells_ui: &mut dyn FnMut(&mut Ui, usize, Rect), is_last: bool| {
        let (rect, _) = ui.allocate_exact_size(Vec2::new(whole, row_height), Sense::hover());
        cells_ui(ui, 0, rect.with_max_x(rect.left() + names + gap));
        let mut right = rect.left() + names;
        for (at, width) in widths.iter().enumerate() {
            right += gap + width;
            let cell = Rect::from_min_max(pos2(right - width - gap, rect.top()), pos2(right, rect.bottom()));
            cells_ui(ui, at + 1, cell);
        }
        if !is_last {
            ui.painter()
                .hline(rect.x_range(), rect.bottom(), Stroke::new(1.0, palette.line));
        }
    };
    ui.spacing_mut().item_spacing.y = 0.0;
    line(
        ui,
        &mut |ui, at, rect| {
            if let Some(column) = at.checked_sub(1).map(|at| &columns[at]) {
                let text = RichText::new(column.heading).size(type_size().small).color(palette.dim);
                cell_ui(ui, rect, Align::Max, text).on_hover_text(column.meaning);
            }
        },
        false,
    );
    for (index, row) in rows.iter().enumerate() {
        let text = |text: &str| rich(text, size, row.colour, row.is_strong);
        line(
            ui,
            &mut |ui, at, rect| match at.checked_sub(1) {
                None => {
                    let response = cell_ui(ui, rect, Align::Min, text(&capitalised(row.name)));
                    if !row.mark.is_empty() {
                        mark_ui(ui, response.rect, row.mark);
                    }
                    if !row.meaning.is_empty() {
                        response.on_hover_text(row.meaning);
                    }
                }
                Some(at) => {
                    let (heading, cell) = (columns[at].heading, &row.cells[at]);
                    let response = cell_ui(ui, rect, Align::Max, text(cell));
                    let gap = if caption.is_empty() { "" } else { ", " };
                    let label = format!("{caption}{gap}{}, {heading}: {cell}", row.name);
                    response.widget_info(|| WidgetInfo::labeled(Role::Label, true, &label));
                    value_under(ui, rect, cell);
                }
            },
            index + 1 == rows.len(),
        );
    }
}

/// Width of a mark with the room before it.
const MARK_WIDTH: f32 = space(4);

/// A small triangle that points up, behind a name.
fn mark_ui(ui: &mut Ui, name: Rect, meaning: &'static str) {
    let rect = Rect::from_center_size(
        pos2(name.right() + 0.5 * MARK_WIDTH + 1.0, name.center().y),
        Vec2::splat(MARK_WIDTH),
    );
    let (centre, half) = (rect.center(), 0.25 * MARK_WIDTH);
    let corners = [vec2(0.0, -half), vec2(half, 0.8 * half), vec2(-half, 0.8 * half)].map(|corner| centre + corner);
    let colour = Theme::of(ui).palette.warning;
    ui.painter()
        .add(Shape::convex_polygon(corners.into(), colour, Stroke::NONE));
    let response = ui.interact(rect, ui.scope_id().with(("mark", meaning)), Sense::hover());
    response.widget_info(|| WidgetInfo::labeled(Role::Label, true, meaning));
    response.on_hover_text(meaning);
}

impl TableWidths {
    /// Widths that the cells of all `rows` fit into, in smaller type where there is less room.
    pub fn fitting(ui: &Ui, columns: &[Column], rows: &[&Row]) -> Self {
        let normal = Self::of(ui, columns, rows, type_size().note);
        if normal.total() > ui.available_width() {
            Self::of(ui, columns, rows, type_size().small)
        } else {
            normal
        }
    }

    fn of(ui: &Ui, columns: &[Column], rows: &[&Row], size: f32) -> Self {
        let width = |text: &str, font: FontId| {
            ui.painter()
                .layout_no_wrap(text.to_owned(), font, Color32::WHITE)
                .size()
                .x
        };
        let in_row = |row: &Row, text: &str| {
            width(
                text,
                if row.is_strong {
                    semibold(size)
                } else {
                    FontId::proportional(size)
                },
            )
        };
        let heading = |column: &Column| width(column.heading, FontId::proportional(type_size().small));
        let names = rows
            .iter()
            .map(|row| in_row(row, &capitalised(row.name)) + if row.mark.is_empty() { 0.0 } else { MARK_WIDTH })
            .fold(0.0, f32::max);
        let widths = columns.iter().enumerate().map(|(at, column)| {
            let cells = rows.iter().map(|row| in_row(row, &row.cells[at]));
            cells.fold(heading(column), f32::max)
        });
        Self {
            size,
            names,
            columns: widths.collect(),
        }
    }

    /// With readable gaps between the columns.
    fn total(&self) -> f32 {
        self.names + self.columns.iter().sum::<f32>() + space(2) * self.columns.len() as f32
    }
}

fn rich(text: &str, size: f32, colour: Color32, is_strong: bool) -> RichText {
    let text = RichText::new(text).color(colour);
    if is_strong {
        text.font(semibold(size))
    } else {
        text.size(size)
    }
}

fn cell_ui(ui: &mut Ui, rect: Rect, align: Align, text: RichText) -> eframe::egui::Response {
    let layout = match align {
        Align::Max => Layout::right_to_left(Align::Center),
        _ => Layout::left_to_right(Align::Center),
    };
    let mut cell = ui.new_child(UiBuilder::new().max_rect(rect).layout(layout));
    cell.add(Label::new(text).extend())
}
