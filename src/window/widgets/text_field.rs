//! The one field for values that are no numbers.

use std::{fmt::Display, str::FromStr};

use eframe::egui::{Key, Response, TextEdit, Ui, vec2};

use super::{
    fields::field_ui,
    refusal::{menu_ui, take_refusal},
    value_under::claim_right_click,
};
use crate::window::theme::space;

/// A value as text, which counts when Enter is pressed or the field is left. What is none is refused: the old value stays,
/// and below the field stands why. A right click copies, or sets the `usual` value.
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
