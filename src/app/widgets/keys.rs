use eframe::egui::{Context, Key, KeyboardShortcut, Modifiers};

/// Returns true if a key was pressed with these modifiers, and consumes it.
pub fn pressed(ctx: &Context, modifiers: Modifiers, key: Key) -> bool {
    ctx.input_mut(|input| input.consume_shortcut(&KeyboardShortcut::new(modifiers, key)))
}
