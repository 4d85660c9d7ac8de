use crate::window::test_view::{HeightScale, SurfaceStyle};
use decoupler_files::figure::{
    SequentialMap,
    surface::{OrbitCamera, ViewMode},
};

/// Camera, mode and colours in which all views draw surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Shared by all surfaces.
    pub camera: OrbitCamera,
    /// In space or from above.
    pub mode: ViewMode,
    /// Dark or light.
    pub is_dark: bool,
    /// Colours of values that do not diverge.
    pub colours: SequentialMap,
    /// Heights that colours and axes span.
    pub heights: HeightScale,
    /// Errors at the ends of the colours, in millimetres, while they are locked.
    pub error_limit_mm: Option<f64>,
}

impl Look {
    /// Returns the look of the surfaces of a test set.
    pub fn style(&self) -> SurfaceStyle {
        SurfaceStyle {
            mode: self.mode,
            colours: self.colours,
            heights: self.heights,
            error_limit_mm: self.error_limit_mm,
        }
    }
}

/// Surface shown of a network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RightCard {
    /// The surface that it found.
    #[default]
    Decoupled,
    /// Its difference from the actual one.
    Error,
}
