//! Tables, with a header that stays visible, text aligned left and figures aligned right.
//!
//! A short table ([`TableView::show_all`]) is as high as its rows. A table of any number of rows ([`TableView::show`]) fills
//! the available space and scrolls under its header; only visible rows are created and laid out. If the columns are too wide,
//! the font becomes smaller; if that is not enough, the table scrolls sideways.

mod row;
mod show;
#[cfg(test)]
mod tests;

use decoupler_files::export;
use eframe::egui::Ui;

pub use row::{SortBy, TableCell, TableRow};

use crate::window::theme::space;

/// Width of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ColumnWidth<'a> {
    /// As wide as the widest of its cells; for short tables, since it is measured on the first hundred rows.
    Content,
    /// As wide as this text, which must be the longest of its cells.
    Fits(&'a str),
    /// This many points.
    Points(f32),
    /// An equal share of the width that the other columns leave.
    Rest,
}

impl<'a> ColumnWidth<'a> {
    /// Returns the width of the longest of `texts`; it may be a point or two narrower than the widest, which the gap absorbs.
    pub fn of_longest(texts: impl Iterator<Item = &'a str>) -> Self {
        Self::Fits(texts.max_by_key(|text| text.chars().count()).unwrap_or_default())
    }
}

/// Column: text is aligned left, figures right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableColumn<'a> {
    heading: &'a str,
    meaning: &'a str,
    is_figure: bool,
    width: ColumnWidth<'a>,
}

impl<'a> TableColumn<'a> {
    /// Returns a text column that fits its cells.
    pub const fn text(heading: &'a str) -> Self {
        Self {
            heading,
            meaning: "",
            is_figure: false,
            width: ColumnWidth::Content,
        }
    }

    /// Returns a column of figures that fits its cells. Assistive technology reads each cell with the name of its row and this
    /// heading.
    pub const fn figure(heading: &'a str) -> Self {
        Self {
            is_figure: true,
            ..Self::text(heading)
        }
    }

    /// Sets the tooltip of the heading: the meaning of the column, and its unit.
    pub const fn meaning(self, meaning: &'a str) -> Self {
        Self { meaning, ..self }
    }

    /// Sets the width.
    pub const fn width(self, width: ColumnWidth<'a>) -> Self {
        Self { width, ..self }
    }
}

/// User action on a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableClick {
    /// Sort order chosen.
    Sort(SortBy),
    /// Row with this index selected.
    Select(usize),
}

/// Table widget.
#[derive(Clone, Copy, Debug)]
#[must_use = "a table is laid out by `show` or `show_all`"]
pub struct TableView<'a> {
    id: &'a str,
    columns: &'a [TableColumn<'a>],
    sort: Option<SortBy>,
    is_clickable: bool,
    row_height: f32,
}

impl<'a> TableView<'a> {
    /// Returns a table with these columns. `id` must be unique among the tables of the same parent.
    pub const fn new(id: &'a str, columns: &'a [TableColumn<'a>]) -> Self {
        Self {
            id,
            columns,
            sort: None,
            is_clickable: false,
            row_height: space(6),
        }
    }

    /// Makes the headings sort the table; `sort` is the current order.
    pub const fn sorted(self, sort: SortBy) -> Self {
        Self {
            sort: Some(sort),
            ..self
        }
    }

    /// Makes the rows selectable and openable.
    pub const fn clickable(self) -> Self {
        Self {
            is_clickable: true,
            ..self
        }
    }

    /// Sets the height of the rows in points, for cells with controls.
    pub const fn row_height(self, row_height: f32) -> Self {
        Self { row_height, ..self }
    }
}

/// Shows the table described by `table` over the available width.
pub fn described_table_ui(ui: &mut Ui, id: &str, table: &export::Table) {
    let titles = Vec::from_iter(table.columns.iter().map(export::TableColumn::title));
    let described = table.columns.iter().zip(&titles).enumerate();
    let columns = described.map(|(place, (column, title))| match place {
        0 => TableColumn::text(title).meaning(column.meaning),
        _ => TableColumn::figure(title).meaning(column.meaning),
    });
    TableView::new(id, &Vec::from_iter(columns)).show_all(ui, TableRow::of_table(table));
}
