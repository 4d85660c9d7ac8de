//! One row of the configuration: a name on the left, a value on the right.

use std::ops::RangeInclusive;

use eframe::egui::{Align, ComboBox, Layout, Response, Ui};

use super::{
    explained_options_ui,
    number_field::{FIELD_SIZE, Limits, number_ui, whole_ui},
    refusal::refusal_ui,
};
use crate::window::theme::space;

pub use super::number_field::usually;
/// A number as one would type it: all its digits, and no more.
pub(crate) use decoupler_core::sensor::short as input_text;
pub use decoupler_core::text::capitalised;

/// Lays out `name` and the widget made by `value_ui`; joins them for assistive technology and tests. Below it is why
/// what was typed into it was not taken.
pub fn field_ui(ui: &mut Ui, name: &str, hint: &str, value_ui: impl FnOnce(&mut Ui) -> Response) -> Response {
    let field = ui.horizontal(|ui| {
        let label = ui.label(name).on_hover_text(hint);
        let value = ui.with_layout(Layout::right_to_left(Align::Center), value_ui).inner;
        value.labelled_by(label.id).on_hover_text(hint)
    });
    refusal_ui(ui, &field.inner);
    field.inner
}

/// A whole number.
pub fn count_ui(ui: &mut Ui, name: &str, hint: &str, value: &mut usize, limits: impl Into<Limits<usize>>) -> Response {
    let limits = limits.into();
    field_ui(ui, name, hint, |ui| number_ui(ui, value, &limits, "", FIELD_SIZE))
}

/// The number from which a random draw begins.
pub fn seed_ui(ui: &mut Ui, name: &str, hint: &str, seed: &mut u64, usual: u64) -> Response {
    let limits = usually(usual, 0..=u64::MAX);
    field_ui(ui, name, hint, |ui| whole_ui(ui, seed, &limits, FIELD_SIZE))
}

/// A number with its unit; typing takes any notation, also 1e-3, and other units of the same kind.
pub fn quantity_ui(
    ui: &mut Ui,
    name: &str,
    hint: &str,
    value: &mut f64,
    limits: impl Into<Limits<f64>>,
    unit: &str,
) -> Response {
    let limits = limits.into();
    field_ui(ui, name, hint, |ui| number_ui(ui, value, &limits, unit, FIELD_SIZE))
}

/// A quantity kept as a share of one and shown in percent; `usual` is a share too.
pub fn percent_ui(
    ui: &mut Ui,
    name: &str,
    hint: &str,
    share: &mut f64,
    usual: f64,
    range_percent: RangeInclusive<f64>,
) {
    let mut percent = in_percent(*share);
    let limits = usually(in_percent(usual), range_percent);
    if quantity_ui(ui, name, hint, &mut percent, limits, "%").changed() {
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
