//! Heat maps with names of rows and columns and a colour scale.

use std::{f32::consts::FRAC_PI_2, sync::Arc};

use decoupler_files::{
    export::format_number,
    figure::{HeatMap, Hue, is_light, share},
};
use eframe::egui::{
    Align2, Color32, CursorIcon, FontId, Mesh, Pos2, Rect, Response, Sense, Stroke, StrokeKind, Ui, Vec2, WidgetInfo,
    accesskit::Role, epaint::TextShape, pos2, vec2,
};

use crate::window::{
    theme::{Palette, Theme, rgb, semibold, space, type_size},
    widgets::value_under,
};

/// Click or hover on a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellPointed {
    /// Clicked.
    Once,
    /// Double-clicked.
    Twice,
}

/// Draws the map in the remaining space, with an optional `marked` cell; returns the cell (row, column) that the user clicked.
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
        let tooltip = &map.notes[[row, column]];
        response.widget_info(|| {
            let name = tooltip.lines().next().unwrap_or_default();
            WidgetInfo::selected(Role::Button, true, is_marked, name)
        });
        let response = response
            .on_hover_cursor(CursorIcon::PointingHand)
            .on_hover_text(tooltip);
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

/// Width of the colour scale with its numbers and name, in points.
const SCALE_WIDTH: f32 = space(18);

/// Layout of a heat map: its cells, names and colour scale.
pub(super) struct HeatMapFrame {
    whole: Rect,
    scale: Rect,
    /// All cells.
    pub(super) grid: Rect,
    /// Size of a cell.
    pub(super) cell: Vec2,
}

impl HeatMapFrame {
    /// Allocates the remaining space.
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

    /// Draws the names, some left out where they would touch, and the colour scale.
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

/// Returns the width of the widest of these texts, in points.
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

/// Draws the colour scale.
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

/// Draws text that reads upwards, with the middle of its left edge at `at`.
fn upright_text(ui: &Ui, text: &str, at: Pos2) {
    let colour = Theme::of(ui).palette.text;
    let font = FontId::proportional(type_size().small);
    let galley = ui.painter().layout_no_wrap(text.to_owned(), font, colour);
    let place = at + vec2(0.0, 0.5 * galley.size().x);
    ui.painter()
        .add(TextShape::new(place, galley, colour).with_angle(-FRAC_PI_2));
}

/// Draws a live map in the remaining space, as a picture called `label`: its cells have no text and are painted at once,
/// however many there are. `marked` are the rows and columns to highlight, from 0, and their colour.
/// Returns the cell (row, column) under the pointer.
pub fn cells_ui(
    ui: &mut Ui,
    label: &str,
    map: &HeatMap,
    marked: (&[usize], &[usize], Color32),
) -> Option<([usize; 2], Response)> {
    let (palette, colours) = (Theme::of(ui).palette, map.colours.colours());
    let frame = HeatMapFrame::allocate_ui(ui, map);
    let (grid, size) = (frame.grid, frame.cell);
    // A click selects a cell; keyboard selection is handled elsewhere.
    let response = ui.interact(grid, ui.scope_id().with(("cells", label)), Sense::HOVER | Sense::CLICK);
    response.widget_info(|| WidgetInfo::labeled(Role::Image, true, label));
    ui.ctx().accesskit_node_builder(response.id, |node| {
        node.set_description(map.summary());
        let values = map.values.iter().filter(|value| value.is_finite());
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(low, high), &value| {
            (low.min(value), high.max(value))
        });
        if low <= high {
            let name = &map.value_axis.name;
            node.set_value(format!("{name}: {} to {}", format_number(low), format_number(high)));
        }
    });
    if !ui.is_rect_visible(grid) || !grid.is_positive() {
        return None;
    }
    let range = map.range();
    let mut mesh = Mesh::default();
    mesh.reserve_vertices(4 * map.values.len());
    mesh.reserve_triangles(2 * map.values.len());
    // Cells are separated by a hairline where there is room for it.
    let gap = if size.min_elem() > 4.0 { 0.5 } else { 0.0 };
    for ((row, column), &value) in map.values.indexed_iter() {
        let corner = grid.min + vec2(column as f32, row as f32) * size;
        let share = map.colour_share(value, &range);
        let fill = share.map_or(palette.raised, |share| rgb(colours.at(share as f32)));
        mesh.add_colored_rect(Rect::from_min_size(corner, size).shrink(gap), fill);
    }
    ui.painter().add(Arc::new(mesh));
    let stroke = Stroke::new(2.0, marked.2);
    let outline = |rect: Rect| ui.painter().rect_stroke(rect, 2.0, stroke, StrokeKind::Outside);
    for &row in marked.0 {
        let top = grid.top() + row as f32 * size.y;
        outline(Rect::from_x_y_ranges(grid.x_range(), top..=top + size.y));
    }
    for &column in marked.1 {
        let left = grid.left() + column as f32 * size.x;
        outline(Rect::from_x_y_ranges(left..=left + size.x, grid.y_range()));
    }
    frame.decorate_ui(ui, map);
    let at = (response.hover_pos()? - grid.min) / size;
    let (rows, columns) = map.values.dim();
    let cell = [(at.y as usize).min(rows - 1), (at.x as usize).min(columns - 1)];
    value_under(ui, grid, &format_number(map.values[cell]));
    Some((cell, response))
}

/// Decimates the points of a line that runs from left to right: in each column of pixels, `column` wide, keeps the first,
/// last, lowest and highest point.
pub(super) fn per_pixel(points: Vec<[f64; 2]>, column: f64) -> Vec<[f64; 2]> {
    if !(column.is_finite() && column > 0.0) {
        return points;
    }
    let column_of = |point: &[f64; 2]| (point[0] / column).floor();
    let mut kept = Vec::with_capacity(points.len());
    for points in points.chunk_by(|one, other| column_of(one) == column_of(other)) {
        if points.len() <= 4 {
            kept.extend_from_slice(points);
            continue;
        }
        let by_height = |one: &(usize, &[f64; 2]), other: &(usize, &[f64; 2])| one.1[1].total_cmp(&other.1[1]);
        let numbered = || points.iter().enumerate();
        let lowest = numbered().min_by(by_height).map_or(0, |(place, _)| place);
        let highest = numbered().max_by(by_height).map_or(0, |(place, _)| place);
        let mut places = [0, lowest, highest, points.len() - 1];
        places.sort_unstable();
        for (number, &place) in places.iter().enumerate() {
            if number == 0 || places[number - 1] != place {
                kept.push(points[place]);
            }
        }
    }
    kept
}

/// Returns the colour of a hue in the theme.
pub fn hue_colour(hue: Hue, palette: &Palette) -> Color32 {
    match hue {
        Hue::Blue => palette.accent,
        Hue::Red => palette.bad,
        Hue::Green => palette.good,
        Hue::Orange => palette.warning,
        Hue::Violet => palette.violet,
        Hue::Cyan => palette.cyan,
        Hue::Grey => palette.dim,
        Hue::Ink => palette.text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimation_preserves_every_column_of_pixels() {
        let points: Vec<[f64; 2]> = (0..100_000)
            .map(|at| {
                [
                    f64::from(at),
                    if at == 54_321 {
                        9.0
                    } else {
                        (f64::from(at) * 0.37).sin()
                    },
                ]
            })
            .collect();
        let column = 100_000.0 / 700.0;
        let kept = per_pixel(points.clone(), column);
        assert!(kept.len() <= 4 * 701, "{}", kept.len());
        assert!(
            kept.windows(2).all(|pair| pair[0][0] < pair[1][0]),
            "in order, none twice"
        );
        let span = |points: &[[f64; 2]], number: usize| {
            let inside = points.iter().filter(|point| (point[0] / column) as usize == number);
            inside.fold((f64::MAX, f64::MIN), |(low, high), point| {
                (low.min(point[1]), high.max(point[1]))
            })
        };
        for number in (0..700).step_by(23).chain([380]) {
            assert_eq!(span(&kept, number), span(&points, number), "column {number}");
        }
        assert!(kept.iter().any(|point| point[1] == 9.0));
    }

    #[test]
    fn few_points_are_not_decimated() {
        let points = vec![[0.0, 1.0], [1.0, 2.0], [1.0, 3.0]];
        assert_eq!(per_pixel(points.clone(), 100.0), points);
        assert_eq!(per_pixel(points.clone(), 0.0), points);
        assert_eq!(per_pixel(points.clone(), f64::NAN), points);
    }
}
