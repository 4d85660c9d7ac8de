//! How the surface is loaded, and the drawing of deformations.

mod indenter;
mod sampler;
mod smooth_field;

pub use indenter::{Indenter, IndenterShape, Span};
pub use sampler::DeformationSampler;

use serde::{Deserialize, Serialize};

use super::SceneError;

/// How the top surface is loaded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Loading {
    /// Every node is displaced by independent, uniformly distributed amounts: the paper's experiments.
    #[default]
    RandomNodes,
    /// A smooth random surface: neighbours move alike within the correlation length.
    SmoothField {
        /// Distance over which displacements resemble each other.
        correlation_length_mm: f64,
    },
    /// A body of known shape is pressed somewhere onto the surface.
    Indenter(Indenter),
}

impl Loading {
    pub(super) fn check(&self) -> Result<(), SceneError> {
        match self {
            Self::RandomNodes => Ok(()),
            Self::SmoothField {
                correlation_length_mm: length,
            } => {
                if *length > 0.0 && length.is_finite() {
                    Ok(())
                } else {
                    Err(SceneError::CorrelationLength(*length))
                }
            }
            Self::Indenter(indenter) => indenter.check(),
        }
    }
}
