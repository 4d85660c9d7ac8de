//! One row of the configuration: a name on the left, a value on the right.

use std::ops::RangeInclusive;

use eframe::egui::{Align, ComboBox, DragValue, Layout, Response, Ui, emath::Numeric};

use super::explained_options_ui;
use crate::app::theme::space;

/// Lays out `name` and the widget made by `value_ui`; joins them for assistive technology and tests.
pub fn field_ui(ui: &mut Ui, name: &str, hint: &str, value_ui: impl FnOnce(&mut Ui) -> Response) -> Response {
    ui.horizontal(|ui| {
        let label = ui.label(name).on_hover_text(hint);
        let value = ui.with_layout(Layout::right_to_left(Align::Center), value_ui).inner;
        value.labelled_by(label.id).on_hover_text(hint)
    })
    .inner
}

/// A whole number.
pub fn count_ui(ui: &mut Ui, name: &str, hint: &str, value: &mut usize, range: RangeInclusive<usize>) -> Response {
    field_ui(ui, name, hint, |ui| number_ui(ui, value, range, ""))
}

/// A number with its unit; typing takes any notation, also 1e-3.
pub fn quantity_ui(
    ui: &mut Ui,
    name: &str,
    hint: &str,
    value: &mut f64,
    range: RangeInclusive<f64>,
    unit: &str,
) -> Response {
    field_ui(ui, name, hint, |ui| number_ui(ui, value, range, unit))
}

/// A quantity kept as a share of one and shown in percent.
pub fn percent_ui(ui: &mut Ui, name: &str, hint: &str, share: &mut f64, range_percent: RangeInclusive<f64>) {
    let mut percent = in_percent(*share);
    if quantity_ui(ui, name, hint, &mut percent, range_percent, "%").changed() {
        *share = to_twelve_digits(percent / 100.0);
    }
}

/// A share of one in percent.
pub fn in_percent(share: f64) -> f64 {
    to_twelve_digits(100.0 * share)
}

/// 100 · 0.07 would show as 7.000000000000001, and 0.7 % would be another share than 0.007.
fn to_twelve_digits(value: f64) -> f64 {
    format!("{value:.11e}").parse().unwrap_or(value)
}

/// One of a few options side by side, each with its meaning. Returns the one newly picked.
pub fn options_ui<T: Copy + PartialEq>(
    ui: &mut Ui,
    name: &str,
    hint: &str,
    options: &[(T, &str, &str)],
    selected: T,
) -> Option<T> {
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        ui.label(name).on_hover_text(hint);
        let layout = Layout::right_to_left(Align::Center);
        ui.with_layout(layout, |ui| explained_options_ui(ui, name, options, selected, false))
            .inner
    })
    .inner
}

/// One of a list that opens, each with its meaning. Returns the one newly picked.
pub fn list_ui<T: Copy + PartialEq>(
    ui: &mut Ui,
    name: &str,
    hint: &str,
    options: &[(T, &str, &str)],
    selected: T,
) -> Option<T> {
    let shown = options.iter().find(|(option, ..)| *option == selected);
    let mut picked = None;
    field_ui(ui, name, hint, |ui| {
        let combo = ComboBox::from_id_salt(name)
            .selected_text(shown.map_or("", |(_, text, _)| *text))
            .width(space(31));
        let combo = combo.show_ui(ui, |ui| {
            for &(option, text, meaning) in options {
                let choice = ui.selectable_label(option == selected, text).on_hover_text(meaning);
                if choice.clicked() && option != selected {
                    picked = Some(option);
                }
            }
        });
        combo.response
    });
    picked
}

fn number_ui<N: Numeric>(ui: &mut Ui, value: &mut N, range: RangeInclusive<N>, unit: &str) -> Response {
    // Dragging moves a value by a hundredth of itself for each point, whole numbers by at least a step in ten points.
    let speed = (0.01 * value.to_f64().abs()).max(if N::INTEGRAL { 0.1 } else { 1e-12 });
    let mut drag = DragValue::new(value)
        .range(range)
        .speed(speed)
        .suffix(if unit.is_empty() {
            String::new()
        } else {
            format!(" {unit}")
        })
        .update_while_editing(false);
    if !N::INTEGRAL {
        drag = drag
            .custom_formatter(|value, _| input_text(value))
            .custom_parser(|text| text.trim().parse().ok());
    }
    ui.add_sized([space(16), space(6)], drag)
}

/// The name with its first letter large.
pub fn capitalised(name: &str) -> String {
    let mut letters = name.chars();
    letters
        .next()
        .map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// A number as one would type it: all its digits, and no more.
pub fn input_text(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude == 0.0 || (1e-3..1e6).contains(&magnitude) {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_show_what_was_typed() {
        for text in ["0", "0.001", "20", "1e10", "1e-7", "-3.25", "123456"] {
            assert_eq!(input_text(text.parse().unwrap()), text);
        }
    }
}
