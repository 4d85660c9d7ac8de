use std::{ops::RangeInclusive, str::FromStr};

use thiserror::Error;

use super::TradeOffPlan;
use crate::{
    dataset::LARGEST_SAMPLES,
    decoupling::DecoderKind,
    evaluation::{Preset, SimulatedSettings},
    network::LARGEST_HIDDEN,
    training::StoppingRules,
};

/// A measurement as the user sets it up.
#[derive(Clone, Debug, PartialEq)]
pub struct TradeOffForm {
    /// Relative errors of a reading, as typed.
    pub noises: String,
    /// Hidden nodes, as typed.
    pub hidden: String,
    /// Presets on which the settings of the networks are based.
    pub presets: WhichPresets,
    /// Ways of decoding, in the order of [`DecoderKind::ALL`].
    pub decoders: [bool; DecoderKind::ALL.len()],
    /// Length of the trainings.
    pub thoroughness: Thoroughness,
    /// The most training samples of a quick look.
    pub samples: usize,
    /// The most epochs of a quick look.
    pub epochs: usize,
    /// Number of samples on which the errors are measured.
    pub test_samples: usize,
}

/// Presets that are measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WhichPresets {
    /// Both.
    Both,
    /// One of them.
    Only(Preset),
}

/// Length of the trainings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Thoroughness {
    /// With few samples and epochs: a first look within a minute.
    Quick,
    /// As the presets say.
    Full,
}

/// Reasons for which a form is not yet a measurement.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum TradeOffFormError {
    /// Something that is no number.
    #[error("{what}: '{text}' is not a number; write a list such as {example}")]
    NotANumber {
        /// The list.
        what: &'static str,
        /// Text that was typed.
        text: String,
        /// A list that can be understood.
        example: &'static str,
    },
    /// A number out of its range.
    #[error("{what}: {value} is not possible, give from {least} to {most}")]
    Range {
        /// The list.
        what: &'static str,
        /// Text that was typed.
        value: String,
        /// The smallest.
        least: String,
        /// The largest.
        most: String,
    },
    /// An empty list.
    #[error("{what}: there are no values; write a list such as {example}")]
    Empty {
        /// The list.
        what: &'static str,
        /// A list that can be understood.
        example: &'static str,
    },
    /// More than can be looked at.
    #[error("{0} points are more than can be looked at: give fewer values, at most {MOST_POINTS} points")]
    TooMany(usize),
    /// No decoder.
    #[error("no decoder is chosen: choose at least one")]
    NoDecoder,
}

/// The most points of one measurement.
const MOST_POINTS: usize = 1000;

const NOISES: &str = "0, 1e-4, 1e-3, 1e-2";
const HIDDEN: &str = "6, 12";

impl Default for TradeOffForm {
    fn default() -> Self {
        Self {
            noises: NOISES.to_owned(),
            hidden: HIDDEN.to_owned(),
            presets: WhichPresets::Both,
            decoders: [true; DecoderKind::ALL.len()],
            thoroughness: Thoroughness::Quick,
            samples: 2000,
            epochs: 60,
            test_samples: 100,
        }
    }
}

impl TradeOffForm {
    /// The measurement in the sensor and scene of `base`, sound as far as can be known before it is run.
    ///
    /// # Errors
    /// If the form is not a possible measurement.
    pub fn plan(&self, base: &SimulatedSettings) -> Result<TradeOffPlan, TradeOffFormError> {
        let chosen = DecoderKind::ALL.into_iter().zip(self.decoders);
        let decoders: Vec<_> = chosen
            .filter(|(_, is_chosen)| *is_chosen)
            .map(|(kind, _)| kind)
            .collect();
        if decoders.is_empty() {
            return Err(TradeOffFormError::NoDecoder);
        }
        let plan = TradeOffPlan {
            base: *base,
            noises: list("Noise levels", &self.noises, NOISES, 0.0..=1.0)?,
            hidden: list("Hidden nodes", &self.hidden, HIDDEN, 1..=LARGEST_HIDDEN)?,
            presets: match self.presets {
                WhichPresets::Both => Preset::ALL.to_vec(),
                WhichPresets::Only(preset) => vec![preset],
            },
            decoders,
            at_most: match self.thoroughness {
                Thoroughness::Quick => Some((
                    self.samples.clamp(1, LARGEST_SAMPLES),
                    self.epochs.clamp(1, StoppingRules::MOST_EPOCHS),
                )),
                Thoroughness::Full => None,
            },
            test_samples: self.test_samples.clamp(1, LARGEST_SAMPLES),
        };
        match plan.points() {
            points if points > MOST_POINTS => Err(TradeOffFormError::TooMany(points)),
            _ => Ok(plan),
        }
    }
}

/// The values of a list, each once, in their order.
fn list<N>(
    what: &'static str,
    text: &str,
    example: &'static str,
    possible: RangeInclusive<N>,
) -> Result<Vec<N>, TradeOffFormError>
where
    N: FromStr + PartialOrd + ToString,
{
    let mut values: Vec<N> = Vec::new();
    let words = text.split(|letter: char| letter == ',' || letter == ';' || letter.is_whitespace());
    for word in words.filter(|word| !word.is_empty()) {
        let value: N = word.parse().map_err(|_| TradeOffFormError::NotANumber {
            what,
            text: word.to_owned(),
            example,
        })?;
        if !possible.contains(&value) {
            return Err(TradeOffFormError::Range {
                what,
                value: word.to_owned(),
                least: possible.start().to_string(),
                most: possible.end().to_string(),
            });
        }
        if !values.contains(&value) {
            values.push(value);
        }
    }
    if values.is_empty() {
        return Err(TradeOffFormError::Empty { what, example });
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Rows;

    #[test]
    fn the_form_begins_with_a_quick_look_at_everything() {
        let plan = TradeOffForm::default().plan(&SimulatedSettings::default()).unwrap();
        // Five without a network, then two sizes with two precisions and polish.
        assert_eq!(plan.points(), 4 * 2 * (5 + 2 * 3));
        let best = plan.settings(Preset::Best, 1e-3);
        assert_eq!((best.source.samples, best.training.stopping.epochs), (2000, 60));
        assert_eq!(
            (best.source.scene.rows, best.source.scene.noise.relative),
            (Rows::Known, 1e-3)
        );
    }

    #[test]
    fn a_thorough_measurement_is_the_presets_own_in_the_scene_at_hand() {
        let mut base = SimulatedSettings::default();
        base.source.scene.largest_compression = 0.1;
        base.source.sensor.geometry.height_mm = 4.0;
        let form = TradeOffForm {
            thoroughness: Thoroughness::Full,
            presets: WhichPresets::Only(Preset::Best),
            ..TradeOffForm::default()
        };
        let plan = form.plan(&base).unwrap();
        let (settings, preset) = (plan.settings(Preset::Best, 0.0), Preset::Best.settings());
        assert_eq!(
            (settings.source.samples, settings.training),
            (preset.source.samples, preset.training)
        );
        assert_eq!(settings.source.sensor, base.source.sensor);
        assert_eq!(settings.source.scene.largest_compression, 0.1);
    }

    #[test]
    fn what_cannot_be_measured_says_why() {
        let base = SimulatedSettings::default();
        let error = |form: TradeOffForm| form.plan(&base).unwrap_err().to_string();
        let with_noises = |text: &str| TradeOffForm {
            noises: text.to_owned(),
            ..TradeOffForm::default()
        };
        assert!(error(with_noises("0, much")).contains("'much' is not a number"));
        assert!(error(with_noises("2")).contains("give from 0 to 1"));
        assert!(error(with_noises("NaN")).contains("give from 0 to 1"));
        assert!(error(with_noises(" , ")).contains("there are no values"));
        let none = TradeOffForm {
            decoders: [false; DecoderKind::ALL.len()],
            ..TradeOffForm::default()
        };
        assert!(error(none).contains("choose at least one"));
        let many: Vec<String> = (1..=200).map(|hidden| hidden.to_string()).collect();
        let many = TradeOffForm {
            hidden: many.join(" "),
            ..TradeOffForm::default()
        };
        assert!(error(many).contains("give fewer values"));
    }
}
