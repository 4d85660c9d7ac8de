//! What all charts have in common.

use eframe::egui::Ui;
use egui_plot::{Corner, GridInput, GridMark, Legend, Plot};

use crate::app::theme::Theme;

/// The most points drawn of one curve; more would not be seen.
const MOST_POINTS: usize = 2000;

/// A chart with named axes that fills its space, moves with the pointer, and never scrolls its surroundings.
pub fn plot<'a>(ui: &Ui, id: &'static str, x_name: &'static str, y_name: &'static str) -> Plot<'a> {
    let palette = Theme::of(ui).palette;
    Plot::new(id)
        .x_axis_label(x_name)
        .y_axis_label(y_name)
        .show_background(false)
        .grid_color(palette.line)
        .allow_scroll(false)
        .show_x(false)
        .show_y(false)
        .set_margin_fraction(eframe::egui::vec2(0.02, 0.08))
}

/// A legend at the upper right.
pub fn legend() -> Legend {
    Legend::default().position(Corner::RightTop).background_alpha(0.6)
}

/// Every so many items, so that at most [`MOST_POINTS`] and the last one remain.
pub fn thinned<T: Copy>(items: &[T]) -> impl Iterator<Item = T> + '_ {
    let stride = items.len().div_ceil(MOST_POINTS).max(1);
    let is_last_extra = !items.is_empty() && !(items.len() - 1).is_multiple_of(stride);
    items
        .iter()
        .step_by(stride)
        .chain(items.last().filter(|_| is_last_extra))
        .copied()
}

/// Whole decades, for a chart that draws the decimal logarithm.
pub fn decades(input: GridInput) -> Vec<GridMark> {
    let (low, high) = input.bounds;
    let (first, last) = (low.floor(), high.ceil());
    // So few that their numbers do not touch.
    let stride = ((last - first) / 6.0).ceil().max(1.0);
    let count = ((last - first) / stride).clamp(0.0, 64.0) as usize;
    let marks = (0..=count).map(|index| first + stride * index as f64);
    marks
        .map(|value| GridMark {
            value,
            step_size: stride,
        })
        .collect()
}

/// The number at a mark of [`decades`].
pub fn decade_text(mark: GridMark) -> String {
    format!("1e{}", mark.value.round())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_both_ends() {
        let many: Vec<usize> = (0..12_345).collect();
        let thin: Vec<usize> = thinned(&many).collect();
        assert!(thin.len() <= MOST_POINTS + 1);
        assert_eq!((thin[0], thin[thin.len() - 1]), (0, 12_344));
        assert_eq!(thinned(&[7]).collect::<Vec<_>>(), [7]);
        assert_eq!(thinned::<u8>(&[]).count(), 0);
    }
}
