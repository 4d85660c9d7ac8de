use std::sync::Arc;

use eframe::egui::{Color32, Mesh, Rect, Response, Sense, Stroke, StrokeKind, Ui, WidgetInfo, accesskit::Role, vec2};

use super::heat_map_frame::HeatMapFrame;
use crate::window::{
    theme::{Theme, rgb},
    widgets::value_under,
};
use decoupler_files::{export::format_number, figure::HeatMap};

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
