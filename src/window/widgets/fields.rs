//! Fields of the configuration, each a row with a name on the left and a value on the right: numbers with units, text,
//! options, and sliders.

use std::{cell::RefCell, fmt::Display, ops::RangeInclusive, str::FromStr};

pub(crate) use decoupler_core::sensor::short as input_text;
pub use decoupler_core::text::capitalised;
use eframe::egui::{
    Align, ComboBox, CornerRadius, DragValue, Key, Layout, Response, Sense, Slider, Stroke, TextEdit, Ui, Vec2,
    emath::Numeric, vec2,
};

use super::{
    components::{hinted, refusal_ui, take_refusal},
    quantity_text::parse,
};
use crate::window::theme::{Theme, space};

/// Lays out `name` and the widget of `value_ui`, which `name` labels for assistive technology and tests. The reason for a
/// refused input is shown below.
pub fn field_ui(ui: &mut Ui, name: &str, hint: &str, value_ui: impl FnOnce(&mut Ui) -> Response) -> Response {
    let field = ui.horizontal(|ui| {
        let label = hinted(ui.label(name), hint);
        let value = ui.with_layout(Layout::right_to_left(Align::Center), value_ui).inner;
        hinted(value.labelled_by(label.id), hint)
    });
    refusal_ui(ui, &field.inner);
    field.inner
}

/// Field for a whole number.
pub fn count_ui(ui: &mut Ui, name: &str, hint: &str, value: &mut usize, limits: impl Into<Limits<usize>>) -> Response {
    let limits = limits.into();
    field_ui(ui, name, hint, |ui| number_ui(ui, value, &limits, "", FIELD_SIZE))
}

/// Field for the seed of random numbers.
pub fn seed_ui(ui: &mut Ui, name: &str, hint: &str, seed: &mut u64, usual: u64) -> Response {
    // Larger ones cannot be typed, but those of files stay as they are.
    let limits = usually(usual, 0..=(1 << f64::MANTISSA_DIGITS) - 1);
    let shown = seed.to_string();
    let shown = Shown { text: &shown, unit: "" };
    field_ui(ui, name, hint, |ui| {
        typed_number_ui(ui, seed, &limits, shown, FIELD_SIZE)
    })
}

/// Field for a number with its unit; any notation, such as 1e-3, and other units of the same quantity can be typed.
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

/// Field for a fraction of one shown in percent; `usual` is a fraction, too.
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
        *share = of_percent(percent);
    }
}

/// Returns a fraction of one in percent.
pub fn in_percent(share: f64) -> f64 {
    to_twelve_digits(100.0 * share)
}

/// Returns a percentage as a fraction of one.
pub fn of_percent(percent: f64) -> f64 {
    to_twelve_digits(percent / 100.0)
}

/// Rounds to twelve digits: 100 · 0.07 would be shown as 7.000000000000001, and 0.7 % would differ from 0.007.
fn to_twelve_digits(value: f64) -> f64 {
    format!("{value:.11e}").parse().unwrap_or(value)
}

/// Field for one option of a drop-down list, each with a tooltip. Returns the one just selected.
pub fn list_ui<T: Copy + PartialEq>(
    ui: &mut Ui,
    name: &str,
    hint: &str,
    options: &[(T, &str, &str)],
    selected: T,
) -> Option<T> {
    let mut picked = None;
    field_ui(ui, name, hint, |ui| {
        combo_ui(ui, name, space(31), options, selected, &mut picked)
    });
    picked
}

/// Drop-down list of this width without its name; a newly selected option is `picked`. It is “Other” while none is selected.
pub fn combo_ui<T: Copy + PartialEq>(
    ui: &mut Ui,
    name: &str,
    width: f32,
    options: &[(T, &str, &str)],
    selected: T,
    picked: &mut Option<T>,
) -> Response {
    let shown = options.iter().find(|(option, ..)| *option == selected);
    let combo = ComboBox::from_id_salt(name)
        .selected_text(shown.map_or("Other", |(_, text, _)| *text))
        .width(width)
        .height(space(90));
    let combo = combo.show_ui(ui, |ui| {
        for &(option, text, meaning) in options {
            let choice = hinted(ui.selectable_label(option == selected, text), meaning);
            if choice.clicked() && option != selected {
                *picked = Some(option);
            }
        }
    });
    combo.response
}

/// Slider `width` points wide. On a double click, the caller should reset the value to its default.
pub fn slider_ui(ui: &mut Ui, slider: Slider<'_>, width: f32) -> Response {
    ui.scope(|ui| {
        slider_style(ui);
        ui.spacing_mut().slider_width = width;
        let dragged = ui.add(slider.show_value(false));
        let clicked = dragged.interact(Sense::click());
        dragged.union(clicked)
    })
    .inner
}

/// Styles the sliders of this `ui`: the accent colour up to the handle, a ring as the handle.
fn slider_style(ui: &mut Ui) {
    let palette = Theme::of(ui).palette;
    let visuals = ui.visuals_mut();
    visuals.selection.bg_fill = palette.accent;
    visuals.widgets.inactive.bg_fill = palette.line;
    visuals.widgets.inactive.corner_radius = CornerRadius::same(2);
    for state in [&mut visuals.widgets.hovered, &mut visuals.widgets.active] {
        state.bg_fill = palette.accent;
    }
    for state in [
        &mut visuals.widgets.inactive,
        &mut visuals.widgets.hovered,
        &mut visuals.widgets.active,
    ] {
        state.fg_stroke = Stroke::new(2.0, palette.accent);
    }
}

/// Field for a value as text, which is applied when Enter is pressed or the field loses the focus. Invalid text is refused:
/// the old value stays, and the reason is shown below the field. A double click on it resets the value to `usual`.
pub fn text_ui<T>(ui: &mut Ui, name: &str, hint: &str, value: &mut T, usual: T) -> Response
where
    T: Copy + Display + FromStr<Err: Display> + PartialEq,
{
    field_ui(ui, name, hint, |ui| {
        let id = ui.scope_id().with(name);
        let typed = ui.data(|data| data.get_temp::<String>(id));
        let mut text = typed.clone().unwrap_or_else(|| value.to_string());
        let edit = TextEdit::singleline(&mut text)
            .desired_width(f32::INFINITY)
            .margin(vec2(space(2), space(1)));
        let response = ui.add(edit);
        let is_taken_back = ui.input(|input| input.key_pressed(Key::Escape));
        let typed = if response.changed() { Some(text) } else { typed };
        let tried = if response.has_focus() {
            ui.data_mut(|data| typed.map(|typed| data.insert_temp(id, typed)));
            None
        } else {
            ui.data_mut(|data| data.remove_temp::<String>(id));
            typed.filter(|_| !is_taken_back).map(|typed| {
                let parsed = typed.parse().map(|parsed| *value = parsed);
                parsed.map_err(|error: T::Err| error.to_string())
            })
        };
        if response.double_clicked() && !response.has_focus() {
            *value = usual;
        }
        take_refusal(ui, &response, tried, &value.to_string());
        response
    })
}

/// Range and default of a field.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits<N> {
    range: RangeInclusive<N>,
    usual: Option<N>,
}

impl<N> From<RangeInclusive<N>> for Limits<N> {
    fn from(range: RangeInclusive<N>) -> Self {
        Self { range, usual: None }
    }
}

/// Returns the range of a field that a double click resets to its `usual` value.
pub fn usually<N>(usual: N, range: RangeInclusive<N>) -> Limits<N> {
    Limits {
        range,
        usual: Some(usual),
    }
}

/// Field for a number with its unit, to be dragged or typed: "0.5 mm", "1e-3", "20%". Input that is not a number, is outside
/// `limits` or has an incompatible unit is refused: the old value stays, and [`refusal_ui`] shows the reason. A double click
/// resets the value; a right click copies it.
pub fn number_ui<N: Numeric>(ui: &mut Ui, value: &mut N, limits: &Limits<N>, unit: &str, size: Vec2) -> Response {
    let shown = input_text(value.to_f64());
    let shown = Shown { text: &shown, unit };
    typed_number_ui(ui, value, limits, shown, size)
}

/// Text of a value, and its unit.
#[derive(Clone, Copy)]
struct Shown<'a> {
    text: &'a str,
    unit: &'a str,
}

fn typed_number_ui<N: Numeric>(
    ui: &mut Ui,
    value: &mut N,
    limits: &Limits<N>,
    Shown { text: shown, unit }: Shown<'_>,
    size: Vec2,
) -> Response {
    let range = limits.range.start().to_f64()..=limits.range.end().to_f64();
    // Dragging changes a value by 1 % per point, a whole number by at least 1 per ten points.
    let speed = (0.01 * value.to_f64().abs()).max(if N::INTEGRAL { 0.1 } else { 1e-12 });
    let suffix = if unit.is_empty() {
        String::new()
    } else {
        format!(" {unit}")
    };
    let tried = RefCell::new(None);
    let before = *value;
    let drag = DragValue::new(value)
        .range(limits.range.clone())
        .clamp_existing_to_range(false)
        .speed(speed)
        .suffix(suffix)
        .update_while_editing(false)
        .custom_formatter(|value, _| {
            if value == before.to_f64() {
                shown.to_owned()
            } else {
                input_text(value)
            }
        })
        .custom_parser(|text| {
            let parsed = parse(text, unit, &range, N::INTEGRAL);
            let value = parsed.as_ref().ok().copied();
            *tried.borrow_mut() = Some(parsed.map(drop));
            value
        });
    let mut response = ui.add_sized(size, drag);
    if let Some(usual) = limits.usual.filter(|_| response.double_clicked()) {
        *value = usual;
        response.surrender_focus();
    }
    if *value != before {
        response.mark_changed();
    }
    take_refusal(ui, &response, tried.into_inner(), &value.to_f64().to_string());
    response
}

/// Usual size of a field, in points.
pub const FIELD_SIZE: Vec2 = Vec2::new(space(16), space(6));
