//! The interface of all views.

use std::{fmt::Debug, path::PathBuf};

use eframe::egui::{Context, Ui};

use super::{Effect, FileInUse, Offers, Shared, Shown, Unfinished, training_status_ui};
use crate::window::theme::space;

/// One of the views. It owns its private state and the handles of its threads, reads the shared state, and requests
/// everything else from the window.
pub trait View: Debug {
    /// Returns its name in the top bar.
    fn name(&self) -> &'static str;

    /// Called when the view is displayed.
    fn enter(&mut self, _shared: &Shared) {}

    /// Takes the events of its threads and follows the shared state, even while another view is displayed.
    fn take_events(&mut self, _shared: &Shared, _effects: &mut Vec<Effect>) {}

    /// Returns true while its threads compute.
    fn is_working(&self) -> bool {
        false
    }

    /// Takes files dropped on the window; false if they are not for it.
    fn take_files(&mut self, _paths: &[PathBuf], _shared: &Shared, _effects: &mut Vec<Effect>) -> bool {
        false
    }

    /// Returns the work that closing the window would cut short or discard, including work being prepared.
    fn unfinished(&self, _shared: &Shared) -> Vec<Unfinished> {
        Vec::new()
    }

    /// Returns the files in use, which must not be overwritten.
    fn files_in_use(&self) -> Vec<FileInUse> {
        Vec::new()
    }

    /// Offers its actions, and carries out the ones that the user asked for.
    fn offer_actions(&mut self, _offers: &mut Offers<'_>, _shared: &Shared, _effects: &mut Vec<Effect>) {}

    /// Handles the pointer before anything is drawn, so that the whole window shows the effect in the same frame.
    fn take_pointer(&mut self, _ctx: &Context, _shared: &Shared) {}

    /// Returns the columns of a window of this width in points.
    fn columns(&self, _window_width: f32) -> Columns {
        Columns {
            form_width: space(68),
            has_report: false,
        }
    }

    /// Shows its tools at the right of the top bar, from right to left.
    fn tools_ui(&mut self, _ui: &mut Ui, _shared: &Shared, _effects: &mut Vec<Effect>) {}

    /// Returns what it shows and the user can export, or the reasons why that is not available now.
    fn shown<'a>(&'a self, _shared: &'a Shared) -> Vec<Shown<'a>> {
        Vec::new()
    }

    /// Shows its column on the left.
    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>);

    /// Shows its column on the right, where [`Self::columns`] has one.
    fn report_ui(&mut self, _ui: &mut Ui, _shared: &Shared, _effects: &mut Vec<Effect>) {}

    /// Shows its middle.
    fn body_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>);

    /// Shows the status line at the bottom: that of the training, unless the view has one of its own.
    fn status_ui(&self, ui: &mut Ui, shared: &Shared) {
        training_status_ui(ui, shared);
    }
}

/// The columns next to the middle of a view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Columns {
    /// Width of the one on the left, in points.
    pub form_width: f32,
    /// True if there is a column on the right.
    pub has_report: bool,
}
