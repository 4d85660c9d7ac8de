/// The charts below the surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BottomTab {
    /// Error against epoch.
    #[default]
    Loss,
    /// Gradient, damping or rate, and validation failures against epoch.
    TrainingState,
    /// Distribution of the errors of z.
    ErrorHistogram,
    /// Decoupled against actual z.
    Regression,
    /// The nodes of the snapshot: the paper's Fig. 6.
    Nodes,
    /// A section through the surfaces of the snapshot.
    Section,
    /// Readings of the snapshot, where there is no room for a card of their own.
    Readings,
}

impl BottomTab {
    /// The word for the chart in a file's name.
    pub(super) fn file_word(self) -> &'static str {
        match self {
            Self::Loss => "loss",
            Self::TrainingState => "training-state",
            Self::ErrorHistogram => "histogram",
            Self::Regression => "regression",
            Self::Nodes => "nodes",
            Self::Section => "section",
            Self::Readings => "readings",
        }
    }
}
