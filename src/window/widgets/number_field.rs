//! The one field for numbers.

use std::{cell::RefCell, ops::RangeInclusive};

use eframe::egui::{DragValue, Response, Ui, Vec2, emath::Numeric};

use super::{
    components::{menu_ui, take_refusal},
    fields::{claim_right_click, input_text},
    quantity_text::parse,
};
use crate::window::theme::space;

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
