use eframe::egui::{Context, Id, Rect, Response, Ui};

fn id() -> Id {
    Id::unique("value under the pointer")
}

/// Tells that `text` is the value shown in `rect`, so that a right click there can copy it.
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

/// Tells that a widget answers a right click on it by a menu of its own.
pub fn claim_right_click(ui: &Ui, widget: &Response) {
    if widget.secondary_clicked() {
        ui.data_mut(|data| data.insert_temp(claim_id(), true));
    }
}

/// Returns true if a widget answers the right click of this frame, once.
pub fn take_claim(ctx: &Context) -> bool {
    ctx.data_mut(|data| data.remove_temp(claim_id())).unwrap_or(false)
}
