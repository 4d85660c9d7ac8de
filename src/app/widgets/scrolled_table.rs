//! A table of any number of rows that scrolls under its heading. Only the rows in view are laid out.

use eframe::egui::{
    Align2, Color32, CursorIcon, FontId, Rect, Response, ScrollArea, Sense, Stroke, TextWrapMode, Ui, WidgetInfo,
    WidgetText, accesskit::Role, pos2, vec2,
};
use egui_extras::{Column, TableBuilder};

use super::{fold::focus_ring_ui, value_under::value_under};
use crate::app::theme::{Theme, radius, semibold, space, type_size};

const ROW_HEIGHT: f32 = space(6);
/// Width of the strip of the scroll bar.
const SCROLL_BAR: f32 = space(3);
/// Gaps between columns, none of which takes the rest.
const GAPS: (f32, f32) = (space(2), space(8));
/// Least width of a column that takes the rest.
const LEAST_REST: f32 = space(24);
/// Radius of the dot before a name.
const DOT: f32 = 3.0;

/// Width of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ColumnWidth<'a> {
    /// As wide as this text, the longest of its cells.
    Fits(&'a str),
    /// So many points.
    Points(f32),
    /// All that the others leave.
    Rest,
}

/// A column: names stand at its left, figures at its right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableColumn<'a> {
    pub heading: &'a str,
    pub is_figure: bool,
    pub width: ColumnWidth<'a>,
}

impl<'a> ColumnWidth<'a> {
    /// As wide as the longest of `texts`; it is the widest but for a point or two, which the gap takes.
    pub fn of_longest(texts: impl Iterator<Item = &'a str>) -> Self {
        Self::Fits(texts.max_by_key(|text| text.chars().count()).unwrap_or_default())
    }
}

/// Column by which the rows are sorted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SortBy {
    /// Its place; none before the user chooses one.
    pub column: Option<usize>,
    /// Largest first.
    pub is_descending: bool,
}

impl SortBy {
    /// The rows in this order. `cell` gives the figure of a row in a column, if it has one, and a text: rows without a figure
    /// come last, by their texts.
    pub fn order<'a>(self, rows: usize, cell: impl Fn(usize, usize) -> (Option<f64>, &'a str)) -> Vec<usize> {
        let mut order: Vec<usize> = (0..rows).collect();
        let Some(column) = self.column else { return order };
        order.sort_by(|&one, &other| {
            let ((one, text), (other, other_text)) = (cell(one, column), cell(other, column));
            let ordering = match (one, other) {
                (Some(one), Some(other)) => one.total_cmp(&other),
                (None, None) => text.cmp(other_text),
                (one, other) => return other.is_some().cmp(&one.is_some()),
            };
            if self.is_descending {
                ordering.reverse()
            } else {
                ordering
            }
        });
        order
    }
}

/// A row, with one cell for each column.
pub struct TableRow {
    /// Its name for assistive technology.
    pub label: String,
    pub is_marked: bool,
    /// Shown under the pointer; empty for nothing.
    pub meaning: &'static str,
    /// Colour of a dot before its name.
    pub dot: Option<Color32>,
    pub cells: Vec<TableCell>,
}

/// The text of a cell.
pub struct TableCell {
    pub text: String,
    pub colour: Color32,
    pub is_strong: bool,
    /// Its name for assistive technology, if the row's does not tell the figure.
    pub label: Option<String>,
    /// Shown under the pointer; empty for nothing.
    pub meaning: &'static str,
}

impl TableCell {
    /// A text that its row's name tells already.
    pub fn plain(text: String, colour: Color32) -> Self {
        Self {
            text,
            colour,
            is_strong: false,
            label: None,
            meaning: "",
        }
    }
}

/// An action of the user on a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableClick {
    /// Chose another order.
    Sort(SortBy),
    /// Marked the row in this place.
    Mark(usize),
    /// Opened the row in this place by a double click.
    Open(usize),
    /// Points at the row in this place.
    Point(usize),
}

/// Lays out a table of so many rows over the available space. With `sort`, a click on a heading orders it.
pub fn scrolled_table_ui(
    ui: &mut Ui,
    id: &str,
    columns: &[TableColumn<'_>],
    sort: Option<SortBy>,
    rows: usize,
    row: impl Fn(usize) -> TableRow,
) -> Option<TableClick> {
    let widths = widths(ui, columns);
    let total: f32 = widths.iter().sum();
    let mut click = None;
    ScrollArea::horizontal()
        .id_salt((id, "columns"))
        .auto_shrink(false)
        .show(ui, |ui| {
            // The scroll bar has a strip of its own.
            ui.set_width(total + SCROLL_BAR);
            ui.spacing_mut().item_spacing = vec2(0.0, 0.0);
            let mut table = TableBuilder::new(ui)
                .id_salt(id)
                .striped(false)
                .auto_shrink(false)
                .min_scrolled_height(0.0)
                .animate_scrolling(false);
            for &width in &widths {
                // What is wider than its column is cut off by its own layout.
                table = table.column(Column::exact(width).clip(false));
            }
            let table = table.header(ROW_HEIGHT, |mut heading| {
                for (place, column) in columns.iter().enumerate() {
                    heading.col(|ui| {
                        if place == 0 {
                            underline(ui, total, 1.0);
                        }
                        click = click.or(heading_ui(ui, column, place, sort));
                    });
                }
            });
            table.body(|body| {
                body.rows(ROW_HEIGHT, rows, |mut line| {
                    let place = line.index();
                    let row = row(place);
                    for (number, (column, cell)) in columns.iter().zip(&row.cells).enumerate() {
                        let (_, response) = line.col(|ui| {
                            let mut rect = ui.max_rect();
                            if number == 0 {
                                click = click.or(line_ui(ui, &row, place, total));
                                if let Some(colour) = row.dot {
                                    let dot = pos2(rect.left() + space(2), rect.center().y);
                                    ui.painter().circle_filled(dot, DOT, colour);
                                    rect.min.x += space(3);
                                }
                            }
                            value_under(ui, rect, &cell.text);
                            let is_cut = text_ui(ui, rect, column.is_figure, cell, type_size().note);
                            if is_cut {
                                let whole = ui.interact(rect, ui.scope_id().with("whole"), Sense::hover());
                                whole.on_hover_text(&cell.text);
                            }
                        });
                        if let Some(label) = &cell.label {
                            response.widget_info(|| WidgetInfo::labeled(Role::Label, true, label));
                        }
                        if !cell.meaning.is_empty() {
                            response.on_hover_text(cell.meaning);
                        }
                    }
                });
            });
        });
    click
}

/// Returns the widths of the columns, which fill the table where they can.
fn widths(ui: &Ui, columns: &[TableColumn<'_>]) -> Vec<f32> {
    let width = |text: &str, size: f32| {
        let galley = ui
            .painter()
            .layout_no_wrap(text.to_owned(), semibold(size), Color32::WHITE);
        galley.size().x
    };
    let available = ui.available_width() - SCROLL_BAR;
    let mut widths: Vec<f32> = columns
        .iter()
        .map(|column| match column.width {
            ColumnWidth::Fits(text) => {
                // Room for the arrow of a sorted column.
                let heading = width(column.heading, type_size().small) + space(2);
                heading.max(width(text, type_size().note))
            }
            ColumnWidth::Points(points) => points,
            ColumnWidth::Rest => 0.0,
        })
        .collect();
    let left = available - widths.iter().sum::<f32>();
    let rests = columns
        .iter()
        .filter(|column| column.width == ColumnWidth::Rest)
        .count();
    if rests > 0 {
        let rest = (left / rests as f32).max(LEAST_REST);
        let of_rest = widths.iter_mut().zip(columns);
        of_rest
            .filter(|(_, column)| column.width == ColumnWidth::Rest)
            .for_each(|(width, _)| *width = rest);
    } else {
        let gap = (left / columns.len().max(1) as f32).clamp(GAPS.0, GAPS.1);
        widths.iter_mut().for_each(|width| *width += gap);
    }
    widths.into_iter().map(f32::floor).collect()
}

/// Shows a heading. Returns the order that the user chose by it.
fn heading_ui(ui: &mut Ui, column: &TableColumn<'_>, place: usize, sort: Option<SortBy>) -> Option<TableClick> {
    let palette = Theme::of(ui).palette;
    let rect = ui.max_rect();
    let mut cell = TableCell::plain(column.heading.to_owned(), palette.dim);
    let mut chosen = None;
    if let Some(sort) = sort {
        let response = ui.interact(rect, ui.scope_id().with("sort"), Sense::click());
        response.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("Sort by {}", column.heading)));
        let response = response
            .on_hover_cursor(CursorIcon::PointingHand)
            .on_hover_text("Sorts the table by this column.");
        focus_ring_ui(ui, &response);
        let is_sorted = sort.column == Some(place);
        chosen = response.clicked().then_some(TableClick::Sort(SortBy {
            column: Some(place),
            is_descending: is_sorted && !sort.is_descending,
        }));
        if is_sorted {
            cell.text += if sort.is_descending { " ↓" } else { " ↑" };
            cell.is_strong = true;
        }
        if is_sorted || response.hovered() {
            cell.colour = palette.text;
        }
    }
    text_ui(ui, rect, column.is_figure, &cell, type_size().small);
    chosen
}

/// Shows the ground of a row, from its first cell. Returns what the user did with the row.
fn line_ui(ui: &mut Ui, row: &TableRow, place: usize, total: f32) -> Option<TableClick> {
    let palette = Theme::of(ui).palette;
    let line = line_rect(ui, total);
    let response = ui.interact(line, ui.scope_id().with("row"), Sense::click());
    response.widget_info(|| WidgetInfo::selected(Role::Row, true, row.is_marked, &row.label));
    if row.is_marked {
        ui.painter()
            .rect_filled(line, f32::from(radius()) / 2.0, palette.selected);
    } else if response.hovered() {
        ui.painter()
            .rect_filled(line, f32::from(radius()) / 2.0, palette.raised);
    }
    focus_ring_ui(ui, &response);
    underline(ui, total, 0.5);
    let mut response: Response = response.on_hover_cursor(CursorIcon::PointingHand);
    if !row.meaning.is_empty() {
        response = response.on_hover_text(row.meaning);
    }
    if response.double_clicked() {
        Some(TableClick::Open(place))
    } else {
        let is_pointed = response.contains_pointer().then_some(TableClick::Point(place));
        response.clicked().then_some(TableClick::Mark(place)).or(is_pointed)
    }
}

/// The whole row, as seen from its first cell.
fn line_rect(ui: &Ui, total: f32) -> Rect {
    let cell = ui.max_rect();
    Rect::from_min_size(cell.min, vec2(total, cell.height()))
}

fn underline(ui: &Ui, total: f32, points: f32) {
    let line = line_rect(ui, total);
    let stroke = Stroke::new(points, Theme::of(ui).palette.line);
    ui.painter().hline(line.x_range(), line.bottom(), stroke);
}

/// Draws the text of a cell. Returns true if it did not fit.
fn text_ui(ui: &Ui, rect: Rect, is_figure: bool, cell: &TableCell, size: f32) -> bool {
    let font = if cell.is_strong {
        semibold(size)
    } else {
        FontId::proportional(size)
    };
    if is_figure {
        let text = &cell.text;
        ui.painter()
            .text(rect.right_center(), Align2::RIGHT_CENTER, text, font, cell.colour);
        return false;
    }
    let room = rect.width() - 2.0 * space(1);
    let text = WidgetText::from(cell.text.as_str());
    let galley = text.into_galley(ui, Some(TextWrapMode::Truncate), room, font);
    let is_cut = galley.elided;
    let place = pos2(rect.left() + space(1), rect.center().y - 0.5 * galley.size().y);
    ui.painter().galley(place, galley, cell.colour);
    is_cut
}

#[cfg(test)]
mod tests;
