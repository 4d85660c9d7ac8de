use crate::{
    app::test_view::Frame,
    figure::surface::{OrbitCamera, ViewMode},
};

/// How the results are looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Snapshot of the test set.
    pub snapshot: usize,
    /// Shared by both surfaces.
    pub camera: OrbitCamera,
    /// In space or from above.
    pub mode: ViewMode,
    /// What the right-hand card shows.
    pub right: RightCard,
    /// The chart below.
    pub tab: BottomTab,
    /// The node under the pointer.
    pub node: Option<usize>,
    /// Whether each decoupled node has a bar that tells how far it is off in general.
    pub has_error_bars: bool,
    /// Dark or light.
    pub is_dark: bool,
}

/// What stands beside the actual surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RightCard {
    /// The surface that the network found.
    #[default]
    Decoupled,
    /// Its difference from the actual one.
    Error,
}

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

/// The snapshot being drawn, made anew only when it changes.
#[derive(Debug, Default)]
pub struct Frames {
    /// As it is.
    pub actual: Frame,
    /// As the network finds it, and the difference (decoupled − actual).
    pub decoupled: Option<(Frame, Frame)>,
    /// How far each node is off in general, where that is asked for: [`crate::evaluation::node_rms_mm`].
    pub spread_mm: Option<Vec<f64>>,
}

/// Decoupled − actual: z of the nodes and of the grid.
pub fn error_frame(actual: &Frame, decoupled: &Frame) -> Frame {
    let nodes = actual.nodes_mm.iter().zip(decoupled.nodes_mm.iter());
    let grid = actual.grid_mm.iter().zip(decoupled.grid_mm.iter());
    Frame {
        nodes_mm: nodes
            .map(|(actual, decoupled)| actual.with_z(decoupled.z - actual.z))
            .collect(),
        grid_mm: grid.map(|(actual, decoupled)| decoupled - actual).collect(),
    }
}
