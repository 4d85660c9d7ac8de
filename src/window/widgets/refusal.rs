//! Parts that all fields share: the reason for which typed text was not taken, and the menu of a value.

use eframe::egui::{Id, Key, Response, RichText, Stroke, StrokeKind, Ui, accesskit::Invalid};

use crate::window::theme::{Theme, radius, type_size};

/// Text that was typed and could not be taken, with the reason.
#[derive(Clone, Debug, PartialEq)]
struct Refusal {
    reason: String,
    /// The value that stayed; the refusal goes when it changes.
    kept: String,
}

fn refusal_id(field: Id) -> Id {
    field.with("refusal")
}

/// Marks a field while what was `tried` last is refused; `value` is the text of its value.
pub(super) fn take_refusal(ui: &Ui, response: &Response, tried: Option<Result<(), String>>, value: &str) {
    let id = refusal_id(response.id);
    match tried {
        Some(Err(reason)) => {
            let kept = value.to_owned();
            ui.data_mut(|data| data.insert_temp(id, Refusal { reason, kept }));
        }
        Some(Ok(())) => ui.data_mut(|data| data.remove::<Refusal>(id)),
        None => {}
    }
    let Some(refusal) = ui.data(|data| data.get_temp::<Refusal>(id)) else {
        return;
    };
    let is_dismissed = response.has_focus() && ui.input(|input| input.key_pressed(Key::Escape));
    if refusal.kept != value || is_dismissed {
        ui.data_mut(|data| data.remove::<Refusal>(id));
        return;
    }
    let stroke = Stroke::new(1.0, Theme::of(ui).palette.bad);
    let corner = f32::from(radius());
    ui.painter()
        .rect_stroke(response.rect, corner, stroke, StrokeKind::Inside);
    ui.ctx().accesskit_node_builder(response.id, |node| {
        node.set_invalid(Invalid::True);
        node.set_description(refusal.reason.as_str());
    });
}

/// Tells below a field why what was typed was not taken.
pub fn refusal_ui(ui: &mut Ui, field: &Response) {
    let refusal = ui.data(|data| data.get_temp::<Refusal>(refusal_id(field.id)));
    if let Some(refusal) = refusal {
        let bad = Theme::of(ui).palette.bad;
        ui.label(RichText::new(refusal.reason).size(type_size().note).color(bad));
    }
}

/// Copies the value as `shown`, or sets the usual one, which has a text too.
pub(super) fn menu_ui<T: Copy + PartialEq>(ui: &mut Ui, value: &mut T, shown: &str, usual: Option<(T, String)>) {
    if ui.button(format!("Copy {shown}")).clicked() {
        ui.ctx().copy_text(shown.to_owned());
        ui.close();
    }
    if let Some((usual, text)) = usual.filter(|(usual, _)| usual != value)
        && ui.button(format!("Reset to {text}")).clicked()
    {
        *value = usual;
        ui.close();
    }
}
