use super::{
    canvas::{Anchor, Area, CHARACTER, Canvas, TEXT},
    frame::{COLOUR_BAR_WIDTH, draw_colour_bar},
    picture::{INK, MISSING, Picture, contrast},
};
use crate::{export::format_number, figure::HeatMap};

const WIDTH: f64 = 360.0;
const ROW: f64 = 24.0;

impl HeatMap {
    /// Draws the figure.
    pub fn draw(&self) -> Picture {
        let longest = |names: &[String]| names.iter().map(|name| name.chars().count()).max().unwrap_or(0);
        let (rows, columns) = self.values.dim();
        let left = 26.0 + CHARACTER * longest(&self.rows) as f64;
        let width = WIDTH - left - COLOUR_BAR_WIDTH - 16.0;
        // Names that do not fit side by side stand upright.
        let column = width / columns.max(1) as f64;
        let name = CHARACTER * longest(&self.columns) as f64;
        let is_upright = name > column - 4.0;
        let names = if is_upright { name + 8.0 } else { 2.0 * TEXT };
        let height = (ROW * rows as f64).max(100.0);
        let area = Area {
            left,
            top: 12.0,
            width,
            height,
        };
        let mut canvas = Canvas::new(WIDTH, area.bottom() + names + 2.5 * TEXT);
        let range = self.range();
        let colours = self.colours.colours();
        for ((row, at), &value) in self.values.indexed_iter() {
            let cell = Area {
                left: area.left + column * at as f64,
                top: area.top + height / rows as f64 * row as f64,
                width: column,
                height: height / rows as f64,
            };
            let share = self.colour_share(value, &range);
            let colour = share.map_or(MISSING, |share| colours.at(share as f32));
            canvas.block(cell, colour);
            let text = format_number(value);
            if CHARACTER * text.chars().count() as f64 <= column {
                canvas.text(cell.centre(), Anchor::Middle, contrast(colour), &text);
            }
        }
        for (at, name) in self.columns.iter().enumerate() {
            let x = area.left + column * (at as f64 + 0.5);
            if is_upright {
                canvas.upright_text([x, area.bottom() + 0.5 * names], INK, name);
            } else {
                canvas.text([x, area.bottom() + TEXT], Anchor::Middle, INK, name);
            }
        }
        for (at, name) in self.rows.iter().enumerate() {
            let y = area.top + height / rows as f64 * (at as f64 + 0.5);
            canvas.text([area.left - 5.0, y], Anchor::End, INK, name);
        }
        let [middle_x, middle_y] = area.centre();
        canvas.text(
            [middle_x, area.bottom() + names + TEXT],
            Anchor::Middle,
            INK,
            &self.x_name,
        );
        canvas.upright_text([12.0, middle_y], INK, &self.y_name);
        draw_colour_bar(
            &mut canvas,
            area.right() + 12.0,
            area.top,
            area.height,
            (&self.value_axis, colours),
            &range,
        );
        canvas.finish()
    }
}
