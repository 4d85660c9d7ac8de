use std::path::PathBuf;

use crate::{
    app::{
        file_task::FileTask,
        shared::{BottomTab, RightCard, View},
        training_worker::ExportKind,
        views::{
            compare::RunsAction,
            experiments::ExperimentAction,
            identifiability::IdentifiabilityAction,
            trade_off::TradeAction,
            train::{PaperFigure, ShownPicture},
        },
    },
    evaluation::{NodeAddress, SimulatedSettings},
    figure::surface::{OrbitCamera, ViewMode},
    training::TrainerState,
};

/// What the user meant. Panels return these; one place applies them.
#[derive(Clone, Debug)]
pub enum Action {
    /// Change the settings of the next training.
    Configure(Box<SimulatedSettings>),
    /// Show the training that has these settings and whose starts stand so.
    TakeUp(Box<SimulatedSettings>, Vec<TrainerState>),
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
    /// Show this view.
    ShowView(View),
    /// Do this in the Experiments view.
    Experiments(ExperimentAction),
    /// Do this in the Identifiability view.
    Identifiability(IdentifiabilityAction),
    /// Do this in the Trade-off view.
    Trade(TradeAction),
    /// Whether each decoupled node has an error bar.
    ShowErrorBars(bool),
    /// Train what this figure of the paper shows, unless it is there, and look at it so.
    ShowPaperFigure(PaperFigure),
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
    /// Write a picture in view as SVG or PNG, as the path ends.
    ExportPicture(ShownPicture, PathBuf),
    /// Take up the training saved in this file.
    OpenCheckpoint(PathBuf),
    /// Unfold the table of other decoders, or fold it.
    ShowDecoders(bool),
    /// Do this with the run list.
    Runs(RunsAction),
    /// Close the question for a path.
    CancelSave,
    /// Close the notice.
    DismissNotice,
    /// Start the worker again after it died.
    RestartWorker,
}
