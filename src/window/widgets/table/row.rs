//! Rows and cells of a table, and the order of its rows.

use decoupler_files::export;
use eframe::egui::{Color32, Ui};

use crate::window::widgets::fields::capitalised;

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
    pub(super) dot: Option<Color32>,
    pub(super) mark: &'a str,
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
        let texts = std::iter::once(capitalised(&name)).chain(figures);
        Self::new(texts.map(TableCell::new)).named(name)
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

    /// Gives the first text the colour of warnings, with this meaning; empty for none.
    pub fn mark(self, mark: &'a str) -> Self {
        Self { mark, ..self }
    }

    /// Appends a cell with controls, added by `controls`.
    pub fn controls(mut self, controls: impl FnOnce(&mut Ui) + 'a) -> Self {
        self.cells.push(TableCell::controls(controls));
        self
    }

    /// Adds a dot before the first text.
    pub fn dot(self, dot: impl Into<Option<Color32>>) -> Self {
        Self {
            dot: dot.into(),
            ..self
        }
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
