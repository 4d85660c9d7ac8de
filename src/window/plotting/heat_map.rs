//! Heat maps, whose cells answer to the pointer.

use decoupler_files::{export::format_number, figure::HeatMap};
use eframe::egui::{Color32, Rect, Response, Sense, Stroke, StrokeKind, Ui, WidgetInfo, accesskit::Role};

use super::paint::{bounds, measure, paint_over, rect, to_glam};

/// Draws a map in the remaining space, as a picture called `label`, however many cells there are. `marked` are the
/// rows and columns to highlight, from 0, and their colour. Returns the cell (row, column) under the pointer.
pub fn cells_ui(
    ui: &mut Ui,
    label: &str,
    map: &HeatMap,
    marked: (&[usize], &[usize], Color32),
) -> Option<([usize; 2], Response)> {
    let (whole, _) = ui.allocate_exact_size(ui.available_size(), Sense::hover());
    let painter = ui.painter();
    let drawing = map.lay_out(bounds(whole), &|text| measure(painter, text));
    paint_over(ui, whole.intersect(ui.clip_rect()), &drawing.shapes);
    let grid = rect(drawing.grid);
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
    let (rows, columns) = map.values.dim();
    let marked_rows = marked.0.iter().map(|&row| ([row, 1], [0, columns]));
    let marked_columns = marked.1.iter().map(|&column| ([0, rows], [column, 1]));
    for (rows, columns) in marked_rows.chain(marked_columns) {
        outline(ui, rect(drawing.cells(rows, columns)), marked.2);
    }
    let cell = drawing.cell_at(to_glam(response.hover_pos()?))?;
    Some((cell, response))
}

fn outline(ui: &Ui, cells: Rect, colour: Color32) {
    ui.painter()
        .rect_stroke(cells, 2.0, Stroke::new(2.0, colour), StrokeKind::Outside);
}
