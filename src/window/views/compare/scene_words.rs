//! A run's scene and inputs in words.

use crate::window::widgets::fields::input_text;
use decoupler_core::{
    evaluation::SimulatedSettings,
    network::{InputChoice, Quantity, ScalingChoice},
    scene::{Loading, Movement, Noise, NoisySets, Rows, Scene},
};

/// Returns the differences between a run and the paper's scene and inputs, in words; empty if there are none.
pub fn unlike_paper(settings: &SimulatedSettings) -> Vec<String> {
    let paper = SimulatedSettings::default();
    let (scene, of_paper) = (&settings.source.scene, &paper.source.scene);
    let words = [
        (scene.rows != of_paper.rows).then(|| rows_words(scene.rows)),
        (scene.movement != of_paper.movement).then(|| movement_words(scene.movement)),
        (scene.loading != of_paper.loading).then(|| loading_words(scene)),
        (!scene.noise.is_none()).then(|| format!("noise {}", noise_words(&scene.noise))),
        (settings.inputs != paper.inputs).then(|| inputs_words(settings.inputs)),
    ];
    words.into_iter().flatten().collect()
}

pub fn rows_words(rows: Rows) -> String {
    match rows {
        Rows::All => "all rows".to_owned(),
        Rows::Known => "known rows".to_owned(),
        Rows::One(row) => format!("row {} alone", row + 1),
    }
}

pub fn movement_words(movement: Movement) -> String {
    match movement {
        Movement::Z => "z".to_owned(),
        Movement::Xyz { .. } => "x, y, z".to_owned(),
    }
}

pub fn loading_words(scene: &Scene) -> String {
    match scene.loading {
        Loading::RandomNodes => "random nodes".to_owned(),
        Loading::SmoothField { correlation_length_mm } => {
            format!("smooth field, {} mm", input_text(correlation_length_mm))
        }
        Loading::Indenter(indenter) => indenter.name().to_owned(),
    }
}

pub fn noise_words(noise: &Noise) -> String {
    if noise.is_none() {
        return "none".to_owned();
    }
    let parts = [
        (noise.relative > 0.0).then(|| input_text(noise.relative)),
        (noise.additive_ohm > 0.0).then(|| format!("{} ohm", input_text(noise.additive_ohm))),
        noise.converter_bits.map(|bits| format!("{bits} bits")),
        (noise.drift > 0.0).then(|| format!("drift {}", input_text(noise.drift))),
        match noise.sets {
            NoisySets::Both => None,
            NoisySets::Training => Some("in training".to_owned()),
            NoisySets::Test => Some("in test".to_owned()),
        },
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

pub fn inputs_words(inputs: InputChoice) -> String {
    let quantity = match inputs.quantity {
        Quantity::Resistance => "resistance",
        Quantity::Conductance => "conductance",
        Quantity::LogResistance => "log-resistance",
        Quantity::Raw => "readings",
    };
    match inputs.scaling {
        ScalingChoice::MinMax => quantity.to_owned(),
        ScalingChoice::Whitening => format!("{quantity}, whitened"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use decoupler_core::{evaluation::Preset, scene::Indenter};

    #[test]
    fn what_differs_from_the_paper_is_said_and_nothing_else() {
        assert!(unlike_paper(&SimulatedSettings::default()).is_empty());
        let mut best = Preset::Best.settings_in(Noise {
            relative: 1e-3,
            converter_bits: Some(12),
            sets: NoisySets::Test,
            ..Noise::default()
        });
        let words = ["known rows", "noise 0.001, 12 bits, in test", "conductance, whitened"];
        assert_eq!(unlike_paper(&best), words);
        best = SimulatedSettings::default();
        best.source.scene.rows = Rows::One(2);
        best.source.scene.loading = Loading::Indenter(Indenter::all()[1]);
        assert_eq!(unlike_paper(&best), ["row 3 alone", "flat punch"]);
    }
}
