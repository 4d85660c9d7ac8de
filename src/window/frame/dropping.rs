use std::path::PathBuf;

use eframe::egui::{Align2, Context, FontId, Id, LayerId, Order, Stroke, StrokeKind, Ui};

use super::DecouplerWindow;
use crate::window::{
    shared::Effect,
    theme::{Theme, radius, space, type_size},
};

impl DecouplerWindow {
    /// Gives files dropped on the window to the view that takes them, and shows it.
    pub(super) fn take_dropped(&mut self, ctx: &Context, effects: &mut Vec<Effect>) {
        let dropped = ctx.input_mut(|input| std::mem::take(&mut input.raw.dropped_files));
        let paths: Vec<PathBuf> = dropped.iter().map(|file| file.path().to_owned()).collect();
        // A question is to be answered first.
        if paths.is_empty() || self.is_asked() {
            return;
        }
        let place = self
            .views
            .all()
            .into_iter()
            .position(|view| view.take_files(&paths, &self.shared, effects));
        if let Some(place) = place {
            self.show(place);
            ctx.request_repaint();
        }
    }

    /// Says over the window what dropping the files under the pointer does.
    pub(super) fn dropping_ui(&self, ui: &Ui) {
        let is_hovered = ui.input(|input| !input.raw.hovered_files.is_empty());
        if !is_hovered || self.is_asked() {
            return;
        }
        let palette = Theme::of(ui).palette;
        let painter = ui
            .ctx()
            .layer_painter(LayerId::new(Order::Foreground, Id::unique("dropping")));
        let whole = ui.ctx().content_rect().shrink(space(2));
        painter.rect_filled(whole, f32::from(radius()), palette.background.gamma_multiply(0.85));
        painter.rect_stroke(
            whole,
            f32::from(radius()),
            Stroke::new(2.0, palette.accent),
            StrokeKind::Inside,
        );
        let font = FontId::proportional(type_size().title);
        let hovered = ui.input(|input| input.raw.hovered_files.clone());
        let paths: Vec<PathBuf> = hovered.into_iter().filter_map(|file| file.path).collect();
        let text = in_words(&paths, self.shared.phase.is_busy(), self.views.has_recording());
        painter.text(whole.center(), Align2::CENTER_CENTER, text, font, palette.text);
    }
}

/// Returns a sentence on what dropping these files does.
fn in_words(paths: &[PathBuf], is_busy: bool, has_recording: bool) -> &'static str {
    // Only their names: reading files would block the window.
    let is_document = |path: &PathBuf| {
        let extension = path.extension().map(|extension| extension.to_ascii_lowercase());
        extension.is_some_and(|extension| extension == "json" || extension == "checkpoint")
    };
    if is_busy {
        "A training is running: stop it before you open other files"
    } else if paths.iter().any(is_document) {
        "Drop to open the recipe, network or checkpoint"
    } else if has_recording {
        "Drop to add to the recording"
    } else {
        "Drop to open as a recording"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_drop_does_depends_on_the_file_and_on_what_is_open() {
        for (name, is_busy, has_recording, beginning) in [
            ("press.csv", false, false, "Drop to open as a recording"),
            ("press.csv", false, true, "Drop to add"),
            ("net.json", false, true, "Drop to open the recipe, network"),
            ("half.CHECKPOINT", false, false, "Drop to open the recipe, network"),
            ("press.csv", true, false, "A training is running"),
        ] {
            let text = in_words(&[PathBuf::from(name)], is_busy, has_recording);
            assert!(text.starts_with(beginning), "{name}: {text}");
        }
    }
}
