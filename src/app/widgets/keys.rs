use eframe::egui::{Context, Key, KeyboardShortcut, Modifiers};

/// Whether a key was pressed with these others held; then nobody else hears of it.
pub fn pressed(ctx: &Context, modifiers: Modifiers, key: Key) -> bool {
    ctx.input_mut(|input| input.consume_shortcut(&KeyboardShortcut::new(modifiers, key)))
}
