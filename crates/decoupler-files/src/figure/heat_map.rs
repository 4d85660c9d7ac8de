//! Values over two axes as colours.

use std::ops::RangeInclusive;

use decoupler_core::text::format_number;
use glam::Vec2;
use ndarray::Array2;

use super::{
    Ink,
    axis::{PlotAxis, ends, share},
    colour_map::{SequentialMap, is_light},
    drawing::{Align, Bounds, Measure, Shape, lay_out_scale},
    extremes,
};

/// A heat map: values over two axes as colours, with the number in each cell.
#[derive(Clone, Debug, PartialEq)]
pub struct HeatMap {
    /// Name of the columns' quantity.
    pub x_name: String,
    /// Name of the rows' quantity.
    pub y_name: String,
    /// Value of each column, as text.
    pub columns: Vec<String>,
    /// Value of each row, as text; the first is at the top.
    pub rows: Vec<String>,
    /// Rows × columns; NaN where there is none.
    pub values: Array2<f64>,
    /// Note on each cell, rows × columns.
    pub notes: Array2<String>,
    /// Name of the values, and the axis of the colour scale.
    pub value_axis: PlotAxis,
    /// Colours of the values.
    pub colours: SequentialMap,
}

/// A heat map laid out in a rectangle.
#[derive(Clone, Debug)]
pub struct HeatMapDrawing {
    /// All shapes.
    pub shapes: Vec<Shape>,
    /// All cells.
    pub grid: Bounds,
    /// Size of a cell.
    cell: Vec2,
}

impl HeatMapDrawing {
    /// Returns the rectangle of these rows and columns, each as the first and the number.
    pub fn cells(&self, [row, rows]: [usize; 2], [column, columns]: [usize; 2]) -> Bounds {
        let corner = self.grid.min + self.cell * Vec2::new(column as f32, row as f32);
        Bounds::of_size(corner, self.cell * Vec2::new(columns as f32, rows as f32))
    }

    /// Returns the cell (row, column) at a point; `None` outside the grid.
    pub fn cell_at(&self, point: Vec2) -> Option<[usize; 2]> {
        let place = (point - self.grid.min) / self.cell;
        let last = (self.grid.size() / self.cell).round() - 1.0;
        let cell = place.floor().min(last);
        self.grid.contains(point).then_some([cell.y as usize, cell.x as usize])
    }
}

/// Width of the colour scale.
const SCALE: f32 = 76.0;
/// Room between a name and the grid.
const GAP: f32 = 6.0;

impl HeatMap {
    /// The map in these colours.
    #[must_use]
    pub fn coloured(mut self, colours: SequentialMap) -> Self {
        self.colours = colours;
        self
    }

    /// Returns the position of a value on the scale of colours over `range`, from 0 to 1; `None` for no value.
    pub fn colour_share(&self, value: f64, range: &RangeInclusive<f64>) -> Option<f64> {
        match self.value_axis.place(value) {
            Some(place) => Some(share(place, range)),
            // A zero on a logarithmic colour scale.
            None if value.is_finite() => Some(0.0),
            None => None,
        }
    }

    /// Returns the range of places that the colours span: those of the values and of the values that the axis includes.
    pub fn range(&self) -> RangeInclusive<f64> {
        let values = self.values.iter().chain(&self.value_axis.includes);
        let places = values.filter_map(|&value| self.value_axis.place(value));
        match ends(places) {
            (low, high) if low < high => low..=high,
            (low, high) if low == high => low - 0.5..=high + 0.5,
            _ => 0.0..=1.0,
        }
    }

    /// Lays the map out in `area`, with the numbers in the cells if they fit and names thinned out where they would touch.
    /// Names of columns that do not fit side by side are upright, unless they are numbers.
    pub fn lay_out(&self, area: Bounds, measure: Measure<'_>) -> HeatMapDrawing {
        let widest = |texts: &[String]| texts.iter().map(|text| measure(text).x).fold(0.0, f32::max);
        let line = measure("0").y;
        let (rows, columns) = self.values.dim();
        let left = area.min.x + line + 2.0 * GAP + widest(&self.rows);
        let right = (area.max.x - SCALE).max(left + 1.0);
        let pitch = (right - left) / columns.max(1) as f32;
        let column_name = widest(&self.columns);
        let are_numbers = self.columns.iter().all(|name| name.parse::<f64>().is_ok());
        let is_upright = column_name + GAP > pitch && !are_numbers;
        let below = if is_upright { column_name } else { line } + line + 2.0 * GAP;
        let bottom = (area.max.y - below).max(area.min.y + line);
        // The uppermost number of the scale is centred on its end.
        let grid = Bounds::of([Vec2::new(left, area.min.y + 0.5 * line), Vec2::new(right, bottom)]);
        let cell = grid.size() / Vec2::new(columns.max(1) as f32, rows.max(1) as f32);
        let mut drawing = HeatMapDrawing {
            shapes: Vec::with_capacity(self.values.len()),
            grid,
            cell,
        };
        let numbers: Vec<String> = self.values.iter().map(|&value| format_number(value)).collect();
        let has_room = cell.y > line + 2.0 && widest(&numbers) + GAP < cell.x;
        // Cells are separated by a hairline where there is room for it.
        let gap = if cell.min_element() > 4.0 { 0.5 } else { 0.0 };
        let (range, colours) = (self.range(), self.colours.colours());
        let mut texts = Vec::new();
        let mut write = |x: f32, y: f32, align, ink, text: &str| {
            texts.push(Shape::text(Vec2::new(x, y), align, ink, text));
        };
        for (((row, column), &value), number) in self.values.indexed_iter().zip(numbers) {
            let bounds = drawing.cells([row, 1], [column, 1]).grown(-gap);
            let fill = self.colour_share(value, &range).map(|share| colours.at(share as f32));
            drawing.shapes.push(bounds.area(fill.map_or(Ink::Missing, Ink::Rgb)));
            let ink = match fill {
                Some(fill) if is_light(fill) => Ink::BLACK,
                Some(_) => Ink::WHITE,
                None => Ink::Grey,
            };
            if has_room {
                write(bounds.middle().x, bounds.middle().y, Align::Middle, ink, &number);
            }
        }
        let every = |step: f32, needed: f32| ((needed / step).ceil() as usize).max(1);
        let (align, height, needed) = match is_upright {
            true => (Align::Upright, column_name, line),
            false => (Align::Middle, line, column_name + GAP),
        };
        for (at, name) in self.columns.iter().enumerate().step_by(every(cell.x, needed)) {
            let x = grid.min.x + (at as f32 + 0.5) * cell.x;
            write(x, grid.max.y + GAP + 0.5 * height, align, Ink::Label, name);
        }
        for (at, name) in self.rows.iter().enumerate().step_by(every(cell.y, line)) {
            let y = grid.min.y + (at as f32 + 0.5) * cell.y;
            write(grid.min.x - GAP, y, Align::End, Ink::Label, name);
        }
        let (middle, [left, bottom]) = (grid.middle(), [area.min.x + 0.5 * line, area.max.y - 0.5 * line]);
        write(middle.x, bottom, Align::Middle, Ink::Label, &self.x_name);
        write(left, middle.y, Align::Upright, Ink::Label, &self.y_name);
        drawing.shapes.extend(texts);
        let scale = Bounds::of([Vec2::new(grid.max.x, grid.min.y), Vec2::new(area.max.x, grid.max.y)]);
        let scale = lay_out_scale(scale, &self.value_axis, &range, colours, measure);
        drawing.shapes.extend(scale);
        drawing
    }

    /// Describes the map in a sentence: its values, and the places of their minimum and maximum.
    pub fn summary(&self) -> String {
        let ((rows, columns), x_name, y_name) = (self.values.dim(), &self.x_name, &self.y_name);
        let name = &self.value_axis.name;
        let head = format!("{name} over {y_name} and {x_name}, {rows} × {columns}");
        let finite = self.values.indexed_iter().filter(|(_, value)| value.is_finite());
        let Some((least, largest)) = extremes(finite, |(_, value)| **value) else {
            return format!("{head}: no values.");
        };
        let at = |((row, column), &value): ((usize, usize), &f64)| {
            let (value, row, column) = (
                self.value_axis.value_text(value),
                &self.rows[row],
                &self.columns[column],
            );
            format!("{value} at {y_name} {row}, {x_name} {column}")
        };
        format!("{head}: from {} to {}.", at(least), at(largest))
    }
}
