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
        .x_grid_spacer(round_steps)
        .y_grid_spacer(round_steps)
        .x_axis_formatter(|mark, _| step_text(mark))
        .y_axis_formatter(|mark, _| step_text(mark))
        .show_background(false)
        .grid_color(palette.line)
        .allow_scroll(false)
        .show_x(false)
        .show_y(false)
        .set_margin_fraction(eframe::egui::vec2(0.02, 0.08))
}

/// A legend at the upper right.
pub fn legend() -> Legend {
    Legend::default()
        .position(Corner::RightTop)
        .background_alpha(0.6)
        .follow_insertion_order(true)
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

/// About five marks in sight, at multiples of 1, 2 or 5 times a power of ten.
pub fn round_steps(input: GridInput) -> Vec<GridMark> {
    let (low, high) = input.bounds;
    let rough = (high - low) / 5.0;
    if !(rough.is_finite() && rough > 0.0) {
        return Vec::new();
    }
    let power = 10.0_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .map(|step| step * power)
        .into_iter()
        .find(|step| *step >= rough);
    let step = step.unwrap_or(rough);
    let first = (low / step).ceil();
    let count = ((high / step).floor() - first).clamp(0.0, 64.0) as usize;
    let marks = (0..=count).map(|index| (first + index as f64) * step);
    marks.map(|value| GridMark { value, step_size: step }).collect()
}

/// The number at a mark of [`round_steps`], with as many decimals as the step needs.
pub fn step_text(mark: GridMark) -> String {
    let decimals = (-mark.step_size.log10().floor()).clamp(0.0, 12.0) as usize;
    let text = format!("{:.decimals$}", mark.value);
    // Rounding may leave a zero with a sign.
    if text
        .trim_start_matches('-')
        .bytes()
        .all(|byte| matches!(byte, b'0' | b'.'))
    {
        text.trim_start_matches('-').to_owned()
    } else {
        text
    }
}

/// Marks for a chart that draws the decimal logarithm: whole decades, and 2 and 5 between them where few are seen.
pub fn decades(input: GridInput) -> Vec<GridMark> {
    let (low, high) = input.bounds;
    if !(low.is_finite() && high.is_finite()) {
        return Vec::new();
    }
    let steps: &[f64] = if high - low < 2.0 { &[1.0, 2.0, 5.0] } else { &[1.0] };
    // So few decades that their numbers do not touch.
    let stride = ((high - low) / 6.0).ceil().max(1.0);
    let first = (low / stride).floor() * stride;
    let count = ((high - first) / stride).clamp(0.0, 64.0) as usize;
    let decades = (0..=count).map(|index| first + stride * index as f64);
    let marks = decades.flat_map(|decade| steps.iter().map(move |step| decade + step.log10()));
    let seen = marks.filter(|mark| (low..=high).contains(mark));
    seen.map(|value| GridMark {
        value,
        step_size: stride,
    })
    .collect()
}

/// The number at a mark of [`decades`].
pub fn decade_text(mark: GridMark) -> String {
    let decade = (mark.value + 1e-9).floor();
    format!("{}e{decade}", 10.0_f64.powf(mark.value - decade).round())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_of_a_plain_axis_are_round_and_few() {
        let marks = |low, high| -> Vec<String> {
            let input = GridInput {
                bounds: (low, high),
                base_step_size: 0.1,
            };
            round_steps(input).into_iter().map(step_text).collect()
        };
        assert_eq!(marks(-0.3, 1.1), ["0.0", "0.5", "1.0"]);
        assert_eq!(marks(3.98, 5.02), ["4.0", "4.5", "5.0"]);
        assert_eq!(marks(0.0, 1000.0), ["0", "200", "400", "600", "800", "1000"]);
        assert_eq!(marks(1.0, 1.0).len(), 0);
        assert_eq!(marks(f64::NAN, 1.0).len(), 0);
    }

    #[test]
    fn marks_of_a_log_axis_lie_in_sight_and_read_as_numbers() {
        let marks = |low, high| -> Vec<String> {
            let input = GridInput {
                bounds: (low, high),
                base_step_size: 0.1,
            };
            decades(input).into_iter().map(decade_text).collect()
        };
        assert_eq!(marks(-3.2, 0.1), ["1e-3", "1e-2", "1e-1", "1e0"]);
        assert_eq!(marks(-1.1, -0.2), ["1e-1", "2e-1", "5e-1"]);
        assert!(marks(-200.0, 10.0).len() <= 8);
        assert_eq!(marks(f64::NAN, 1.0).len(), 0);
    }

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
