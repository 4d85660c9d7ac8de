//! The frame of a heat map: names of rows and columns, and the scale of colours.

use std::f32::consts::FRAC_PI_2;

use decoupler_files::{
    export::format_number,
    figure::{HeatMap, is_light, share},
};
use eframe::egui::{
    Align2, Color32, CursorIcon, FontId, Pos2, Rect, Sense, Stroke, StrokeKind, Ui, Vec2, WidgetInfo, accesskit::Role,
    epaint::TextShape, pos2, vec2,
};

use crate::window::{
    theme::{Theme, rgb, semibold, space, type_size},
    widgets::value_under,
};

/// Click or hover on a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellPointed {
    /// Clicked it.
    Once,
    /// Clicked it twice.
    Twice,
}

/// Draws the map over the space that is left, one cell marked; returns the cell (row, column) that the user clicked.
pub fn heat_map_ui(ui: &mut Ui, map: &HeatMap, marked: Option<[usize; 2]>) -> Option<([usize; 2], CellPointed)> {
    let (palette, colours) = (Theme::of(ui).palette, map.colours.colours());
    let frame = HeatMapFrame::allocate_ui(ui, map);
    let (grid, size) = (frame.grid, frame.cell);
    let note = FontId::proportional(type_size().note);
    let numbers: Vec<String> = map.values.iter().map(|&value| format_number(value)).collect();
    let has_room = widest(ui, &numbers) + space(2) < size.x && size.y > space(4);
    let range = map.range();
    let mut pointed = None;
    for (((row, column), &value), number) in map.values.indexed_iter().zip(&numbers) {
        let corner = grid.min + vec2(column as f32, row as f32) * size;
        let cell = Rect::from_min_size(corner, size).shrink(1.0);
        let response = ui.interact(cell, ui.scope_id().with(("heat", row, column)), Sense::click());
        let is_marked = marked == Some([row, column]);
        value_under(ui, cell, number);
        let words = &map.notes[[row, column]];
        response.widget_info(|| {
            let name = words.lines().next().unwrap_or_default();
            WidgetInfo::selected(Role::Button, true, is_marked, name)
        });
        let response = response.on_hover_cursor(CursorIcon::PointingHand).on_hover_text(words);
        if response.clicked() {
            pointed = Some(([row, column], CellPointed::Once));
        }
        if response.double_clicked() {
            pointed = Some(([row, column], CellPointed::Twice));
        }
        let share = map.colour_share(value, &range);
        let fill = share.map(|share| colours.at(share as f32));
        ui.painter().rect_filled(cell, 2.0, fill.map_or(palette.raised, rgb));
        if has_room {
            let (font, colour) = match fill {
                Some(fill) if is_light(fill) => (semibold(type_size().note), Color32::BLACK),
                Some(_) => (semibold(type_size().note), Color32::WHITE),
                None => (note.clone(), palette.dim),
            };
            ui.painter()
                .text(cell.center(), Align2::CENTER_CENTER, number, font, colour);
        }
        if is_marked {
            let stroke = Stroke::new(2.0, palette.text);
            ui.painter().rect_stroke(cell, 2.0, stroke, StrokeKind::Outside);
        }
    }
    frame.decorate_ui(ui, map);
    pointed
}

/// Width of the scale of colours with its numbers and name, in points.
const SCALE_WIDTH: f32 = space(18);

/// Places of the cells of a heat map and of what surrounds them.
pub(super) struct HeatMapFrame {
    whole: Rect,
    scale: Rect,
    /// All cells.
    pub(super) grid: Rect,
    /// Size of a cell.
    pub(super) cell: Vec2,
}

impl HeatMapFrame {
    /// Takes the space that is left.
    pub(super) fn allocate_ui(ui: &mut Ui, map: &HeatMap) -> Self {
        let (whole, _) = ui.allocate_exact_size(ui.available_size(), Sense::hover());
        let (whole, scale) = whole.split_left_right_at_x(whole.right() - SCALE_WIDTH);
        let left = widest(ui, &map.rows) + space(7);
        let grid = Rect::from_min_max(whole.min + vec2(left, 0.0), whole.max - vec2(space(1), space(10)));
        let (rows, columns) = map.values.dim();
        Self {
            whole,
            scale,
            grid,
            cell: vec2(grid.width() / columns as f32, grid.height() / rows as f32),
        }
    }

    /// Names, fewer where they would touch, and the meaning of the colours.
    pub(super) fn decorate_ui(&self, ui: &Ui, map: &HeatMap) {
        let (grid, size, palette) = (self.grid, self.cell, Theme::of(ui).palette);
        let note = FontId::proportional(type_size().note);
        let stride = |step: f32, needed: f32| ((needed / step).ceil() as usize).max(1);
        let dim = |at, align, text: &str| ui.painter().text(at, align, text, note.clone(), palette.dim);
        for (at, name) in map
            .columns
            .iter()
            .enumerate()
            .step_by(stride(size.x, widest(ui, &map.columns) + space(2)))
        {
            let place = pos2(grid.left() + (at as f32 + 0.5) * size.x, grid.bottom() + space(1));
            dim(place, Align2::CENTER_TOP, name);
        }
        for (at, name) in map.rows.iter().enumerate().step_by(stride(size.y, space(4))) {
            let place = pos2(grid.left() - space(2), grid.top() + (at as f32 + 0.5) * size.y);
            dim(place, Align2::RIGHT_CENTER, name);
        }
        let small = FontId::proportional(type_size().small);
        let below = pos2(grid.center().x, self.whole.bottom());
        ui.painter()
            .text(below, Align2::CENTER_BOTTOM, &map.x_name, small, palette.text);
        upright_text(ui, &map.y_name, pos2(self.whole.left(), grid.center().y));
        scale_ui(ui, map, self.scale.with_max_y(grid.bottom()));
    }
}

/// Width of the widest of these texts, in points.
pub(super) fn widest(ui: &Ui, texts: &[String]) -> f32 {
    let font = FontId::proportional(type_size().note);
    let width = |text: &String| {
        let galley = ui
            .painter()
            .layout_no_wrap(text.clone(), font.clone(), Theme::of(ui).palette.dim);
        galley.size().x
    };
    texts.iter().map(width).fold(0.0, f32::max)
}

/// The meaning of the colours.
fn scale_ui(ui: &Ui, map: &HeatMap, place: Rect) {
    let (palette, colours) = (Theme::of(ui).palette, map.colours.colours());
    let bar = Rect::from_min_max(
        place.min + vec2(space(2), 0.0),
        pos2(place.left() + space(5), place.bottom()),
    );
    let height = bar.height();
    let pieces = (height / 2.0).ceil().max(1.0);
    for piece in 0..pieces as usize {
        let part = piece as f32 / pieces;
        let bottom = bar.bottom() - part * height;
        let piece = Rect::from_x_y_ranges(bar.x_range(), (bottom - height / pieces).max(bar.top())..=bottom);
        ui.painter().rect_filled(piece, 0.0, rgb(colours.at(part)));
    }
    let range = map.range();
    let number = f64::from(space(6) / height.max(1.0));
    let ticks = map.value_axis.ticks(&range, number * (range.end() - range.start()));
    for &tick in &ticks.places {
        let y = bar.bottom() - share(tick, &range) as f32 * height;
        let stroke = Stroke::new(1.0, palette.dim);
        ui.painter().hline(bar.right()..=bar.right() + space(1), y, stroke);
        let text = map.value_axis.tick_text(tick, ticks.step);
        let font = FontId::proportional(type_size().small);
        let at = pos2(bar.right() + space(2), y);
        ui.painter().text(at, Align2::LEFT_CENTER, text, font, palette.dim);
    }
    upright_text(ui, &map.value_axis.name, pos2(place.right() - space(3), bar.center().y));
}

/// Text that reads upwards, its left edge and middle at `at`.
fn upright_text(ui: &Ui, text: &str, at: Pos2) {
    let colour = Theme::of(ui).palette.text;
    let font = FontId::proportional(type_size().small);
    let galley = ui.painter().layout_no_wrap(text.to_owned(), font, colour);
    let place = at + vec2(0.0, 0.5 * galley.size().x);
    ui.painter()
        .add(TextShape::new(place, galley, colour).with_angle(-FRAC_PI_2));
}
