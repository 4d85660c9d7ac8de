//! The one table of the window: a head that stays in sight, names on the left, figures aligned on the right.
//!
//! A short table ([`TableView::show_all`]) is as high as its rows. A table of any number of rows ([`TableView::show`]) fills
//! its place and scrolls under its head; only the rows in view are made and laid out. Where the columns are wider than
//! their place, the type is smaller; where that is not enough, the table scrolls sideways and its first column stays in sight.

mod row;
mod show;

use crate::window::theme::space;
use decoupler_files::export;

pub use row::{SortBy, TableCell, TableRow};

/// Height of a row of text.
const ROW_HEIGHT: f32 = space(6);

/// Width of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ColumnWidth<'a> {
    /// As wide as the widest of its cells: for tables of few rows, as the first [`row::MEASURED_ROWS`] are made for it.
    Content,
    /// As wide as this text, the longest of its cells.
    Fits(&'a str),
    /// This many points.
    Points(f32),
    /// An equal share of what the other columns leave.
    Rest,
}

impl<'a> ColumnWidth<'a> {
    /// As wide as the longest of `texts`; it may be a point or two narrower than the widest, which the gap takes.
    pub fn of_longest(texts: impl Iterator<Item = &'a str>) -> Self {
        Self::Fits(texts.max_by_key(|text| text.chars().count()).unwrap_or_default())
    }
}

/// A column: texts are aligned on the left, figures on the right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableColumn<'a> {
    heading: &'a str,
    meaning: &'a str,
    is_figure: bool,
    width: ColumnWidth<'a>,
}

impl<'a> TableColumn<'a> {
    /// A column of texts, as wide as they are.
    pub const fn text(heading: &'a str) -> Self {
        Self {
            heading,
            meaning: "",
            is_figure: false,
            width: ColumnWidth::Content,
        }
    }

    /// A column of figures, as wide as they are. Assistive technology reads each cell with the name of its row and this
    /// heading.
    pub const fn figure(heading: &'a str) -> Self {
        Self {
            is_figure: true,
            ..Self::text(heading)
        }
    }

    /// With a tooltip at the heading: what the column shows, and its unit.
    pub const fn meaning(self, meaning: &'a str) -> Self {
        Self { meaning, ..self }
    }

    /// With this width.
    pub const fn width(self, width: ColumnWidth<'a>) -> Self {
        Self { width, ..self }
    }
}

/// An action of the user on a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableClick {
    /// Chose another order.
    Sort(SortBy),
    /// Selected the row in this place.
    Select(usize),
    /// Opened the row in this place by a double click.
    Open(usize),
    /// Points at the row in this place.
    Point(usize),
}

/// A table to be shown.
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
    /// A table with these columns. `id` differs from that of every other table in the same place.
    pub const fn new(id: &'a str, columns: &'a [TableColumn<'a>]) -> Self {
        Self {
            id,
            columns,
            sort: None,
            is_clickable: false,
            row_height: ROW_HEIGHT,
        }
    }

    /// With headings that sort, in this order now.
    pub const fn sorted(self, sort: SortBy) -> Self {
        Self {
            sort: Some(sort),
            ..self
        }
    }

    /// With rows that can be selected and opened.
    pub const fn clickable(self) -> Self {
        Self {
            is_clickable: true,
            ..self
        }
    }

    /// With rows of this height in points, for cells with controls.
    pub const fn row_height(self, row_height: f32) -> Self {
        Self { row_height, ..self }
    }
}

/// Lays out the table that `table` describes, as wide as its place.
pub fn described_table_ui(ui: &mut eframe::egui::Ui, id: &str, table: &export::Table) {
    let titles: Vec<String> = table.columns.iter().map(export::TableColumn::title).collect();
    let described = table.columns.iter().zip(&titles).enumerate();
    let columns: Vec<TableColumn<'_>> = described
        .map(|(place, (column, title))| match place {
            0 => TableColumn::text(title).meaning(column.meaning),
            _ => TableColumn::figure(title).meaning(column.meaning),
        })
        .collect();
    TableView::new(id, &columns).show_all(ui, TableRow::of_table(table));
}

#[cfg(test)]
mod tests;
