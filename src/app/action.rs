use std::path::PathBuf;

use super::{
    export_kind::ExportKind,
    file_task::FileTask,
    state::{BottomTab, RightCard},
    surface_view::{OrbitCamera, ViewMode},
};
use crate::evaluation::{NodeAddress, RunSettings};

/// What the user meant. Panels return these; one place applies them.
#[derive(Clone, Debug)]
pub enum Action {
    /// Change the settings of the next training.
    Configure(Box<RunSettings>),
    /// Begin training.
    Train,
    /// Hold the training.
    Pause,
    /// Go on with it.
    Resume,
    /// End it.
    Stop,
    /// Show this snapshot of the test set.
    ShowSnapshot(usize),
    /// Look at both surfaces from here.
    MoveCamera(OrbitCamera),
    /// Draw both surfaces so.
    SetViewMode(ViewMode),
    /// Show this on the right-hand card.
    SetRightCard(RightCard),
    /// Mark this node of the snapshot on every picture, or none.
    HoverNode(Option<usize>),
    /// Go to this node and mark it.
    GoTo(NodeAddress),
    /// Show this chart.
    ShowTab(BottomTab),
    /// Dark or light.
    SetDark(bool),
    /// Go on from the present weights with the method and the epochs of the settings.
    Continue,
    /// Ask for the path of a file.
    ChooseFile(FileTask),
    /// Ask for the path in the window itself.
    TypePath(FileTask),
    /// Change the path being typed.
    EditPath(String),
    /// Write the file.
    Export(ExportKind, PathBuf),
    /// Take up the training saved in this file.
    OpenCheckpoint(PathBuf),
    /// Close the question for a path.
    CancelSave,
    /// Close the notice.
    DismissNotice,
    /// Start the worker again after it died.
    RestartWorker,
}
