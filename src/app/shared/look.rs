use crate::figure::surface::{OrbitCamera, ViewMode};

/// How surfaces are looked at, in whatever view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Shared by all surfaces.
    pub camera: OrbitCamera,
    /// In space or from above.
    pub mode: ViewMode,
    /// Dark or light.
    pub is_dark: bool,
}

/// What is shown of a network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RightCard {
    /// The surface that it found.
    #[default]
    Decoupled,
    /// Its difference from the actual one.
    Error,
}
