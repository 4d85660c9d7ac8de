//! Layout and painting of a table.

use eframe::egui::{
    Align, Align2, CursorIcon, Id, Layout, Pos2, Rangef, Rect, Response, ScrollArea, Sense, Shape, Stroke,
    TextWrapMode, Ui, UiBuilder, Vec2, WidgetInfo, WidgetText, accesskit::Role, pos2, vec2,
};

use super::{
    SortBy, TableCell, TableClick, TableColumn, TableRow, TableView,
    row::{ColumnPlace, DOT, DOT_WIDTH, MARK_WIDTH, MEASURED_ROWS, Request, Widths, font},
};
use crate::window::{
    theme::{Theme, radius, space, type_size},
    widgets::components::focus_ring_ui,
};

/// Width of a scroll bar.
const SCROLL_BAR: f32 = space(3);
/// Maximum fraction of the width that the first column keeps while the others scroll.
const MAX_PINNED: f32 = 0.6;

impl TableView<'_> {
    /// Shows all `rows` over the available width, without vertical scrolling.
    pub fn show_all(self, ui: &mut Ui, rows: Vec<TableRow<'_>>) -> Option<TableClick> {
        let widths = self.request(ui.available_width(), false).widths(ui, &rows);
        let size = vec2(widths.total, self.row_height * (rows.len() + 1) as f32);
        let mut lines = rows.into_iter().map(Some).collect::<Vec<_>>();
        let shown = Shown::new(&self, &widths, lines.len());
        let mut make = |place: usize| lines[place].take().unwrap_or_default();
        if size.x <= ui.available_width() + 0.5 {
            let (rect, _) = ui.allocate_exact_size(size, Sense::hover());
            return shown.lay_out(ui, rect.min, rect, &mut make);
        }
        let scroll = ScrollArea::horizontal().id_salt(self.id).auto_shrink([false, true]);
        let scrolled = scroll.show_viewport(ui, |ui, viewport| {
            let (rect, _) = ui.allocate_exact_size(size, Sense::hover());
            // All rows are laid out; an enclosing area scrolls vertically.
            let view = Rect::from_x_y_ranges(viewport.translate(rect.min.to_vec2()).x_range(), rect.y_range());
            shown.lay_out(ui, rect.min, view, &mut make)
        });
        scrolled.inner
    }

    /// Shows a table of `rows` rows that fills the available space and scrolls if it is larger; `row` creates the visible
    /// rows.
    pub fn show<'r>(self, ui: &mut Ui, rows: usize, row: impl Fn(usize) -> TableRow<'r>) -> Option<TableClick> {
        let is_measured = |column: &TableColumn<'_>| column.width == super::ColumnWidth::Content;
        let measured = if self.columns.iter().any(is_measured) {
            rows.min(MEASURED_ROWS)
        } else {
            0
        };
        let available = ui.available_width() - SCROLL_BAR;
        let measured: Vec<TableRow<'_>> = (0..measured).map(&row).collect();
        let widths = self.request(available, true).widths(ui, &measured);
        let shown = Shown::new(&self, &widths, rows);
        // The scroll bars do not cover the contents.
        let below = if widths.total > available + 0.5 {
            SCROLL_BAR
        } else {
            0.0
        };
        let size = vec2(widths.total + SCROLL_BAR, self.row_height * (rows + 1) as f32 + below);
        let scroll = ScrollArea::both().id_salt(self.id).auto_shrink(false).animated(false);
        let scrolled = scroll.show_viewport(ui, |ui, viewport| {
            let (rect, _) = ui.allocate_exact_size(size, Sense::hover());
            let view = viewport.translate(rect.min.to_vec2());
            shown.lay_out(ui, rect.min, view, &mut |place| row(place))
        });
        scrolled.inner
    }

    fn request(&self, available: f32, fills: bool) -> Request<'_> {
        Request {
            columns: self.columns,
            is_sortable: self.sort.is_some(),
            padding: if self.is_clickable { space(1) } else { 0.0 },
            available,
            fills,
        }
    }
}

/// Table with its column widths.
struct Shown<'a> {
    table: &'a TableView<'a>,
    widths: &'a Widths,
    rows: usize,
}

/// Parts of the table that scroll separately.
struct TablePanes {
    /// Left end of the scrolled lines.
    left: f32,
    /// Shift of the first column, which stays visible.
    pin: f32,
    /// Header.
    head: Rect,
    /// Part of the view to the right of the first column.
    columns: Rangef,
}

impl TablePanes {
    /// Returns the part of `line` in which the column with index `place` is visible.
    fn clip(&self, line: Rect, place: usize) -> Rect {
        if place == 0 || self.pin == 0.0 {
            line
        } else {
            line.with_min_x(self.columns.min)
        }
    }

    /// Returns the rectangle of a column in the line with the vertical range `y`.
    fn rect(&self, column: &ColumnPlace, place: usize, left: f32, y: Rangef) -> Rect {
        let shift = self.left + if place == 0 { self.pin } else { 0.0 };
        Rect::from_x_y_ranges(shift + left..=shift + column.right, y)
    }
}

impl<'a> Shown<'a> {
    fn new(table: &'a TableView<'a>, widths: &'a Widths, rows: usize) -> Self {
        Self { table, widths, rows }
    }

    /// Lays out the contents of `view`, the visible part of a table whose upper left corner is at `origin`.
    fn lay_out<'r>(
        &self,
        ui: &mut Ui,
        origin: Pos2,
        view: Rect,
        row: &mut dyn FnMut(usize) -> TableRow<'r>,
    ) -> Option<TableClick> {
        let height = self.table.row_height;
        let clip = ui.clip_rect();
        let scrolled = view.left() - origin.x;
        let first = self.widths.columns.first().map_or(0.0, |column| column.right);
        let is_pinned = scrolled > 0.0 && first <= MAX_PINNED * view.width();
        let parts = TablePanes {
            left: origin.x,
            pin: if is_pinned { scrolled } else { 0.0 },
            head: Rect::from_min_size(view.min, vec2(view.width(), height)),
            columns: Rangef::new(view.left() + first, f32::INFINITY),
        };
        let mut click = self.head_ui(ui, &parts);
        let top = origin.y + height;
        let in_view = |y: f32| ((y - top) / height).max(0.0);
        let first = in_view(parts.head.bottom()).floor() as usize;
        let last = (in_view(view.bottom()).ceil() as usize).min(self.rows);
        let body = clip.with_min_y(clip.top().max(parts.head.bottom()));
        let id = ui.scope_id().with(self.table.id);
        for place in first..last {
            let y = top + place as f32 * height;
            let line = Rect::from_min_size(pos2(origin.x, y), vec2(self.widths.total, height));
            let builder = UiBuilder::new().max_rect(line).scope_id(id.with(place));
            let mut line_ui = ui.new_child(builder);
            line_ui.set_clip_rect(body);
            click = click.or(self.line_ui(&mut line_ui, &parts, place, row(place)));
        }
        click
    }

    fn head_ui(&self, ui: &mut Ui, parts: &TablePanes) -> Option<TableClick> {
        let mut click = None;
        let clip = ui.clip_rect();
        let y = parts.head.y_range();
        let stroke = Stroke::new(1.0, Theme::of(ui).palette.line);
        ui.painter()
            .hline(parts.left..=parts.left + self.widths.total, y.max, stroke);
        for (place, (column, at)) in self.table.columns.iter().zip(&self.widths.columns).enumerate() {
            let whole = parts.rect(at, place, at.gap_left, y);
            let text = parts.rect(at, place, at.left, y);
            let mut cell = ui.new_child(UiBuilder::new().max_rect(whole).id_salt((self.table.id, "head", place)));
            cell.set_clip_rect(parts.clip(clip, place));
            click = click.or(self.heading_ui(&cell, column, place, (whole, text)));
        }
        click
    }

    /// Shows a heading. Returns the sort order that the user chose with it.
    fn heading_ui(
        &self,
        ui: &Ui,
        column: &TableColumn<'_>,
        place: usize,
        (whole, text): (Rect, Rect),
    ) -> Option<TableClick> {
        let palette = Theme::of(ui).palette;
        let mut cell = TableCell::new(column.heading).colour(palette.dim);
        let mut chosen = None;
        let sense = if self.table.sort.is_some() {
            Sense::click()
        } else {
            Sense::hover()
        };
        let mut response = ui.interact(whole, ui.scope_id().with("heading"), sense);
        if let Some(sort) = self.table.sort {
            response.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("Sort by {}", column.heading)));
            response = response
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
                cell.colour = Some(palette.text);
            }
        } else if !column.heading.is_empty() {
            response.widget_info(|| WidgetInfo::labeled(Role::ColumnHeader, true, column.heading));
        }
        if !column.meaning.is_empty() {
            response.on_hover_text(column.meaning);
        }
        text_ui(
            ui,
            if column.is_figure { whole } else { text },
            column.is_figure,
            &cell,
            type_size().small,
        );
        chosen
    }

    fn line_ui(&self, ui: &mut Ui, parts: &TablePanes, place: usize, row: TableRow<'_>) -> Option<TableClick> {
        let line = ui.max_rect();
        let click = self.ground_ui(ui, parts, place, &row);
        if row.is_section {
            for cell in &row.cells {
                text_ui(ui, line.translate(vec2(parts.pin, 0.0)), false, cell, self.widths.size);
                label_ui(ui, line, Id::NULL, &cell.text, "");
            }
            return click;
        }
        let body = ui.clip_rect();
        let columns = self.table.columns.iter().zip(&self.widths.columns).zip(row.cells);
        for (place, ((column, at), cell)) in columns.enumerate() {
            let whole = parts.rect(at, place, at.gap_left, line.y_range());
            let rect = if column.is_figure {
                whole
            } else {
                whole.with_min_x(whole.right() - (at.right - at.left))
            };
            let layout = if column.is_figure {
                Layout::right_to_left(Align::Center)
            } else {
                Layout::left_to_right(Align::Center)
            };
            let builder = UiBuilder::new().max_rect(rect).layout(layout).id_salt(place);
            let mut cell_ui = ui.new_child(builder);
            cell_ui.set_clip_rect(parts.clip(body, place));
            // A row with a label of its own needs no label here.
            let label = match place {
                1.. if column.is_figure && !row.name.is_empty() => {
                    format!("{}, {}: {}", row.name, column.heading, cell.text)
                }
                _ if row.label.is_empty() => cell.text.clone(),
                _ => String::new(),
            };
            let of_row = if place == 0 && row.label.is_empty() {
                row.meaning
            } else {
                ""
            };
            let meaning = if cell.meaning.is_empty() { of_row } else { cell.meaning };
            self.cell_ui(&mut cell_ui, column, cell, &label, meaning);
        }
        click
    }

    fn cell_ui(&self, ui: &mut Ui, column: &TableColumn<'_>, cell: TableCell<'_>, label: &str, meaning: &str) {
        let mut rect = ui.max_rect();
        if let Some(controls) = cell.controls {
            ui.shrink_clip_rect(rect);
            controls(ui);
            return;
        }
        let whole = rect;
        if let Some(colour) = cell.dot {
            ui.painter()
                .circle_filled(pos2(rect.left() + DOT + 1.0, rect.center().y), DOT, colour);
            rect.min.x += DOT_WIDTH;
        }
        if !cell.mark.is_empty() {
            rect.max.x -= MARK_WIDTH;
        }
        let text = text_ui(ui, rect, column.is_figure, &cell, self.widths.size);
        if !cell.mark.is_empty() {
            mark_ui(ui, text.rect, cell.mark);
        }
        let id = ui.scope_id().with("cell");
        label_ui(
            ui,
            whole,
            id,
            label,
            if meaning.is_empty() && text.is_cut {
                &cell.text
            } else {
                meaning
            },
        );
    }

    /// Shows the background of a row. Returns the user action on the row.
    fn ground_ui(&self, ui: &Ui, parts: &TablePanes, place: usize, row: &TableRow<'_>) -> Option<TableClick> {
        let palette = Theme::of(ui).palette;
        let line = ui.max_rect();
        let underline = || {
            if place + 1 < self.rows {
                let stroke = Stroke::new(0.5, palette.line);
                ui.painter().hline(line.x_range(), line.bottom(), stroke);
            }
        };
        if row.label.is_empty() && !self.table.is_clickable {
            underline();
            return None;
        }
        let sense = if self.table.is_clickable {
            Sense::click()
        } else {
            Sense::hover()
        };
        let mut response: Response = ui.interact(line, ui.scope_id().with("row"), sense);
        response.widget_info(|| WidgetInfo::selected(Role::Row, true, row.is_selected, &row.label));
        let ground = if row.is_selected {
            Some(palette.selected)
        } else {
            (self.table.is_clickable && response.hovered()).then_some(palette.raised)
        };
        if let Some(colour) = ground {
            ui.painter().rect_filled(line, f32::from(radius()) / 2.0, colour);
        }
        focus_ring_ui(ui, &response);
        underline();
        if !row.meaning.is_empty() {
            response = response.on_hover_text(row.meaning);
        }
        if !self.table.is_clickable {
            return None;
        }
        if response.gained_focus() {
            // Not under the header or the first column.
            let room = vec2(0.0, parts.head.height());
            ui.scroll_to_rect(
                Rect::from_center_size(line.center(), vec2(0.0, line.height()) + 2.0 * room),
                None,
            );
        }
        response = response.on_hover_cursor(CursorIcon::PointingHand);
        if response.double_clicked() {
            Some(TableClick::Open(place))
        } else {
            let is_pointed = response.contains_pointer().then_some(TableClick::Point(place));
            response.clicked().then_some(TableClick::Select(place)).or(is_pointed)
        }
    }
}

/// Adds a label and a tooltip for the contents of `rect`; does nothing if both are empty.
fn label_ui(ui: &Ui, rect: Rect, id: Id, label: &str, meaning: &str) {
    if label.is_empty() && meaning.is_empty() {
        return;
    }
    let id = if id == Id::NULL {
        ui.scope_id().with("section")
    } else {
        id
    };
    let response = ui.interact(rect, id, Sense::hover());
    if !label.is_empty() {
        response.widget_info(|| WidgetInfo::labeled(Role::Label, true, label));
    }
    if !meaning.is_empty() {
        response.on_hover_text(meaning);
    }
}

/// Painted text.
struct Painted {
    rect: Rect,
    is_cut: bool,
}

/// Paints the text of a cell: a figure is aligned right and never truncated; text is aligned left and truncated to fit.
fn text_ui(ui: &Ui, rect: Rect, is_figure: bool, cell: &TableCell<'_>, size: f32) -> Painted {
    let colour = cell.colour.unwrap_or_else(|| Theme::of(ui).palette.text);
    let font = font(size, cell.is_strong);
    if is_figure {
        let place = rect.right_center();
        let rect = ui.painter().text(place, Align2::RIGHT_CENTER, &cell.text, font, colour);
        return Painted { rect, is_cut: false };
    }
    // The width was measured from the same text, but positions are rounded.
    let room = rect.width() + 0.5;
    let text = WidgetText::from(cell.text.as_str());
    let galley = text.into_galley(ui, Some(TextWrapMode::Truncate), room, font);
    let is_cut = galley.elided;
    let place = pos2(rect.left(), rect.center().y - 0.5 * galley.size().y);
    let painted = Rect::from_min_size(place, galley.size());
    ui.painter().galley(place, galley, colour);
    Painted { rect: painted, is_cut }
}

/// Paints a small upward-pointing triangle after a text.
fn mark_ui(ui: &Ui, text: Rect, meaning: &str) {
    let rect = Rect::from_center_size(
        pos2(text.right() + 0.5 * MARK_WIDTH + 1.0, text.center().y),
        Vec2::splat(MARK_WIDTH),
    );
    let (centre, half) = (rect.center(), 0.25 * MARK_WIDTH);
    let corners = [vec2(0.0, -half), vec2(half, 0.8 * half), vec2(-half, 0.8 * half)].map(|corner| centre + corner);
    let colour = Theme::of(ui).palette.warning;
    ui.painter()
        .add(Shape::convex_polygon(corners.into(), colour, Stroke::NONE));
    label_ui(ui, rect, ui.scope_id().with("mark"), meaning, meaning);
}
