use eframe::egui::{
    Align2, Color32, CursorIcon, FontId, Rect, RichText, Sense, Stroke, StrokeKind, Ui, WidgetInfo, accesskit::Role,
    pos2, vec2,
};

use super::{ExperimentLook, Outcome, open_cell::open_cell};
use crate::{
    app::{
        shared::{Effect, Shared},
        theme::{Theme, rgb, semibold, space, type_size},
    },
    export::{format_number, format_percent},
    figure::ColourMap,
};

/// Median Z error over both axes of a sweep: dark is small. A click marks the cell, two open it in the Train view.
pub fn heat_map_ui(
    ui: &mut Ui,
    outcome: &Outcome,
    look: &mut ExperimentLook,
    shared: &Shared,
    effects: &mut Vec<Effect>,
) {
    let marked = look.marked;
    let palette = Theme::of(ui).palette;
    let experiment = &outcome.results.experiment;
    let across = &experiment.axis;
    let rows = experiment.second_axis.as_ref();
    scale_ui(ui, outcome);
    let (whole, _) = ui.allocate_exact_size(ui.available_size(), Sense::hover());
    let note = FontId::proportional(type_size().note);
    let label_width = |text: &str| {
        ui.painter()
            .layout_no_wrap(text.to_owned(), note.clone(), palette.dim)
            .size()
            .x
    };
    let row_count = rows.map_or(1, |axis| axis.len());
    let row_labels: Vec<String> = rows.map_or_else(Vec::new, |axis| (0..axis.len()).map(|at| axis.label(at)).collect());
    let left = row_labels.iter().map(|text| label_width(text)).fold(0.0, f32::max) + space(7);
    let grid = Rect::from_min_max(whole.min + vec2(left, 0.0), whole.max - vec2(space(1), space(10)));
    let (width, height) = (grid.width() / across.len() as f32, grid.height() / row_count as f32);
    let medians = || outcome.summaries.iter().filter_map(|cell| cell.z_percent.median);
    let widest = medians()
        .map(|value| label_width(&format_number(value)))
        .fold(0.0, f32::max);
    for (at, (cell, summary)) in outcome.results.cells.iter().zip(&outcome.summaries).enumerate() {
        let corner = grid.min + vec2(cell.cell.column as f32 * width, cell.cell.row as f32 * height);
        let rect = Rect::from_min_size(corner, vec2(width, height)).shrink(1.0);
        let response = ui.interact(rect, ui.scope_id().with(("heat", at)), Sense::click());
        let name = outcome.results.cell_labels(cell).join(", ");
        let value = summary.z_percent.median;
        let text = format!("{name}: median Z error {}", format_percent(value));
        response.widget_info(|| WidgetInfo::selected(Role::Button, true, marked == Some(at), &text));
        let spread = summary.z_percent.min.zip(summary.z_percent.max);
        let hover = spread.map_or(text.clone(), |(least, largest)| {
            format!("{text}\n{} to {}", format_percent(least), format_percent(largest))
        });
        let response = response.on_hover_cursor(CursorIcon::PointingHand).on_hover_text(hover);
        if response.clicked() {
            look.marked = Some(at);
        }
        if response.double_clicked() {
            open_cell(shared, outcome, at, effects);
        }
        let fill = value.map(|value| rgb(ColourMap::viridis().at(log_share(value, medians()))));
        ui.painter().rect_filled(rect, 2.0, fill.unwrap_or(palette.raised));
        if let (Some(value), Some(fill)) = (value, fill)
            && widest + space(2) < width
            && height > space(4)
        {
            let font = semibold(type_size().note);
            let text = format_number(value);
            ui.painter()
                .text(rect.center(), Align2::CENTER_CENTER, text, font, text_on(fill));
        }
        if marked == Some(at) {
            let stroke = Stroke::new(2.0, palette.text);
            ui.painter().rect_stroke(rect, 2.0, stroke, StrokeKind::Outside);
        }
    }
    // Labels, fewer where they would touch.
    let stride = |step: f32, needed: f32| ((needed / step).ceil() as usize).max(1);
    let labels: Vec<String> = (0..across.len()).map(|at| across.label(at)).collect();
    let longest = labels.iter().map(|text| label_width(text)).fold(0.0, f32::max) + space(2);
    for (at, label) in labels.iter().enumerate().step_by(stride(width, longest)) {
        let place = pos2(grid.left() + (at as f32 + 0.5) * width, grid.bottom() + space(1));
        ui.painter()
            .text(place, Align2::CENTER_TOP, label, note.clone(), palette.dim);
    }
    for (at, label) in row_labels.iter().enumerate().step_by(stride(height, space(4))) {
        let place = pos2(grid.left() - space(2), grid.top() + (at as f32 + 0.5) * height);
        ui.painter()
            .text(place, Align2::RIGHT_CENTER, label, note.clone(), palette.dim);
    }
    let small = FontId::proportional(type_size().small);
    let below = pos2(grid.center().x, whole.bottom());
    ui.painter()
        .text(below, Align2::CENTER_BOTTOM, across.name(), small.clone(), palette.text);
    if let Some(axis) = rows {
        let galley = ui.painter().layout_no_wrap(axis.name().to_owned(), small, palette.text);
        let place = pos2(whole.left(), grid.center().y + 0.5 * galley.size().x);
        let upright =
            eframe::egui::epaint::TextShape::new(place, galley, palette.text).with_angle(-std::f32::consts::FRAC_PI_2);
        ui.painter().add(upright);
    }
}

/// What the colours mean.
fn scale_ui(ui: &mut Ui, outcome: &Outcome) {
    let dim = Theme::of(ui).palette.dim;
    let text = |text: String| RichText::new(text).size(type_size().note).color(dim);
    let medians = || outcome.summaries.iter().filter_map(|cell| cell.z_percent.median);
    let least = medians().reduce(f64::min);
    let largest = medians().reduce(f64::max);
    ui.horizontal(|ui| {
        ui.label(text("Median Z error".to_owned()));
        ui.label(text(format_percent(least)));
        let (bar, _) = ui.allocate_exact_size(vec2(space(30), space(2)), Sense::hover());
        const STEPS: usize = 60;
        for step in 0..STEPS {
            let share = step as f32 / STEPS as f32;
            let left = bar.left() + share * bar.width();
            let piece = Rect::from_min_size(
                pos2(left, bar.top()),
                vec2(bar.width() / STEPS as f32 + 0.5, bar.height()),
            );
            ui.painter()
                .rect_filled(piece, 0.0, rgb(ColourMap::viridis().at(share)));
        }
        ui.label(text(format_percent(largest)));
        ui.label(text("logarithmic".to_owned()));
    });
}

/// Black or white, whichever is read better on `fill`.
fn text_on(fill: Color32) -> Color32 {
    if fill.intensity() > 0.5 {
        Color32::BLACK
    } else {
        Color32::WHITE
    }
}

/// Where `value` stands between the least and largest of `values`, by the logarithm, from 0 to 1.
fn log_share(value: f64, values: impl Iterator<Item = f64> + Clone) -> f32 {
    let positive = values.filter(|value| *value > 0.0);
    let least = positive.clone().fold(f64::INFINITY, f64::min).ln();
    let largest = positive.fold(f64::NEG_INFINITY, f64::max).ln();
    let share = (value.ln() - least) / (largest - least);
    if share.is_finite() {
        share.clamp(0.0, 1.0) as f32
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_run_from_least_to_largest_and_one_value_has_the_least() {
        let values = [0.1, 1.0, 10.0];
        let shares = values.map(|value| log_share(value, values.into_iter()));
        assert_eq!(shares, [0.0, 0.5, 1.0]);
        assert_eq!(log_share(2.0, [2.0].into_iter()), 0.0);
        assert_eq!(log_share(0.0, values.into_iter()), 0.0);
    }
}
