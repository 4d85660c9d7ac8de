//! Widths of the columns of a table.

use eframe::egui::{Color32, FontId, Ui};

use super::{ColumnWidth, TableColumn, TableRow};
use crate::window::theme::{semibold, space, type_size};

/// Rows that are measured for the width of a column.
pub(super) const MEASURED_ROWS: usize = 100;
/// Smallest gap between columns.
const MIN_GAP: f32 = space(1);
/// Smallest gap in type of the usual size.
const READABLE_GAP: f32 = space(2);
/// Gap between columns where one of them takes the rest.
const USUAL_GAP: f32 = space(4);
/// Largest gap in a table that fills its place.
const MAX_GAP: f32 = space(8);
/// Smallest width of a column that takes the rest.
const MIN_REST: f32 = space(24);
/// Width of the arrow of a sorted column.
const ARROW: f32 = space(2);
/// Radius of the dot before a text.
pub(super) const DOT: f32 = 3.0;
/// Width of the dot with its distance from the text.
pub(super) const DOT_WIDTH: f32 = space(3);
/// Width of a mark with its distance from the text.
pub(super) const MARK_WIDTH: f32 = space(4);

/// Places of the columns in a line, in points from its left end, and the size of their type.
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

/// A request for widths.
pub(super) struct Request<'a> {
    pub columns: &'a [TableColumn<'a>],
    pub is_sortable: bool,
    /// Room at both ends of a line.
    pub padding: f32,
    pub available: f32,
    /// True for a table that fills its place, whose columns do not drift apart.
    pub fills: bool,
}

impl Request<'_> {
    /// Returns widths that fill the line where they can, in smaller type where there is less room.
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
            // A table that scrolls sideways needs no smaller type.
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

    /// Smallest widths of the columns.
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

/// The font of a cell.
pub(super) fn font(size: f32, is_strong: bool) -> FontId {
    if is_strong {
        semibold(size)
    } else {
        FontId::proportional(size)
    }
}
