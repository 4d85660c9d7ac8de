//! Loadings of the surface, and the drawing of deformations.

mod indenter;
mod press;
mod sampler;

pub use indenter::{Indenter, IndenterShape, Radii, TiltedBody};
pub(crate) use sampler::DeformationSampler;

use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use super::SceneError;

/// Loading of the top surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Loading {
    /// Every node is displaced by independent, uniformly distributed amounts: the paper's experiments.
    #[default]
    RandomNodes,
    /// A smooth random surface: nodes within the correlation length move alike.
    SmoothField {
        /// Distance over which the displacements of nodes stay correlated, in mm.
        correlation_length_mm: f64,
    },
    /// A body of known shape is pressed onto the surface at a random position.
    Indenter(Indenter),
}

impl fmt::Display for Loading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::RandomNodes => f.pad("random"),
            Self::SmoothField { correlation_length_mm } => f.pad(&format!("smooth:{correlation_length_mm}")),
            Self::Indenter(indenter) => f.pad(&format!("indenter:{}", indenter.name().replace(' ', "-"))),
        }
    }
}

impl FromStr for Loading {
    type Err = SceneError;

    /// Parses `random`, `smooth:MM`, `indenter` (a ball) or `indenter:SHAPE` with default sizes.
    fn from_str(text: &str) -> Result<Self, SceneError> {
        let unknown = || SceneError::LoadingText(text.to_owned());
        let loading = match text.trim().split_once(':') {
            None => match text.trim() {
                "random" => Self::RandomNodes,
                "indenter" => Self::Indenter(Indenter::default()),
                _ => return Err(unknown()),
            },
            Some(("smooth", length)) => Self::SmoothField {
                correlation_length_mm: length.parse().map_err(|_| unknown())?,
            },
            Some(("indenter", shape)) => {
                let found = Indenter::all()
                    .into_iter()
                    .find(|indenter| indenter.name().replace(' ', "-") == shape);
                Self::Indenter(found.ok_or_else(unknown)?)
            }
            Some(_) => return Err(unknown()),
        };
        loading.check()?;
        Ok(loading)
    }
}

impl Loading {
    pub(super) fn check(&self) -> Result<(), SceneError> {
        match self {
            Self::SmoothField {
                correlation_length_mm: length,
            } if !(*length > 0.0 && length.is_finite()) => Err(SceneError::CorrelationLength(*length)),
            Self::Indenter(indenter) => indenter.check(),
            Self::RandomNodes | Self::SmoothField { .. } => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loadings_survive_formatting_and_parsing() {
        for text in [
            "random",
            "smooth:4",
            "indenter:sphere",
            "indenter:flat-punch",
            "indenter:cylinder",
            "indenter:edge",
        ] {
            assert_eq!(text.parse::<Loading>().unwrap().to_string(), text);
        }
        assert_eq!("indenter".parse(), Ok(Loading::Indenter(Indenter::default())));
        for (text, word) in [
            ("smooth", "smooth:MM"),
            ("smooth:-1", "above 0"),
            ("indenter:cone", "indenter"),
            ("", "random"),
        ] {
            let message = text.parse::<Loading>().unwrap_err().to_string();
            assert!(message.contains(word), "{message}");
        }
    }
}
