//! What all charts have in common.

use eframe::egui::{FontId, Rangef, RichText, Ui};
use egui_plot::{AxisHints, GridInput, GridMark, HoverPosition, Plot};

use crate::app::{
    theme::{Theme, type_size},
    ticks::{multiples, step_for, tick_text},
};

/// The most points drawn of one curve; more would not be seen.
const MOST_POINTS: usize = 2000;

/// The most parts into which marks divide an axis; and what the number at a mark takes with the room around it, in points.
const MOST_MARKS: f64 = 7.0;
const NUMBER_WIDTH: f64 = 50.0;
const NUMBER_HEIGHT: f64 = 16.0;
/// The least distance of grid lines, in points; the plot tells its scale by it.
const LEAST_GRID: f32 = 8.0;

/// A chart with named axes that fills its space, moves with the pointer, and never scrolls its surroundings.
pub fn plot<'a>(ui: &Ui, id: &'static str, x_name: &str, y_name: &str) -> Plot<'a> {
    let palette = Theme::of(ui).palette;
    let axis = |axis: AxisHints<'a>, name: &str, apart: f32| {
        axis.label(RichText::new(name).size(type_size().small).color(palette.dim))
            .formatter(|mark, _| tick_text(mark.value, mark.step_size))
            // Numbers are as bright as they come wherever they fit.
            .label_spacing(Rangef::new(apart, apart + 1.0))
            .tick_label_color(palette.dim)
            .tick_label_font(FontId::proportional(type_size().small))
    };
    Plot::new(id)
        .custom_x_axes(vec![axis(AxisHints::new_x(), x_name, 24.0)])
        .custom_y_axes(vec![axis(AxisHints::new_y(), y_name, 12.0)])
        .x_grid_spacer(|input| round_marks(&input, NUMBER_WIDTH))
        .y_grid_spacer(|input| round_marks(&input, NUMBER_HEIGHT))
        .grid_spacing(Rangef::new(LEAST_GRID, 300.0))
        .show_background(false)
        .grid_color(palette.line)
        .allow_scroll(false)
        .show_crosshair(false)
        .label_formatter(|_: &HoverPosition<'_>| None)
        .set_margin_fraction(eframe::egui::vec2(0.02, 0.08))
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

/// A few marks in sight, at round numbers, fewer where they would be nearer than so many points.
pub fn round_marks(input: &GridInput, apart: f64) -> Vec<GridMark> {
    let (low, high) = input.bounds;
    let width = high - low;
    if !(width.is_finite() && width > 0.0) {
        return Vec::new();
    }
    let parts = (width / value_of(apart, input)).clamp(1.0, MOST_MARKS) as usize;
    marks_of_step(input.bounds, step_for(&(low..=high), parts))
}

/// As [`round_marks`] for an upright axis that counts.
pub fn whole_marks(input: GridInput) -> Vec<GridMark> {
    match round_marks(&input, NUMBER_HEIGHT).first() {
        Some(mark) => marks_of_step(input.bounds, mark.step_size.max(1.0)),
        None => Vec::new(),
    }
}

fn marks_of_step((low, high): (f64, f64), step_size: f64) -> Vec<GridMark> {
    let marks = multiples(&(low..=high), step_size).into_iter();
    marks.map(|value| GridMark { value, step_size }).collect()
}

/// Marks for an upright axis that shows the decimal logarithm: whole decades, 2 and 5 between them where there is room,
/// and round numbers within less than a decade.
pub fn log_marks(input: GridInput) -> Vec<GridMark> {
    log_marks_apart(&input, NUMBER_HEIGHT)
}

/// As [`log_marks`] for an axis across.
pub fn log_marks_across(input: GridInput) -> Vec<GridMark> {
    log_marks_apart(&input, NUMBER_WIDTH)
}

fn log_marks_apart(input: &GridInput, apart: f64) -> Vec<GridMark> {
    let (low, high) = input.bounds;
    if !(low.is_finite() && high.is_finite() && high > low) {
        return Vec::new();
    }
    if high - low < 0.9 {
        return marks_within_a_decade(input, apart);
    }
    let line = value_of(apart, input);
    let has_room = 2.0_f64.log10() > line;
    let steps: &[f64] = if has_room { &[1.0, 2.0, 5.0] } else { &[1.0] };
    // So few decades that their numbers do not touch.
    let stride = ((high - low) / 4.0).floor().max(line.ceil()).max(1.0);
    let first = (low / stride).floor() * stride;
    let count = ((high - first) / stride).clamp(0.0, 64.0) as usize;
    let decades = (0..=count).map(|index| first + stride * index as f64);
    let marks = decades.flat_map(|decade| steps.iter().map(move |step| decade + step.log10()));
    let seen = marks.filter(|mark| (low..=high).contains(mark));
    let step_size = if has_room { 2.0_f64.log10() } else { stride };
    seen.map(|value| GridMark { value, step_size }).collect()
}

fn marks_within_a_decade(input: &GridInput, apart: f64) -> Vec<GridMark> {
    let (low, high) = (10.0_f64.powf(input.bounds.0), 10.0_f64.powf(input.bounds.1));
    // The upper end is the more crowded one.
    let number = high - 10.0_f64.powf(input.bounds.1 - value_of(apart, input));
    let parts = ((high - low) / number).clamp(1.0, MOST_MARKS) as usize;
    let step = step_for(&(low..=high), parts);
    let marks = multiples(&(low..=high), step).into_iter();
    let mark = |value: f64| GridMark {
        value: value.log10(),
        step_size: (1.0 + step / high).log10(),
    };
    marks.map(mark).filter(|mark| mark.value.is_finite()).collect()
}

/// How much a length on the screen, in points, is on the axis.
fn value_of(points: f64, input: &GridInput) -> f64 {
    input.base_step_size * points / f64::from(LEAST_GRID)
}

/// The number at a mark of [`log_marks`], given its decimal logarithm: `0.02`, `5e-4`, `1e80`.
pub fn log_text(log: f64) -> String {
    // Three digits tell any two marks apart. The exponent is split off before 10 to its power overflows.
    let decade = (log + 1e-9).floor();
    let digits = format!("{:.2}", 10.0_f64.powf(log - decade));
    let digits = digits.trim_end_matches('0').trim_end_matches('.');
    if (-3.0..5.0).contains(&decade) {
        let text = format!("{:.*}", (2.0 - decade).max(0.0) as usize, 10.0_f64.powf(log));
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        }
    } else {
        format!("{digits}e{decade}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An axis `points` long.
    fn input(low: f64, high: f64, points: f64) -> GridInput {
        GridInput {
            bounds: (low, high),
            base_step_size: (high - low) * f64::from(LEAST_GRID) / points,
        }
    }

    #[test]
    fn marks_of_a_plain_axis_are_round_and_few() {
        let marks = |low, high, points| -> Vec<String> {
            let marks = round_marks(&input(low, high, points), NUMBER_WIDTH).into_iter();
            marks.map(|mark| tick_text(mark.value, mark.step_size)).collect()
        };
        assert_eq!(marks(-0.3, 1.1, 300.0), ["0.0", "0.5", "1.0"]);
        assert_eq!(marks(3.98, 5.02, 300.0), ["4.0", "4.2", "4.4", "4.6", "4.8", "5.0"]);
        assert_eq!(marks(0.0, 1000.0, 300.0), ["0", "200", "400", "600", "800", "1000"]);
        assert_eq!(marks(0.0, 1000.0, 120.0), ["0", "500", "1000"], "a narrow chart");
        assert_eq!(marks(1.0, 1.0, 300.0).len(), 0);
        assert_eq!(marks(f64::NAN, 1.0, 300.0).len(), 0);
    }

    #[test]
    fn marks_of_a_log_axis_lie_in_sight_and_read_as_numbers() {
        let marks = |low, high, points| -> Vec<String> {
            let marks = log_marks(input(low, high, points)).into_iter();
            marks.map(|mark| log_text(mark.value)).collect()
        };
        assert_eq!(marks(-4.2, 0.1, 150.0), ["1e-4", "0.001", "0.01", "0.1", "1"]);
        assert_eq!(marks(-1.1, 0.2, 150.0), ["0.1", "0.2", "0.5", "1"]);
        assert_eq!(marks(-1.1, 0.2, 60.0), ["0.1", "1"]);
        assert_eq!(marks(-0.73, -0.69, 150.0), ["0.19", "0.195", "0.2"]);
        assert_eq!(marks(f64::NAN, 1.0, 150.0).len(), 0);
    }

    #[test]
    fn a_diverged_training_has_numbers_on_its_axis_however_low_the_chart() {
        for points in [40.0, 80.0, 120.0, 200.0] {
            for high in [3.0, 20.0, 80.0, 300.0] {
                let marks = log_marks(input(-0.5, high, points));
                assert!((2..=12).contains(&marks.len()), "{marks:?}");
                let apart = marks[0].step_size * points / (high + 0.5);
                assert!(apart >= NUMBER_HEIGHT, "{apart} points between numbers");
            }
        }
    }

    #[test]
    fn counts_have_no_marks_between_whole_numbers() {
        let values = |high: f64| -> Vec<f64> {
            let marks = whole_marks(input(-0.08, high, 150.0)).into_iter();
            marks.map(|mark| mark.value).collect()
        };
        assert_eq!(values(1.08), [0.0, 1.0]);
        assert_eq!(values(6.4), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
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
