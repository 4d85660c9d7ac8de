use eframe::egui::{Context, Event, Ui};

use super::DecouplerWindow;

/// Returns `true` if the user did something in this frame that parts of the window already drawn may depend on: one
/// frame more shows it everywhere. A pointer that merely moves changes nothing.
pub(super) fn changes_something(ctx: &Context) -> bool {
    ctx.input(|input| {
        let is_change = |event: &Event| match event {
            Event::PointerMoved(_) | Event::MouseMoved(_) => input.pointer.any_down(),
            Event::PointerGone | Event::WindowFocused(_) => false,
            _ => true,
        };
        input.events.iter().any(is_change)
    })
}

impl eframe::App for DecouplerWindow {
    fn logic(&mut self, _ctx: &Context, _frame: &mut eframe::Frame) {
        self.take_events();
    }

    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        self.show_ui(ui);
    }
}
