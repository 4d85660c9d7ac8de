//! The interface of all views, and the shared state of their surfaces: mode, camera, colours, and the marked node.

use std::fmt::Debug;

use decoupler_core::problem::Channel;
use decoupler_files::{
    export::format_number,
    figure::{
        ColourMap, SequentialMap,
        surface::{OrbitCamera, Quantity, Surface, ViewMode},
    },
};
use eframe::egui::{
    Align, Button, ComboBox, CursorIcon, Key, Layout, Mesh, Popup, Rect, RichText, Sense, Ui, UiBuilder, Vec2,
    WidgetInfo, accesskit::Role, pos2, vec2,
};

use super::{Effect, FileInUse, Offers, Shared, Shown};
use crate::window::{
    surface_view::{ColourBar, SurfaceViewResponse},
    test_view::{HeightScale, SurfaceStyle},
    theme::{Theme, rgb, space, type_size},
    widgets::{section_heading_ui, segmented_ui, state_ui, status_progress_ui},
};

/// One of the views. It owns its private state and the handles of its threads, reads the shared state, and requests
/// everything else from the window.
pub trait View: Debug {
    /// Takes the events of its threads and follows the shared state, even while another view is displayed.
    fn take_events(&mut self, _shared: &Shared, _effects: &mut Vec<Effect>) {}

    /// Handles keys and the pointer before anything is drawn: offers its commands, and carries out those that the user
    /// asked for.
    fn take_commands(&mut self, _offers: &mut Offers<'_>, _shared: &Shared, _effects: &mut Vec<Effect>) {}

    /// Returns its work and its files, which closing the window would cut short or another file must not overwrite.
    fn holdings(&self, _shared: &Shared) -> Holdings {
        Holdings::default()
    }

    /// Returns what it shows and the user can export, or the reasons why that is not available now.
    fn shown<'a>(&'a self, _shared: &'a Shared) -> Vec<Shown<'a>> {
        Vec::new()
    }

    /// Shows its tools at the right of the top bar, from right to left.
    fn tools_ui(&mut self, _ui: &mut Ui, _shared: &Shared, _effects: &mut Vec<Effect>) {}

    /// Shows its column on the left.
    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>);

    /// Shows its column on the right, where [`ViewKind::columns`] has one.
    fn report_ui(&mut self, _ui: &mut Ui, _shared: &Shared, _effects: &mut Vec<Effect>) {}

    /// Shows its middle. Returns the status line at the bottom, or `None` for that of the training.
    fn body_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) -> Option<Status>;
}

/// The views, in the order of the top bar.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ViewKind {
    /// One training and the sensor that it decodes.
    #[default]
    Train,
    /// The paper's tables and sweeps.
    Study,
    /// Two finished trainings side by side.
    Compare,
    /// What the readings determine.
    Sensor,
    /// Speed and accuracy of each decoder.
    TradeOff,
    /// Frames decoded as they arrive.
    Live,
}

impl ViewKind {
    /// All views.
    pub const ALL: [Self; 6] = [
        Self::Train,
        Self::Study,
        Self::Compare,
        Self::Sensor,
        Self::TradeOff,
        Self::Live,
    ];

    /// Returns its name in the top bar.
    pub fn name(self) -> &'static str {
        match self {
            Self::Train => "Train",
            Self::Study => "Experiments",
            Self::Compare => "Compare",
            Self::Sensor => "Identifiability",
            Self::TradeOff => "Trade-off",
            Self::Live => "Live",
        }
    }

    /// Returns the key that shows it, with Ctrl.
    pub fn key(self) -> Key {
        const KEYS: [Key; 6] = [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num6];
        KEYS[self as usize]
    }

    /// Returns its columns in a window of this width in points.
    pub fn columns(self, window_width: f32) -> Columns {
        let is_narrow = window_width < MIN_WIDTH_FOR_REPORT;
        Columns {
            form_width: space(if self == Self::Train && is_narrow { 62 } else { 68 }),
            has_report: self == Self::Train && !is_narrow,
        }
    }
}

/// Width of a window, in points, from which a column on the right leaves the middle enough room.
pub const MIN_WIDTH_FOR_REPORT: f32 = 1400.0;

/// The columns next to the middle of a view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Columns {
    /// Width of the one on the left, in points.
    pub form_width: f32,
    /// True if there is a column on the right.
    pub has_report: bool,
}

/// What a view is doing, as the line at the bottom tells it.
#[derive(Clone, Debug, PartialEq)]
pub struct Status {
    /// Colour of the dot before the text.
    pub tone: Tone,
    /// The state in a few words.
    pub text: String,
    /// Figures and remarks, in dim text.
    pub notes: Vec<String>,
    /// Name of the work, and its share that is done.
    pub progress: Option<(&'static str, f32)>,
}

impl Status {
    /// A state without figures.
    pub fn new(tone: Tone, text: impl Into<String>) -> Self {
        Self {
            tone,
            text: text.into(),
            notes: Vec::new(),
            progress: None,
        }
    }

    /// Adds a remark in dim text.
    #[must_use]
    pub fn with_note(mut self, note: impl Into<String>) -> Self {
        self.notes.push(note.into());
        self
    }

    /// Shows it in the line at the bottom.
    pub fn show(&self, ui: &mut Ui) {
        let palette = Theme::of(ui).palette;
        let colour = match self.tone {
            Tone::Calm => palette.dim,
            Tone::Busy => palette.accent,
            Tone::Good => palette.good,
            Tone::Warning => palette.warning,
            Tone::Bad => palette.bad,
        };
        ui.horizontal_centered(|ui| {
            state_ui(ui, colour, &self.text);
            for note in &self.notes {
                ui.label(RichText::new(note).size(type_size().note).color(palette.dim));
            }
            if let Some((name, share)) = self.progress {
                status_progress_ui(ui, name, share);
            }
        });
    }
}

/// Colour of a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// Nothing happens.
    Calm,
    /// Work is under way.
    Busy,
    /// Work has ended well.
    Good,
    /// Work has ended early.
    Warning,
    /// Work has failed.
    Bad,
}

/// Work and files of a view.
#[derive(Debug, Default)]
pub struct Holdings {
    /// True while its threads compute.
    pub is_computing: bool,
    /// Work that closing the window would cut short, or whose result it would discard.
    pub unfinished: Vec<Unfinished>,
    /// Files in use, which must not be overwritten.
    pub files: Vec<FileInUse>,
}

/// Work that closing the window would cut short, or whose result it would discard.
#[derive(Debug)]
pub struct Unfinished {
    /// Name that distinguishes the work from other work of the same view: "Training".
    pub work: &'static str,
    /// Its progress: "epoch 12 of 1000".
    pub progress: String,
}

impl Unfinished {
    /// Work with its progress.
    pub fn new(work: &'static str, progress: String) -> Self {
        Self { work, progress }
    }
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
    /// Range of heights that colours and axes span.
    pub heights: HeightScale,
    /// Error at the ends of the colour scale, in millimetres, while it is locked.
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

/// Surface shown for a network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RightCard {
    /// The decoded surface.
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
    // Each card sets the mark only while the pointer is over it, so that it keeps the mark of the other card.
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

/// Width of the sample of a colour map, in points.
const SAMPLE: f32 = space(16);
/// Number of pieces of the sample.
const PIECES: usize = 32;

/// The colour scale in `slot`. A click opens its options: the colour map, and whether the scale is locked. `note` is shown
/// under the pointer.
pub fn colour_scale_ui(ui: &mut Ui, slot: Rect, scale: &Surface, note: &str, look: Look, effects: &mut Vec<Effect>) {
    let mut slot_ui = ui.new_child(UiBuilder::new().max_rect(slot));
    let theme = Theme::of(ui);
    let bar = ColourBar { scale, theme }.show(&mut slot_ui, slot.height());
    let mut changed = look;
    Popup::menu(&bar).show(|ui| {
        // A menu justifies its lines.
        ui.with_layout(Layout::top_down(Align::Min), |ui| {
            ui.set_width(space(66));
            choices_ui(ui, scale, look, &mut changed);
        });
    });
    let state = match scale.quantity {
        Quantity::Height | Quantity::Target(_) if look.heights == HeightScale::Fitted => {
            " It spans the displayed heights."
        }
        Quantity::Error if look.error_limit_mm.is_some() => " It is locked.",
        _ => "",
    };
    let hint = format!("{note} Click to choose colours, or to lock or free the scale.{state}");
    bar.on_hover_cursor(CursorIcon::PointingHand).on_hover_text(hint);
    if changed != look {
        effects.push(Effect::Look(changed));
    }
}

/// The options of a colour scale; changes `look`.
fn choices_ui(ui: &mut Ui, scale: &Surface, look: Look, changed: &mut Look) {
    let theme = Theme::of(ui);
    if scale.quantity.is_diverging() {
        let text = "Errors have the colour of the card at zero, blue below and orange above.";
        ui.label(RichText::new(text).size(type_size().note).color(theme.palette.dim));
    } else {
        section_heading_ui(ui, "Colours");
        for map in SequentialMap::ALL {
            if map_ui(ui, map, look.colours) {
                changed.colours = map;
            }
        }
    }
    match scale.quantity {
        Quantity::Height | Quantity::Target(_) => {
            let is_locked = look.heights == HeightScale::Stroke;
            let meanings = [
                "Spans the whole stroke, from full compression to rest: colours mean the same on every surface.",
                "Spans the displayed heights: small differences are visible, but colours are not comparable between plots.",
            ];
            let meanings = match scale.quantity {
                Quantity::Height => meanings,
                _ => [
                    "Spans the values of all test samples: colours mean the same for every sample.",
                    "Spans the displayed values: small differences are visible, but colours are not comparable between plots.",
                ],
            };
            if let Some(locked) = lock_ui(ui, is_locked, meanings) {
                changed.heights = if locked {
                    HeightScale::Stroke
                } else {
                    HeightScale::Fitted
                };
            }
        }
        Quantity::Error => {
            let limit_mm = *scale.range.end();
            let locked = format!("Keeps ± {} mm for whatever is shown next.", format_number(limit_mm));
            let meanings = [&*locked, "Spans ± the largest displayed error."];
            if let Some(locked) = lock_ui(ui, look.error_limit_mm.is_some(), meanings) {
                changed.error_limit_mm = locked.then_some(limit_mm);
            }
        }
        // The limit of errors is in millimetres, which these are not.
        Quantity::Pattern | Quantity::Sensitivity | Quantity::TargetError(_) => {}
    }
}

/// A choice of a colour map, with a sample. Returns true if the user newly picked it.
fn map_ui(ui: &mut Ui, map: SequentialMap, chosen: SequentialMap) -> bool {
    let (picked, sample) = ui
        .horizontal(|ui| {
            let button = Button::selectable(map == chosen, map.name()).min_size(vec2(space(24), space(6)));
            let picked = ui.add(button).on_hover_text(map.meaning()).clicked();
            let (sample, _) = ui.allocate_exact_size(Vec2::new(SAMPLE, space(3)), Sense::hover());
            (picked, sample)
        })
        .inner;
    ui.painter().add(gradient(sample, map.colours()));
    picked && map != chosen
}

/// The choice between locked and free. Returns the one newly picked.
fn lock_ui(ui: &mut Ui, is_locked: bool, meanings: [&str; 2]) -> Option<bool> {
    section_heading_ui(ui, "Scale");
    let mut picked = None;
    for ((option, text), meaning) in [(true, "Locked"), (false, "Free")].into_iter().zip(meanings) {
        let button = Button::selectable(option == is_locked, text).min_size(vec2(space(24), space(6)));
        let button = ui.add(button);
        button.widget_info(|| WidgetInfo::selected(Role::RadioButton, true, option == is_locked, text));
        if button.clicked() && option != is_locked {
            picked = Some(option);
        }
        let dim = Theme::of(ui).palette.dim;
        ui.label(RichText::new(meaning).size(type_size().note).color(dim));
    }
    picked
}

fn gradient(rect: Rect, map: &ColourMap) -> Mesh {
    let mut mesh = Mesh::default();
    for piece in 0..=PIECES {
        let part = piece as f32 / PIECES as f32;
        let x = rect.left() + part * rect.width();
        mesh.colored_vertex(pos2(x, rect.top()), rgb(map.at(part)));
        mesh.colored_vertex(pos2(x, rect.bottom()), rgb(map.at(part)));
        if piece > 0 {
            let at = 2 * piece as u32;
            mesh.add_triangle(at - 2, at - 1, at);
            mesh.add_triangle(at - 1, at, at + 1);
        }
    }
    mesh
}
