//! Rows and cells of a table.

use decoupler_files::export;
use eframe::egui::{Color32, Ui};

use crate::window::widgets::fields::capitalised;

/// A row, with one cell for each column; columns without a cell stay empty.
#[derive(Default)]
#[must_use = "a row shows only in a table"]
pub struct TableRow<'a> {
    /// Name in the labels of its figures; empty where these have none of their own.
    pub(super) name: String,
    /// Label of the row as a whole; empty where it is none for assistive technology.
    pub(super) label: String,
    pub(super) meaning: &'a str,
    pub(super) is_selected: bool,
    /// True for a heading across all columns.
    pub(super) is_section: bool,
    pub(super) cells: Vec<TableCell<'a>>,
}

/// Adds the controls of a cell.
type Controls<'a> = Box<dyn FnOnce(&mut Ui) + 'a>;

/// A cell of a table: a text, or controls.
#[derive(Default)]
#[must_use = "a cell shows only in a table"]
pub struct TableCell<'a> {
    pub(super) text: String,
    /// Adds the controls of the cell in place of the text.
    pub(super) controls: Option<Controls<'a>>,
    /// None for the colour of texts.
    pub(super) colour: Option<Color32>,
    pub(super) is_strong: bool,
    pub(super) meaning: &'a str,
    pub(super) dot: Option<Color32>,
    pub(super) mark: &'a str,
}

impl<'a> TableRow<'a> {
    /// A row of these cells.
    pub fn new(cells: impl IntoIterator<Item = TableCell<'a>>) -> Self {
        Self {
            cells: cells.into_iter().collect(),
            ..Self::default()
        }
    }

    /// A row of figures behind their name, which is shown with a capital.
    pub fn figures(name: impl Into<String>, figures: impl IntoIterator<Item = String>) -> Self {
        let name = name.into();
        let cells = std::iter::once(capitalised(&name)).chain(figures).map(TableCell::new);
        Self {
            cells: cells.collect(),
            name,
            ..Self::default()
        }
    }

    /// A heading across all columns.
    pub fn section(title: impl Into<String>) -> Self {
        Self {
            is_section: true,
            ..Self::new([TableCell::new(title).strong(true)])
        }
    }

    /// Returns the rows of a table that is described for every form: names in the first column, rounded figures after it.
    pub fn of_table(table: &export::Table) -> Vec<Self> {
        let row = |cells: &Vec<export::Cell>| {
            let mut texts = cells.iter().map(export::Cell::rounded);
            Self::figures(texts.next().unwrap_or_default(), texts)
        };
        table.rows.iter().map(row).collect()
    }

    /// With this name in the labels of its figures: `name, heading: figure`.
    pub fn named(self, name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            ..self
        }
    }

    /// With a label for the row as a whole.
    pub fn labelled(self, label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            ..self
        }
    }

    /// With a tooltip.
    pub fn meaning(self, meaning: &'a str) -> Self {
        Self { meaning, ..self }
    }

    /// Selected or not.
    pub fn selected(self, is_selected: bool) -> Self {
        Self { is_selected, ..self }
    }

    /// With all texts in this colour.
    pub fn colour(mut self, colour: Color32) -> Self {
        self.cells.iter_mut().for_each(|cell| cell.colour = Some(colour));
        self
    }

    /// With all texts strong or not.
    pub fn strong(mut self, is_strong: bool) -> Self {
        self.cells.iter_mut().for_each(|cell| cell.is_strong = is_strong);
        self
    }

    /// With a small warning mark behind the first text, which means this; empty for none.
    pub fn mark(mut self, mark: &'a str) -> Self {
        if let Some(first) = self.cells.first_mut() {
            first.mark = mark;
        }
        self
    }

    /// With a cell of controls behind the others, added by `controls`.
    pub fn controls(mut self, controls: impl FnOnce(&mut Ui) + 'a) -> Self {
        self.cells.push(TableCell::controls(controls));
        self
    }

    /// With a dot before the first text.
    pub fn dot(mut self, dot: impl Into<Option<Color32>>) -> Self {
        if let Some(first) = self.cells.first_mut() {
            first.dot = dot.into();
        }
        self
    }
}

impl<'a> TableCell<'a> {
    /// A text.
    pub fn new(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            ..Self::default()
        }
    }

    /// Controls, added by `controls` into the place of the cell.
    pub fn controls(controls: impl FnOnce(&mut Ui) + 'a) -> Self {
        Self {
            controls: Some(Box::new(controls)),
            ..Self::default()
        }
    }

    /// In this colour.
    pub fn colour(self, colour: Color32) -> Self {
        Self {
            colour: Some(colour),
            ..self
        }
    }

    /// Strong or not.
    pub fn strong(self, is_strong: bool) -> Self {
        Self { is_strong, ..self }
    }

    /// With a tooltip; empty for none.
    pub fn meaning(self, meaning: &'a str) -> Self {
        Self { meaning, ..self }
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
    /// Returns the rows in this order. `cell` gives the figure of a row in a column, if it has one, and a text: rows without
    /// a figure come last, by their texts.
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
