//! What the surfaces of all views have in common: their mode, their camera, and the node that is marked on neighbours.

use std::{fmt::Debug, path::PathBuf};

use decoupler_core::evaluation::Channel;
use decoupler_files::figure::{
    SequentialMap,
    surface::{OrbitCamera, ViewMode},
};
use eframe::egui::{ComboBox, Context, Ui};

use super::{Effect, Export, FileInUse, Offers, Shared, Unfinished, training_status_ui};
use crate::window::{
    surface_view::SurfaceViewResponse,
    test_view::{HeightScale, SurfaceStyle},
    theme::space,
    widgets::segmented_ui,
};

/// One of the views. It owns what only it shows and the handles of its own threads; it reads what is shared, and asks the
/// window for everything else.
pub trait View: Debug {
    /// Its name in the top bar.
    fn name(&self) -> &'static str;

    /// It is displayed.
    fn enter(&mut self, _shared: &Shared) {}

    /// Takes what its threads have to report and follows what is shared, also while another view is displayed.
    fn take_events(&mut self, _shared: &Shared, _effects: &mut Vec<Effect>) {}

    /// Returns true while its threads compute.
    fn is_working(&self) -> bool {
        false
    }

    /// Takes files dropped on the window; false if they are not for it.
    fn take_files(&mut self, _paths: &[PathBuf], _shared: &Shared, _effects: &mut Vec<Effect>) -> bool {
        false
    }

    /// Returns the work that closing the window would cut short, also while it is being prepared.
    fn unfinished(&self, _shared: &Shared) -> Vec<Unfinished> {
        Vec::new()
    }

    /// Returns the files that it needs, over which nothing is to be saved.
    fn files_in_use(&self) -> Vec<FileInUse> {
        Vec::new()
    }

    /// Offers what can be done in it, and does what the user wants of that.
    fn offer_actions(&mut self, _offers: &mut Offers<'_>, _shared: &Shared, _effects: &mut Vec<Effect>) {}

    /// Does what the pointer means before anything is drawn, so that all of the window shows it in the same frame.
    fn take_pointer(&mut self, _ctx: &Context, _shared: &Shared) {}

    /// Returns the columns of a window of this width in points.
    fn columns(&self, _window_width: f32) -> Columns {
        Columns {
            form_width: space(68),
            has_report: false,
        }
    }

    /// Its tools at the right of the top bar, from right to left.
    fn tools_ui(&mut self, _ui: &mut Ui, _shared: &Shared, _effects: &mut Vec<Effect>) {}

    /// Returns everything that it can export, and what it cannot now with the reason. The order is that of the menu;
    /// forms of one thing follow each other.
    fn exports<'a>(&'a self, _shared: &'a Shared) -> Vec<Export<'a>> {
        Vec::new()
    }

    /// Its column on the left.
    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>);

    /// Its column on the right, where [`Self::columns`] has one.
    fn report_ui(&mut self, _ui: &mut Ui, _shared: &Shared, _effects: &mut Vec<Effect>) {}

    /// Its middle.
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

/// The choice between surfaces in space and from above.
pub fn view_mode_ui(ui: &mut Ui, look: Look, effects: &mut Vec<Effect>) {
    let modes = [(ViewMode::ThreeD, "3-D"), (ViewMode::Top, "Top view")];
    let picked = segmented_ui(ui, "Surface view", &modes, look.mode, false);
    effects.extend(picked.map(|mode| Effect::Look(Look { mode, ..look })));
}

/// Turns all surfaces as this one was turned, and marks the node under the pointer on its neighbours too.
pub fn follow_surface(shown: &SurfaceViewResponse, look: Look, marked: &mut Option<usize>, effects: &mut Vec<Effect>) {
    if shown.camera != look.camera {
        let camera = shown.camera;
        effects.push(Effect::Look(Look { camera, ..look }));
    }
    // Each card speaks for the pointer only while it is over it, so that the other card's mark stays.
    if shown.response.contains_pointer() && shown.hovered_node != *marked {
        *marked = shown.hovered_node;
        shown.response.ctx.request_repaint();
    }
}

/// The list of targets behind `name`, where there are several.
pub fn target_choice_ui(ui: &mut Ui, name: &str, id: &str, targets: &[Channel], target: &mut usize) {
    *target = (*target).min(targets.len().saturating_sub(1));
    if targets.len() < 2 {
        return;
    }
    ui.horizontal(|ui| {
        let label = ui.label(name);
        let combo = ComboBox::from_id_salt(id).selected_text(targets[*target].title());
        let picked = combo.show_ui(ui, |ui| {
            for (index, of) in targets.iter().enumerate() {
                ui.selectable_value(target, index, of.title());
            }
        });
        picked.response.labelled_by(label.id);
    });
}
