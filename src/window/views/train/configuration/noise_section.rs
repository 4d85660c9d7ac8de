use eframe::egui::{CollapsingHeader, RichText, Ui};

use crate::window::{
    glossary,
    theme::{Theme, type_size},
    widgets::fields::{count_ui, in_percent, input_text, options_ui, percent_ui, quantity_ui, usually},
    widgets::focus_ring_ui,
};
use decoupler_core::scene::{Noise, NoisySets};

/// Shows the noise of the readings; changes `noise`. A line tells it where the settings are folded away.
pub fn noise_ui(ui: &mut Ui, noise: &mut Noise) {
    let shown = CollapsingHeader::new("Noise on resistance").show(ui, |ui| settings_ui(ui, noise));
    focus_ring_ui(ui, &shown.header_response);
    if shown.body_response.is_none() && !noise.is_none() {
        let dim = Theme::of(ui).palette.dim;
        ui.label(RichText::new(in_words(noise)).size(type_size().note).color(dim));
    }
}

fn settings_ui(ui: &mut Ui, noise: &mut Noise) {
    let hint = glossary::RELATIVE_NOISE.hint;
    percent_ui(ui, "Relative noise", hint, &mut noise.relative, 0.0, 0.0..=100.0);
    let hint = "Noise of each reading (standard deviation), in Ω.";
    quantity_ui(
        ui,
        "Additive noise",
        hint,
        &mut noise.additive_ohm,
        usually(0.0, 0.0..=1e12),
        "Ω",
    );
    let mut bits = noise.converter_bits.map_or(0, usize::from);
    let most = usize::from(Noise::MAX_BITS);
    let hint = "Resolution of the analogue-to-digital converter, in bits; its range is 0 to twice the largest \
                resistance at rest. 0 for no quantisation.";
    count_ui(ui, "Converter bits", hint, &mut bits, usually(0, 0..=most));
    noise.converter_bits = u8::try_from(bits).ok().filter(|&bits| bits > 0);
    percent_ui(ui, "Drift", glossary::DRIFT.hint, &mut noise.drift, 0.0, 0.0..=100.0);
    if !noise.is_none() {
        let options = [
            (
                NoisySets::Both,
                "Both",
                "Training and test samples: the network learns to handle the noise.",
            ),
            (NoisySets::Training, "Training", "Training samples only."),
            (
                NoisySets::Test,
                "Test",
                "Test samples only: the network is trained on clean readings.",
            ),
        ];
        let hint = "Samples to which noise is added. Validation samples are treated like training samples.";
        if let Some(picked) = options_ui(ui, "Noise in", hint, &options, noise.sets) {
            noise.sets = picked;
        }
    }
}

/// The noise in a line: `0.1 % relative, 12 bits, in test only`.
fn in_words(noise: &Noise) -> String {
    let percent = |share: f64| input_text(in_percent(share));
    let sources = [
        (noise.relative > 0.0).then(|| format!("{} % relative", percent(noise.relative))),
        (noise.additive_ohm > 0.0).then(|| format!("{} Ω", input_text(noise.additive_ohm))),
        noise.converter_bits.map(|bits| format!("{bits} bits")),
        (noise.drift > 0.0).then(|| format!("{} % drift", percent(noise.drift))),
        match noise.sets {
            NoisySets::Both => None,
            NoisySets::Training => Some("in training only".to_owned()),
            NoisySets::Test => Some("in test only".to_owned()),
        },
    ];
    sources.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_told_in_a_line() {
        let noise = Noise {
            relative: 0.07,
            converter_bits: Some(12),
            sets: NoisySets::Test,
            ..Noise::default()
        };
        assert_eq!(in_words(&noise), "7 % relative, 12 bits, in test only");
    }
}
