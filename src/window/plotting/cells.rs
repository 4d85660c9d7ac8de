use std::sync::Arc;

use decoupler_files::{
    export::format_number,
    figure::{HeatMap, Hue},
};
use eframe::egui::{Color32, Mesh, Rect, Response, Sense, Stroke, StrokeKind, Ui, WidgetInfo, accesskit::Role, vec2};

use super::heat_map::HeatMapFrame;
use crate::window::{
    theme::{Palette, Theme, rgb},
    widgets::value_under,
};

/// Draws a map that changes all the time over the space that is left, as a picture called `label`: its cells have no
/// numbers and are painted at once, however many they are. `marked` are the rows and columns to point out, from 0, and their
/// colour.
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
    // A click picks a cell; by keys it is picked elsewhere.
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
    // Cells stand apart by a hairline where there is room for it.
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

/// Keeps of the points of a line, which runs from left to right, those that are seen: of each column of pixels, `column`
/// wide, the first and the last and between them the lowest and the highest.
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

/// A hue in the theme.
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
    fn every_column_of_pixels_is_painted_as_with_all_points() {
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
    fn few_points_stay_as_they_are() {
        let points = vec![[0.0, 1.0], [1.0, 2.0], [1.0, 3.0]];
        assert_eq!(per_pixel(points.clone(), 100.0), points);
        assert_eq!(per_pixel(points.clone(), 0.0), points);
        assert_eq!(per_pixel(points.clone(), f64::NAN), points);
    }
}
