use std::ops::RangeInclusive;

use eframe::egui::{Key, Modifiers};

use super::DecouplerWindow;
use crate::window::shared::Offers;

/// Sizes of the interface between which the user can choose, as shares of the usual one.
pub(super) const SCALES: RangeInclusive<f32> = 0.8..=2.0;

/// One step larger or smaller.
const STEP: f32 = 0.1;

impl DecouplerWindow {
    /// Offers larger and smaller text and controls.
    pub(super) fn offer_scales(&mut self, offers: &mut Offers<'_>) {
        let scale = self.ctx.zoom_factor();
        let can_grow = scale < *SCALES.end() - 0.5 * STEP;
        let can_shrink = scale > *SCALES.start() + 0.5 * STEP;
        // On many keyboards plus is the shifted equals sign.
        let is_equals = can_grow
            && self
                .ctx
                .input_mut(|input| input.consume_key(Modifiers::COMMAND, Key::Equals));
        if offers.offer_keys("Larger interface", Modifiers::COMMAND, Key::Plus, can_grow) || is_equals {
            self.set_scale(scale + STEP);
        }
        if offers.offer_keys("Smaller interface", Modifiers::COMMAND, Key::Minus, can_shrink) {
            self.set_scale(scale - STEP);
        }
        let is_usual = (scale - 1.0).abs() < 0.5 * STEP;
        if offers.offer_keys("Usual size of the interface", Modifiers::COMMAND, Key::Num0, !is_usual) {
            self.set_scale(1.0);
        }
    }

    /// Draws everything at this share of its usual size, kept to whole steps within [`SCALES`].
    pub(super) fn set_scale(&mut self, scale: f32) {
        let scale = ((scale / STEP).round() * STEP).clamp(*SCALES.start(), *SCALES.end());
        self.ctx.set_zoom_factor(scale);
        self.remembered.scale = Some(scale);
    }
}
