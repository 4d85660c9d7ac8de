//! Words at upright reference lines.

use eframe::egui::{FontId, Id, Pos2, Rect, Sense, Ui, Vec2, WidgetInfo, accesskit::Role, pos2};
use egui_plot::{PlotPoint as Place, PlotTransform};

use crate::window::theme::{Theme, space, type_size};
use decoupler_files::figure::{LineAt, Plot};

/// Shows the words of each line at one of its ends; the pointer on them reads the line's whole name.
pub(super) fn labels_ui(ui: &Ui, plot: &Plot, transform: &PlotTransform, id: Id) {
    let palette = Theme::of(ui).palette;
    let frame = *transform.frame();
    let painter = ui.painter().with_clip_rect(frame);
    if plot.lines.iter().all(|line| line.label.is_none()) {
        return;
    }
    let placed = plot.series.iter().flat_map(|series| plot.placed(series));
    let points: Vec<Pos2> = placed
        .map(|(_, [x, y])| transform.position_from_point(&Place::new(x, y)))
        .collect();
    for (number, line) in plot.lines.iter().enumerate() {
        let (Some(label), LineAt::X(value)) = (&line.label, line.at) else {
            continue;
        };
        let Some(place) = plot.x.place(value) else { continue };
        let x = transform.position_from_point(&Place::new(place, 0.0)).x;
        if !frame.x_range().contains(x) {
            continue;
        }
        let font = FontId::proportional(type_size().small);
        let galley = painter.layout_no_wrap(label.clone(), font, palette.text);
        let rect = place_beside(x, galley.size(), frame, &points);
        painter.galley(rect.min, galley, palette.text);
        let response = ui.interact(rect, id.with(("line", number)), Sense::hover());
        response.widget_info(|| WidgetInfo::labeled(Role::Label, true, &line.name));
        response.on_hover_text(&line.name);
    }
}

/// Place of the words at an upright line: at its upper end, at the right, where they fit and cover no point; else at another
/// end or side.
fn place_beside(x: f32, size: Vec2, frame: Rect, points: &[Pos2]) -> Rect {
    let (right, left) = (x + space(1), x - space(1) - size.x);
    let (top, bottom) = (frame.top() + 1.0, frame.bottom() - 1.0 - size.y);
    let places = [(right, top), (left, top), (right, bottom), (left, bottom)];
    let places = places.map(|(x, y)| Rect::from_min_size(pos2(x, y), size));
    let fits = |rect: &&Rect| frame.x_range().contains(rect.left()) && frame.x_range().contains(rect.right());
    // Markers reach beyond their points.
    let is_free = |rect: &&Rect| !points.iter().any(|point| rect.expand(space(2)).contains(*point));
    let mut fitting = places.iter().filter(fits);
    let free = fitting.clone().find(is_free);
    *free.or(fitting.next()).unwrap_or(&places[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_at_a_line_cover_no_point_where_there_is_another_place() {
        let frame = Rect::from_min_max(pos2(100.0, 50.0), pos2(500.0, 250.0));
        let size = Vec2::new(40.0, 12.0);
        let place = |x: f32, points: &[Pos2]| place_beside(x, size, frame, points);
        assert_eq!(
            place(200.0, &[]).min,
            pos2(204.0, 51.0),
            "at the right of the upper end"
        );
        assert_eq!(place(480.0, &[]).right(), 476.0, "no room at the right");
        let point = pos2(220.0, 56.0);
        assert_eq!(place(200.0, &[point]).right(), 196.0, "a point at the right");
        let below = place(110.0, &[pos2(130.0, 56.0)]);
        assert_eq!(
            (below.left(), below.bottom()),
            (114.0, 249.0),
            "no room at the left either"
        );
        let everywhere: Vec<Pos2> = (0..400)
            .map(|at| pos2(100.0 + (at % 20) as f32 * 20.0, 50.0 + (at / 20) as f32 * 10.0))
            .collect();
        assert_eq!(
            place(200.0, &everywhere).min,
            pos2(204.0, 51.0),
            "where every place covers one, the first"
        );
    }
}
