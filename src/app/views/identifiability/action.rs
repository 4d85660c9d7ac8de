use super::Question;

/// What the user meant in the Identifiability view.
#[derive(Clone, Debug)]
pub enum IdentifiabilityAction {
    /// Look at this sensor in this scene.
    Ask(Box<Question>),
    /// Look at the sensor and the scene of the Train view again.
    TakeDraft,
    /// Take array and geometry over into the Train view.
    UseSensor,
    /// Show the pattern and the sensitivity along this axis: 0 for x, 1 for y, 2 for z.
    ShowAxis(usize),
}

impl From<IdentifiabilityAction> for crate::app::Action {
    fn from(action: IdentifiabilityAction) -> Self {
        Self::Identifiability(action)
    }
}
