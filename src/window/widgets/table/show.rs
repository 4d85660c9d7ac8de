//! Layout and painting of a table.

use eframe::egui::{
    Align, Align2, AsIdSalt, Color32, CursorIcon, FontId, Layout, Rangef, Rect, ScrollArea, Sense, Stroke,
    TextWrapMode, Ui, UiBuilder, WidgetInfo, WidgetText, accesskit::Role, pos2, vec2,
};

use super::{ColumnWidth, SortBy, TableCell, TableClick, TableColumn, TableRow, TableView};
use crate::window::{
    theme::{Theme, radius, semibold, space, type_size},
    widgets::components::focus_ring_ui,
};

/// Width of a scroll bar.
const SCROLL_BAR: f32 = space(3);
/// Number of rows measured for the width of a column.
const MEASURED_ROWS: usize = 100;
/// Minimum gap between columns, at the default font size and at the small one.
const MIN_GAPS: [f32; 2] = [space(2), space(1)];
/// Maximum gap where a column takes the remaining width, and in a table that fills the available space.
const MAX_GAPS: [f32; 2] = [space(4), space(8)];
/// Minimum width of a column that takes the remaining width.
const MIN_REST: f32 = space(24);
/// Width of the arrow of a sorted column.
const ARROW: f32 = space(2);
/// Width of the dot before a text with its distance from it.
const DOT_WIDTH: f32 = space(3);

impl TableView<'_> {
    /// Shows all `rows` over the available width, without vertical scrolling.
    pub fn show_all(self, ui: &mut Ui, rows: Vec<TableRow<'_>>) -> Option<TableClick> {
        let lines = Lines::new(&self, ui, ui.available_width(), false, &rows);
        let mut rows = Vec::from_iter(rows.into_iter().map(Some));
        let count = rows.len();
        lines.show(ui, count, &mut |place| rows[place].take().unwrap_or_default())
    }

    /// Shows a table of `rows` rows that fills the available space and scrolls if it is larger; `row` creates the visible
    /// rows.
    pub fn show<'r>(self, ui: &mut Ui, rows: usize, row: impl Fn(usize) -> TableRow<'r>) -> Option<TableClick> {
        let has_measured = self.columns.iter().any(|column| column.width == ColumnWidth::Content);
        let measured = if has_measured { rows.min(MEASURED_ROWS) } else { 0 };
        let measured = Vec::from_iter((0..measured).map(&row));
        let lines = Lines::new(&self, ui, ui.available_width() - SCROLL_BAR, true, &measured);
        lines.show(ui, rows, &mut |place| row(place))
    }
}

/// The lines of a table: the header and the rows.
struct Lines<'a> {
    table: &'a TableView<'a>,
    /// Size of the font.
    size: f32,
    /// Each column, from the left end of the lines.
    columns: Vec<Rangef>,
    width: f32,
    /// True for a table that fills the available space.
    fills: bool,
}

impl<'a> Lines<'a> {
    /// Places the columns so that they fill the `available` width if possible, otherwise in a smaller font.
    fn new(table: &'a TableView<'a>, ui: &Ui, available: f32, fills: bool, rows: &[TableRow<'_>]) -> Self {
        let padding = if table.is_clickable { space(1) } else { 0.0 };
        let gaps = table.columns.len().saturating_sub(1) as f32;
        let total = |widths: &[f32], gap: f32| widths.iter().sum::<f32>() + gap * gaps + 2.0 * padding;
        let [usual, small] = [(type_size().note, MIN_GAPS[0]), (type_size().small, MIN_GAPS[1])]
            .map(|(size, gap)| (min_widths(table, ui, rows, size), size, gap));
        let is_small = total(&usual.0, usual.2) > available;
        let (mut widths, size, min_gap) = if is_small { small } else { usual };
        let rests = table.columns.iter().filter(|column| column.width == ColumnWidth::Rest);
        let rests = rests.count();
        let spare = (available - total(&widths, min_gap)).max(0.0);
        let most = match (rests, fills) {
            (1.., _) => MAX_GAPS[0],
            (0, true) => MAX_GAPS[1],
            (0, false) => f32::INFINITY,
        };
        let gap = (min_gap + spare / gaps.max(1.0)).min(most);
        let more = (available - total(&widths, gap)).max(0.0) / rests.max(1) as f32;
        for (width, column) in widths.iter_mut().zip(table.columns) {
            if column.width == ColumnWidth::Rest {
                *width += more;
            }
        }
        let mut right = padding - gap;
        let columns = Vec::from_iter(widths.into_iter().map(|width| {
            let left = right + gap;
            right = left + width;
            Rangef::new(left, right)
        }));
        Self {
            table,
            size,
            columns,
            width: right + padding,
            fills,
        }
    }

    fn show<'r>(&self, ui: &mut Ui, rows: usize, row: &mut dyn FnMut(usize) -> TableRow<'r>) -> Option<TableClick> {
        let height = self.table.row_height;
        let mut size = vec2(self.width, height * (rows + 1) as f32);
        if self.fills {
            // The scroll bars do not cover the contents.
            let is_wide = self.width > ui.available_width() - SCROLL_BAR + 0.5;
            size += vec2(SCROLL_BAR, if is_wide { SCROLL_BAR } else { 0.0 });
        }
        let scroll = ScrollArea::new([true, self.fills])
            .id_salt(self.table.id)
            .auto_shrink([false, !self.fills])
            .animated(false);
        let table = UiBuilder::new().accessibility_role(Role::Table);
        let scrolled = ui.scope_builder(table, |ui| {
            scroll.show_viewport(ui, |ui, viewport| {
                let (whole, _) = ui.allocate_exact_size(size, Sense::hover());
                let mut view = viewport.translate(whole.min.to_vec2());
                if !self.fills {
                    // All rows are laid out; an enclosing area scrolls vertically.
                    view = Rect::from_x_y_ranges(view.x_range(), whole.y_range());
                }
                let line_at = |y: f32| Rect::from_min_size(pos2(whole.left(), y), vec2(self.width, height));
                let mut click = self.head_ui(ui, line_at(view.top()));
                let (clip, id) = (ui.clip_rect(), ui.scope_id().with(self.table.id));
                let body = clip.with_min_y(clip.top().max(view.top() + height));
                let first = ((view.top() - whole.top()) / height).max(0.0).floor() as usize;
                let last = (((view.bottom() - whole.top()) / height - 1.0).max(0.0).ceil() as usize).min(rows);
                for place in first..last {
                    let line = line_at(whole.top() + (place + 1) as f32 * height);
                    let row = row(place);
                    // A row with a label is a control.
                    let role = if row.label.is_empty() {
                        Role::Row
                    } else {
                        Role::GenericContainer
                    };
                    let builder = UiBuilder::new().max_rect(line).accessibility_role(role);
                    let mut line_ui = ui.new_child(builder.scope_id(id.with(place)));
                    line_ui.set_clip_rect(body);
                    let is_last = place + 1 == rows;
                    click = click.or(self.line_ui(&mut line_ui, place, is_last, row));
                }
                click
            })
        });
        scrolled.inner.inner
    }

    /// Shows the header. Returns the sort order that the user chose with it.
    fn head_ui(&self, ui: &Ui, line: Rect) -> Option<TableClick> {
        let palette = Theme::of(ui).palette;
        let mut click = None;
        ui.painter()
            .hline(line.x_range(), line.bottom(), Stroke::new(1.0, palette.line));
        for (place, column) in self.table.columns.iter().enumerate() {
            let rect = self.cell(line, place);
            let mut cell = TableCell::new(column.heading).colour(palette.dim);
            let id = ui.scope_id().with((self.table.id, "heading", place));
            let sort = self.table.sort;
            let sense = if sort.is_some() { Sense::click() } else { Sense::hover() };
            let mut response = ui.interact(rect, id, sense);
            if let Some(sort) = sort {
                response.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("Sort by {}", column.heading)));
                response = response
                    .on_hover_cursor(CursorIcon::PointingHand)
                    .on_hover_text("Sorts the table by this column.");
                focus_ring_ui(ui, &response);
                let is_sorted = sort.column == Some(place);
                if response.clicked() {
                    click = Some(TableClick::Sort(SortBy {
                        column: Some(place),
                        is_descending: is_sorted && !sort.is_descending,
                    }));
                }
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
            text_ui(ui, rect, column.is_figure, &cell, type_size().small);
        }
        click
    }

    fn cell(&self, line: Rect, place: usize) -> Rect {
        let Rangef { min, max } = self.columns[place];
        Rect::from_x_y_ranges(line.left() + min..=line.left() + max, line.y_range())
    }

    fn line_ui(&self, ui: &mut Ui, place: usize, is_last: bool, row: TableRow<'_>) -> Option<TableClick> {
        let line = ui.max_rect();
        let click = self.ground_ui(ui, place, is_last, &row);
        if row.is_section {
            for cell in &row.cells {
                text_ui(ui, line, false, cell, self.size);
                label_ui(ui, line, "section", &cell.text, "");
            }
            return click;
        }
        for (place, (column, mut cell)) in self.table.columns.iter().zip(row.cells).enumerate() {
            let mut rect = self.cell(line, place);
            if let Some(controls) = cell.controls {
                let layout = match column.is_figure {
                    true => Layout::right_to_left(Align::Center),
                    false => Layout::left_to_right(Align::Center),
                };
                let builder = UiBuilder::new().max_rect(rect).layout(layout).id_salt(place);
                let mut cell_ui = ui.new_child(builder);
                cell_ui.shrink_clip_rect(rect);
                controls(&mut cell_ui);
                continue;
            }
            // A row with a label of its own needs no label here.
            let label = match place {
                1.. if column.is_figure && !row.name.is_empty() => {
                    format!("{}, {}: {}", row.name, column.heading, cell.text)
                }
                _ if row.label.is_empty() => cell.text.clone(),
                _ => String::new(),
            };
            let mut meaning = cell.meaning;
            let whole = rect;
            if place == 0 {
                if let Some(colour) = row.dot {
                    ui.painter()
                        .circle_filled(rect.left_center() + vec2(4.0, 0.0), 3.0, colour);
                    rect.min.x += DOT_WIDTH;
                }
                if !row.mark.is_empty() {
                    cell.colour = Some(Theme::of(ui).palette.warning);
                    meaning = row.mark;
                    label_ui(ui, whole, "mark", row.mark, "");
                }
                if meaning.is_empty() && row.label.is_empty() {
                    meaning = row.meaning;
                }
            }
            let is_cut = text_ui(ui, rect, column.is_figure, &cell, self.size);
            if meaning.is_empty() && is_cut {
                meaning = &cell.text;
            }
            label_ui(ui, whole, ("cell", place), &label, meaning);
        }
        click
    }

    /// Shows the background of a row. Returns the user action on the row.
    fn ground_ui(&self, ui: &Ui, place: usize, is_last: bool, row: &TableRow<'_>) -> Option<TableClick> {
        let palette = Theme::of(ui).palette;
        let (line, is_clickable) = (ui.max_rect(), self.table.is_clickable);
        let mut click = None;
        if is_clickable || !row.label.is_empty() {
            let sense = if is_clickable { Sense::click() } else { Sense::hover() };
            let mut response = ui.interact(line, ui.scope_id().with("row"), sense);
            response.widget_info(|| WidgetInfo::selected(Role::Row, true, row.is_selected, &row.label));
            let ground = match row.is_selected {
                true => Some(palette.selected),
                false => (is_clickable && response.hovered()).then_some(palette.raised),
            };
            if let Some(colour) = ground {
                ui.painter().rect_filled(line, f32::from(radius()) / 2.0, colour);
            }
            focus_ring_ui(ui, &response);
            if !row.meaning.is_empty() {
                response = response.on_hover_text(row.meaning);
            }
            if is_clickable {
                if response.gained_focus() {
                    // Not under the header.
                    ui.scroll_to_rect(line.expand2(vec2(0.0, line.height())), None);
                }
                response = response.on_hover_cursor(CursorIcon::PointingHand);
                click = response.clicked().then_some(TableClick::Select(place));
            }
        }
        if !is_last {
            let stroke = Stroke::new(0.5, palette.line);
            ui.painter().hline(line.x_range(), line.bottom(), stroke);
        }
        click
    }
}

/// Returns the minimum widths of the columns in a font of this size.
fn min_widths(table: &TableView<'_>, ui: &Ui, rows: &[TableRow<'_>], size: f32) -> Vec<f32> {
    let width = |text: &str, font: FontId| {
        let galley = ui.painter().layout_no_wrap(text.to_owned(), font, Color32::WHITE);
        galley.size().x
    };
    let of_rows = |place: usize| {
        let rows = rows.iter().filter(|row| !row.is_section);
        let cells = rows.filter_map(|row| Some((row, row.cells.get(place)?)));
        let widths = cells.map(|(row, cell)| {
            let dot = if row.dot.is_some() { DOT_WIDTH } else { 0.0 };
            width(&cell.text, font(size, cell.is_strong)) + if place == 0 { dot } else { 0.0 }
        });
        widths.fold(0.0, f32::max)
    };
    let of_column = |(place, column): (usize, &TableColumn<'_>)| {
        let is_sortable = table.sort.is_some();
        let arrow = if is_sortable { ARROW } else { 0.0 };
        let heading = || width(column.heading, font(type_size().small, is_sortable)) + arrow;
        match column.width {
            ColumnWidth::Content => of_rows(place).max(heading()),
            ColumnWidth::Fits(text) => width(text, semibold(size)).max(heading()),
            ColumnWidth::Points(points) => points,
            ColumnWidth::Rest => MIN_REST,
        }
    };
    table.columns.iter().enumerate().map(of_column).collect()
}

fn font(size: f32, is_strong: bool) -> FontId {
    match is_strong {
        true => semibold(size),
        false => FontId::proportional(size),
    }
}

/// Adds a label and a tooltip for the contents of `rect`; does nothing if both are empty.
fn label_ui(ui: &Ui, rect: Rect, id: impl AsIdSalt, label: &str, meaning: &str) {
    if label.is_empty() && meaning.is_empty() {
        return;
    }
    let response = ui.interact(rect, ui.scope_id().with(id), Sense::hover());
    if !label.is_empty() {
        response.widget_info(|| WidgetInfo::labeled(Role::Cell, true, label));
    }
    if !meaning.is_empty() {
        response.on_hover_text(meaning);
    }
}

/// Paints the text of a cell: a figure is aligned right and never truncated; text is aligned left and truncated to fit.
/// Returns true if it was truncated.
fn text_ui(ui: &Ui, rect: Rect, is_figure: bool, cell: &TableCell<'_>, size: f32) -> bool {
    let (font, colour) = (
        font(size, cell.is_strong),
        cell.colour.unwrap_or(Theme::of(ui).palette.text),
    );
    if is_figure {
        let right = rect.right_center();
        ui.painter().text(right, Align2::RIGHT_CENTER, &cell.text, font, colour);
        return false;
    }
    let text = WidgetText::from(cell.text.as_str());
    // The width was measured from the same text, but positions are rounded.
    let galley = text.into_galley(ui, Some(TextWrapMode::Truncate), rect.width() + 0.5, font);
    let (place, is_cut) = (
        Align2::LEFT_CENTER.anchor_size(rect.left_center(), galley.size()),
        galley.elided,
    );
    ui.painter().galley(place.min, galley, colour);
    is_cut
}
