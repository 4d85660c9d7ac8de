//! One row of the configuration: a name on the left, a value on the right.
//!
//! The one slider.
//!
//! The one field for values that are not numbers.
//!
//! The one field for numbers.

use std::{cell::RefCell, fmt::Display, ops::RangeInclusive, str::FromStr};

pub(crate) use decoupler_core::sensor::short as input_text;
pub use decoupler_core::text::capitalised;
use eframe::egui::{
    Align, ComboBox, Context, CornerRadius, DragValue, Id, Key, Layout, Rect, Response, Sense, Slider, Stroke,
    TextEdit, Ui, Vec2, emath::Numeric, vec2,
};

use super::{
    components::{menu_ui, refusal_ui, take_refusal},
    explained_options_ui,
    quantity_text::parse,
};
use crate::window::theme::{Theme, space};

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

/// A slider `width` points wide. A double click asks for the usual value, which the caller sets where the response is
/// double-clicked.
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

/// Makes the sliders of this `ui` look like ours: accent up to the handle, a ring as the handle.
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

/// A value as text, which counts when Enter is pressed or the field is left. What is none is refused: the old value stays,
/// and the reason is shown below the field. A right click copies, or sets the `usual` value.
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
        claim_right_click(ui, &response);
        let shown = value.to_string();
        response.context_menu(|ui| menu_ui(ui, value, &shown, Some((usual, usual.to_string()))));
        take_refusal(ui, &response, tried, &value.to_string());
        response
    })
}

fn id() -> Id {
    Id::unique("value under the pointer")
}

/// Registers that `text` is the value shown in `rect`, so that a right click there can copy it.
pub fn value_under(ui: &Ui, rect: Rect, text: &str) {
    if ui.input(|input| input.pointer.secondary_clicked()) && ui.rect_contains_pointer(rect) {
        ui.data_mut(|data| data.insert_temp(id(), text.to_owned()));
    }
}

/// Returns the value that was right-clicked in this frame, once.
pub fn take_value_under(ctx: &Context) -> Option<String> {
    ctx.data_mut(|data| data.remove_temp(id()))
}

fn claim_id() -> Id {
    Id::unique("right click is answered")
}

/// Registers that a widget answers a right click on it by a menu of its own.
pub fn claim_right_click(ui: &Ui, widget: &Response) {
    if widget.secondary_clicked() {
        ui.data_mut(|data| data.insert_temp(claim_id(), true));
    }
}

/// Returns true if a widget answers the right click of this frame, once.
pub fn take_claim(ctx: &Context) -> bool {
    ctx.data_mut(|data| data.remove_temp(claim_id())).unwrap_or(false)
}

/// Numbers that a field takes.
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

/// The range of a field that a double click sets back to its `usual` value.
pub fn usually<N>(usual: N, range: RangeInclusive<N>) -> Limits<N> {
    Limits {
        range,
        usual: Some(usual),
    }
}

/// A number with its unit, to be dragged or typed: "0.5 mm", "1e-3", "20%". What is not a number, out of `limits`, or of
/// another unit is refused: the old value stays, and [`refusal_ui`] tells why. A double click sets the usual value; a right
/// click copies.
pub fn number_ui<N: Numeric>(ui: &mut Ui, value: &mut N, limits: &Limits<N>, unit: &str, size: Vec2) -> Response {
    let shown = input_text(value.to_f64());
    typed_number_ui(ui, value, limits, (unit, &shown), size).0
}

/// As [`number_ui`] for a whole number all of whose digits count.
pub fn whole_ui(ui: &mut Ui, value: &mut u64, limits: &Limits<u64>, size: Vec2) -> Response {
    let shown = value.to_string();
    let before = *value;
    let (mut response, typed) = typed_number_ui(ui, value, limits, ("", &shown), size);
    // More digits than the field computes with.
    if let Some(exact) = typed.and_then(|typed| typed.trim().parse().ok())
        && limits.range.contains(&exact)
    {
        *value = exact;
        if exact != before {
            response.mark_changed();
        }
    }
    response
}

/// Shows a field; `shown` is the text of its value. Returns what was typed and taken, too.
fn typed_number_ui<N: Numeric>(
    ui: &mut Ui,
    value: &mut N,
    limits: &Limits<N>,
    (unit, shown): (&str, &str),
    size: Vec2,
) -> (Response, Option<String>) {
    let range = limits.range.start().to_f64()..=limits.range.end().to_f64();
    // Dragging moves a value by a hundredth of itself for each point, whole numbers by at least a step in ten points.
    let speed = (0.01 * value.to_f64().abs()).max(if N::INTEGRAL { 0.1 } else { 1e-12 });
    let suffix = if unit.is_empty() {
        String::new()
    } else {
        format!(" {unit}")
    };
    let tried: RefCell<Option<(String, Result<f64, String>)>> = RefCell::new(None);
    let before = *value;
    let drag = DragValue::new(value)
        .range(limits.range.clone())
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
            *tried.borrow_mut() = Some((text.to_owned(), parsed));
            value
        });
    let mut response = ui.add_sized(size, drag);
    if let Some(usual) = limits.usual.filter(|_| response.double_clicked()) {
        *value = usual;
        response.surrender_focus();
    }
    claim_right_click(ui, &response);
    let shown = if *value == before {
        format!("{shown} {unit}").trim_end().to_owned()
    } else {
        with_unit(*value, unit)
    };
    let usual = limits.usual.map(|usual| (usual, with_unit(usual, unit)));
    response.context_menu(|ui| menu_ui(ui, value, &shown, usual));
    if *value != before {
        response.mark_changed();
    }
    let (typed, tried) = tried.into_inner().map_or((None, None), |(text, tried)| {
        let taken = tried.is_ok().then_some(text);
        (taken, Some(tried.map(drop)))
    });
    take_refusal(ui, &response, tried, &value.to_f64().to_string());
    (response, typed)
}

fn with_unit<N: Numeric>(value: N, unit: &str) -> String {
    format!("{} {unit}", input_text(value.to_f64())).trim_end().to_owned()
}

/// Usual size of a field, in points.
pub const FIELD_SIZE: Vec2 = Vec2::new(space(16), space(6));
