/// The charts below the surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BottomTab {
    /// Error against epoch.
    #[default]
    Loss,
    /// Gradient, damping or rate, and validation failures against epoch.
    TrainingState,
    /// How the errors of z are distributed.
    ErrorHistogram,
    /// Decoupled against actual z.
    Regression,
    /// The nodes of the snapshot: the paper's Fig. 6.
    Nodes,
}
