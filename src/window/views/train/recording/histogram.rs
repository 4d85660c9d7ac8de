use eframe::egui::{Color32, Rect, Ui, pos2};

/// Paints a small histogram over `rect`, as high as its fullest bar.
pub(super) fn paint_histogram(ui: &Ui, rect: Rect, bars: &[usize], colour: Color32) {
    let Some(most) = bars.iter().copied().max().filter(|most| *most > 0) else {
        return;
    };
    let width = rect.width() / bars.len() as f32;
    for (place, &count) in bars.iter().enumerate() {
        if count == 0 {
            continue;
        }
        let left = rect.left() + width * place as f32;
        // One sample among thousands is still seen.
        let height = (rect.height() * count as f32 / most as f32).max(1.0);
        let top_left = pos2(left, rect.bottom() - height);
        let bar = Rect::from_min_max(top_left, pos2(left + width - 1.0, rect.bottom()));
        ui.painter().rect_filled(bar, 0.0, colour);
    }
}
