//! The interface of all views.

use std::fmt::{Debug, Display};

use eframe::egui::{Align, Key, Label, Layout, RichText, Sense, TextStyle, TextWrapMode, Ui, Vec2, WidgetText};

use super::{Effect, FileInUse, Offers, Shared, Shown};
use crate::window::{
    theme::{Theme, space, type_size},
    widgets::progress_bar_ui,
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

    /// Shows its tools at the right of the top bar.
    fn tools_ui(&mut self, _ui: &mut Ui, _shared: &Shared, _effects: &mut Vec<Effect>) {}

    /// Shows its column on the left; not called while that is hidden in a narrow window.
    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>);

    /// Shows its column on the right, where [`Shared::has_report`] is true.
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
    /// Many trainings or measurements at once.
    Study,
    /// Two finished trainings side by side.
    Compare,
    /// What the readings determine.
    Sensor,
    /// Frames decoded as they arrive.
    Live,
}

impl ViewKind {
    /// All views.
    pub const ALL: [Self; 5] = [Self::Train, Self::Study, Self::Compare, Self::Sensor, Self::Live];

    /// Returns its name in the top bar.
    pub fn name(self) -> &'static str {
        match self {
            Self::Train => "Train",
            Self::Study => "Study",
            Self::Compare => "Compare",
            Self::Sensor => "Sensor",
            Self::Live => "Live",
        }
    }

    /// Returns the key that shows it, with Ctrl.
    pub fn key(self) -> Key {
        const KEYS: [Key; 5] = [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5];
        KEYS[self as usize]
    }
}

/// Status of a view, shown in the line at the bottom.
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
            ui.spacing_mut().item_spacing.x = space(4);
            let (dot, _) = ui.allocate_exact_size(Vec2::splat(space(2)), Sense::hover());
            ui.painter().circle_filled(dot.center(), 4.0, colour);
            let text = |text: &str| RichText::new(text).size(type_size().note);
            ui.add(Label::new(text(&self.text)).truncate());
            let for_progress = self.progress.map_or(0.0, |_| space(44));
            for note in &self.notes {
                let note = text(note).color(palette.dim);
                let note = WidgetText::from(note).into_galley(ui, Some(TextWrapMode::Extend), 0.0, TextStyle::Body);
                // What does not fit is left out, not cut.
                if note.size().x < ui.available_width() - for_progress {
                    ui.label(note);
                }
            }
            if let Some((name, share)) = self.progress {
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                    ui.set_max_width(space(40).min(ui.available_width()));
                    progress_bar_ui(ui, name, share, &format!("{:.0} %", 100.0 * share.clamp(0.0, 1.0)));
                });
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
    /// Work that closing the window would cut short, or whose result it would discard.
    pub unfinished: Vec<Unfinished>,
    /// Files in use, which must not be overwritten.
    pub files: Vec<FileInUse>,
}

/// Work that closing the window would cut short, or whose result it would discard.
#[derive(Debug)]
pub struct Unfinished {
    /// Its view or place, and the name that distinguishes it from other work there: "Train: Training".
    pub name: String,
    /// Its progress: "epoch 12 of 1000".
    pub progress: String,
}

impl Unfinished {
    /// Work at a place, with its progress.
    pub fn new(place: &str, work: impl Display, progress: impl Into<String>) -> Self {
        Self {
            name: format!("{place}: {work}"),
            progress: progress.into(),
        }
    }
}
