//! Rows and cells of a table, and the widths of its columns.

use decoupler_files::export;
use eframe::egui::{Color32, FontId, Ui};

use super::{ColumnWidth, TableColumn};
use crate::window::{
    theme::{semibold, space, type_size},
    widgets::fields::capitalised,
};

/// Row with one cell per column; columns without a cell stay empty.
#[derive(Default)]
#[must_use = "a row shows only in a table"]
pub struct TableRow<'a> {
    /// Name in the labels of its figures; empty if the figures have no labels of their own.
    pub(super) name: String,
    /// Label of the row as a whole for assistive technology; empty for none.
    pub(super) label: String,
    pub(super) meaning: &'a str,
    pub(super) is_selected: bool,
    /// True for a heading across all columns.
    pub(super) is_section: bool,
    pub(super) cells: Vec<TableCell<'a>>,
}

/// Function that adds the controls of a cell.
type Controls<'a> = Box<dyn FnOnce(&mut Ui) + 'a>;

/// Table cell: a text, or controls.
#[derive(Default)]
#[must_use = "a cell shows only in a table"]
pub struct TableCell<'a> {
    pub(super) text: String,
    /// Adds the controls of the cell in place of the text.
    pub(super) controls: Option<Controls<'a>>,
    /// `None` for the default text colour.
    pub(super) colour: Option<Color32>,
    pub(super) is_strong: bool,
    pub(super) meaning: &'a str,
    pub(super) dot: Option<Color32>,
    pub(super) mark: &'a str,
}

impl<'a> TableRow<'a> {
    /// Returns a row of these cells.
    pub fn new(cells: impl IntoIterator<Item = TableCell<'a>>) -> Self {
        Self {
            cells: cells.into_iter().collect(),
            ..Self::default()
        }
    }

    /// Returns a row of figures after their name, which is capitalised.
    pub fn figures(name: impl Into<String>, figures: impl IntoIterator<Item = String>) -> Self {
        let name = name.into();
        let cells = std::iter::once(capitalised(&name)).chain(figures).map(TableCell::new);
        Self {
            cells: cells.collect(),
            name,
            ..Self::default()
        }
    }

    /// Returns a heading across all columns.
    pub fn section(title: impl Into<String>) -> Self {
        Self {
            is_section: true,
            ..Self::new([TableCell::new(title).strong(true)])
        }
    }

    /// Returns the rows of an exported table: names in the first column, followed by rounded figures.
    pub fn of_table(table: &export::Table) -> Vec<Self> {
        let row = |cells: &Vec<export::Cell>| {
            let mut texts = cells.iter().map(export::Cell::rounded);
            Self::figures(texts.next().unwrap_or_default(), texts)
        };
        table.rows.iter().map(row).collect()
    }

    /// Sets the name in the labels of its figures: `name, heading: figure`.
    pub fn named(self, name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            ..self
        }
    }

    /// Sets the label of the row as a whole.
    pub fn labelled(self, label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            ..self
        }
    }

    /// Sets the tooltip.
    pub fn meaning(self, meaning: &'a str) -> Self {
        Self { meaning, ..self }
    }

    /// Sets the selection state.
    pub fn selected(self, is_selected: bool) -> Self {
        Self { is_selected, ..self }
    }

    /// Sets the colour of all texts.
    pub fn colour(mut self, colour: Color32) -> Self {
        self.cells.iter_mut().for_each(|cell| cell.colour = Some(colour));
        self
    }

    /// Makes all texts bold or not.
    pub fn strong(mut self, is_strong: bool) -> Self {
        self.cells.iter_mut().for_each(|cell| cell.is_strong = is_strong);
        self
    }

    /// Adds a small warning mark with this meaning after the first text; empty for none.
    pub fn mark(mut self, mark: &'a str) -> Self {
        if let Some(first) = self.cells.first_mut() {
            first.mark = mark;
        }
        self
    }

    /// Appends a cell with controls, added by `controls`.
    pub fn controls(mut self, controls: impl FnOnce(&mut Ui) + 'a) -> Self {
        self.cells.push(TableCell::controls(controls));
        self
    }

    /// Adds a dot before the first text.
    pub fn dot(mut self, dot: impl Into<Option<Color32>>) -> Self {
        if let Some(first) = self.cells.first_mut() {
            first.dot = dot.into();
        }
        self
    }
}

impl<'a> TableCell<'a> {
    /// Returns a text cell.
    pub fn new(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            ..Self::default()
        }
    }

    /// Returns a cell with controls, added by `controls`.
    pub fn controls(controls: impl FnOnce(&mut Ui) + 'a) -> Self {
        Self {
            controls: Some(Box::new(controls)),
            ..Self::default()
        }
    }

    /// Sets the colour.
    pub fn colour(self, colour: Color32) -> Self {
        Self {
            colour: Some(colour),
            ..self
        }
    }

    /// Makes the text bold or not.
    pub fn strong(self, is_strong: bool) -> Self {
        Self { is_strong, ..self }
    }

    /// Sets the tooltip; empty for none.
    pub fn meaning(self, meaning: &'a str) -> Self {
        Self { meaning, ..self }
    }
}

/// Column by which the rows are sorted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SortBy {
    /// Index of the column; `None` until the user chooses one.
    pub column: Option<usize>,
    /// True for largest first.
    pub is_descending: bool,
}

impl SortBy {
    /// Returns the row indices in this order. `cell` returns the figure of a row in a column, if it has one, and a text; rows
    /// without a figure come last, sorted by text.
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

/// Number of rows measured for the width of a column.
pub(super) const MEASURED_ROWS: usize = 100;
/// Minimum gap between columns.
const MIN_GAP: f32 = space(1);
/// Minimum gap at the default font size.
const READABLE_GAP: f32 = space(2);
/// Gap between columns if one of them takes the remaining width.
const USUAL_GAP: f32 = space(4);
/// Maximum gap in a table that fills the available width.
const MAX_GAP: f32 = space(8);
/// Minimum width of a column that takes the remaining width.
const MIN_REST: f32 = space(24);
/// Width of the arrow of a sorted column.
const ARROW: f32 = space(2);
/// Radius of the dot before a text.
pub(super) const DOT: f32 = 3.0;
/// Width of the dot and its distance from the text.
pub(super) const DOT_WIDTH: f32 = space(3);
/// Width of a mark and its distance from the text.
pub(super) const MARK_WIDTH: f32 = space(4);

/// Positions of the columns in a line, in points from its left end, and the font size.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Widths {
    pub size: f32,
    /// Left end, left end without the gap before it, and right end of each column.
    pub columns: Vec<ColumnPlace>,
    pub total: f32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ColumnPlace {
    pub gap_left: f32,
    pub left: f32,
    pub right: f32,
}

/// Input for the computation of column widths.
pub(super) struct Request<'a> {
    pub columns: &'a [TableColumn<'a>],
    pub is_sortable: bool,
    /// Margin at both ends of a line.
    pub padding: f32,
    pub available: f32,
    /// True for a table that fills the available width; limits the gaps between its columns.
    pub fills: bool,
}

impl Request<'_> {
    /// Returns widths that fill the line if possible, with a smaller font if there is less room.
    pub(super) fn widths(&self, ui: &Ui, rows: &[TableRow<'_>]) -> Widths {
        let gaps = (self.columns.len().saturating_sub(1)) as f32;
        let total = |widths: &[f32], gap: f32| widths.iter().sum::<f32>() + gap * gaps + 2.0 * self.padding;
        let (mut widths, mut size, mut min_gap) = (
            self.min_widths(ui, rows, type_size().note),
            type_size().note,
            READABLE_GAP,
        );
        if total(&widths, min_gap) > self.available {
            let small = self.min_widths(ui, rows, type_size().small);
            // A table that scrolls sideways needs no smaller font.
            if total(&small, MIN_GAP) <= self.available {
                (widths, size, min_gap) = (small, type_size().small, MIN_GAP);
            }
        }
        let left = (self.available - total(&widths, min_gap)).max(0.0);
        let is_rest = |column: &TableColumn<'_>| column.width == ColumnWidth::Rest;
        let rests = self.columns.iter().filter(|column| is_rest(column)).count();
        let share = left / gaps.max(1.0);
        let gap = min_gap
            + share.min(match (rests, self.fills) {
                (1.., _) => USUAL_GAP - min_gap,
                (0, true) => MAX_GAP - min_gap,
                (0, false) => f32::INFINITY,
            });
        if rests > 0 {
            let more = (left - (gap - min_gap) * gaps).max(0.0) / rests as f32;
            let of_rest = widths.iter_mut().zip(self.columns);
            of_rest
                .filter(|(_, column)| is_rest(column))
                .for_each(|(width, _)| *width += more);
        }
        let mut right = self.padding;
        let columns = widths.iter().enumerate().map(|(place, width)| {
            let gap_left = right;
            let left = gap_left + if place == 0 { 0.0 } else { gap };
            right = left + width;
            ColumnPlace { gap_left, left, right }
        });
        Widths {
            size,
            columns: columns.collect(),
            total: right + self.padding,
        }
    }

    /// Returns the minimum widths of the columns.
    fn min_widths(&self, ui: &Ui, rows: &[TableRow<'_>], size: f32) -> Vec<f32> {
        let width = |text: &str, font: FontId| {
            let galley = ui.painter().layout_no_wrap(text.to_owned(), font, Color32::WHITE);
            galley.size().x
        };
        let of_rows = |place: usize| {
            let rows = rows.iter().filter(|row| !row.is_section);
            let cells = rows.filter_map(|row| row.cells.get(place)).map(|cell| {
                let dot = if cell.dot.is_some() { DOT_WIDTH } else { 0.0 };
                let mark = if cell.mark.is_empty() { 0.0 } else { MARK_WIDTH };
                width(&cell.text, font(size, cell.is_strong)) + dot + mark
            });
            cells.fold(0.0, f32::max)
        };
        let of_column = |(place, column): (usize, &TableColumn<'_>)| {
            let heading = || {
                let font = font(type_size().small, self.is_sortable);
                width(column.heading, font) + if self.is_sortable { ARROW } else { 0.0 }
            };
            match column.width {
                ColumnWidth::Content => of_rows(place).max(heading()),
                ColumnWidth::Fits(text) => width(text, semibold(size)).max(heading()),
                ColumnWidth::Points(points) => points,
                ColumnWidth::Rest => MIN_REST,
            }
        };
        self.columns.iter().enumerate().map(of_column).collect()
    }
}

/// Returns the font of a cell.
pub(super) fn font(size: f32, is_strong: bool) -> FontId {
    if is_strong {
        semibold(size)
    } else {
        FontId::proportional(size)
    }
}
