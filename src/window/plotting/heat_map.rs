use eframe::egui::{
    Align2, Color32, CursorIcon, FontId, Rect, Sense, Stroke, StrokeKind, Ui, WidgetInfo, accesskit::Role, vec2,
};

use super::heat_map_frame::{HeatMapFrame, widest};
use crate::window::{
    theme::{Theme, rgb, semibold, space, type_size},
    widgets::value_under,
};
use decoupler_files::{
    export::format_number,
    figure::{HeatMap, is_light},
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
