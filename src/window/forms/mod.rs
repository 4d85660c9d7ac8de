//! Forms of settings, for every view and both sources: sensor, scene, network and training. A field is a [`Row`] of the
//! table of settings; what is chosen automatically is shown disabled, with the reason.

mod network;
mod presets;
mod scene;
mod sensor;
mod training;

pub use network::{hidden_ui, workload_ui};
pub use presets::{follow_preset, preset_between, preset_ui};
pub use scene::{SAMPLES, of_samples, of_scene, scene_ui};
pub use sensor::{array_ui, geometry_ui};
pub use training::method_ui;

use std::{collections::HashMap, sync::LazyLock};

use decoupler_core::{
    evaluation::{RUN_OPTIONS, RunSettings, TrainingSize},
    scene::RowModel,
    settings::{Field, Kind, Setting, Value},
};
use eframe::egui::{Align, Align2, TextEdit, Ui, vec2};

use super::{
    glossary,
    theme::space,
    widgets::{
        fields::{
            capitalised, combo_ui, count_ui, field_ui, in_percent, input_text, list_ui, percent_ui, quantity_ui,
            seed_ui, usually,
        },
        fold_ui,
    },
};

/// Settings in a form.
#[derive(Debug)]
pub struct Fields<'a> {
    /// The settings, which the fields change.
    pub settings: &'a mut RunSettings,
    /// Who sets network and training.
    pub set_by: SetBy<'a>,
    /// Defaults, to which a double click resets a field.
    usual: RunSettings,
}

/// Who sets the fields of a form.
#[derive(Clone, Copy, Debug)]
pub enum SetBy<'a> {
    /// The user.
    User,
    /// A choice by cross-validation when the training begins; the settings it chose, if it has.
    Choice(Option<&'a RunSettings>),
}

/// A row of the table of settings, with its name and its look in the window. Its tooltip is the definition of the name in
/// the glossary or, for other names, the explanation in the table; so are those of its choices.
#[derive(Clone, Copy, Debug)]
pub struct Row(&'static str, &'static str, Look);

/// Look of a field.
#[derive(Clone, Copy, Debug)]
pub enum Look {
    /// Number with this unit; a fraction of one if that is %.
    Number(&'static str),
    /// Drop-down list.
    List(&'static [Choice]),
    /// Drop-down list below the name, for texts that fill a line.
    Below(fn() -> Vec<Choice>),
}

/// Value of a setting in the table, and its text in the window.
pub type Choice = (&'static str, &'static str);

/// Value of a setting that has not been chosen yet.
const AUTOMATIC: &str = "automatic";

/// Tooltip of every setting that is chosen automatically.
const REASON: &str = "Chosen by cross-validation when you press Train. To set it yourself, untick “Choose settings \
                      automatically”.";

impl<'a> Fields<'a> {
    /// A form for these settings, set by the user.
    pub fn new(settings: &'a mut RunSettings) -> Self {
        let mut usual = match settings.simulation() {
            Some(_) => RunSettings::default(),
            None => RunSettings::measured(RowModel::Shared),
        };
        usual.choose_method(settings.training.method.with_defaults());
        Self {
            settings,
            set_by: SetBy::User,
            usual,
        }
    }

    /// Shows the fields of those rows that apply.
    pub fn show(&mut self, ui: &mut Ui, rows: &[Row]) {
        for row in rows {
            match self.set_by {
                _ if !row.setting().applies(self.settings) => {}
                SetBy::User => row.ui(ui, self.settings, &self.usual),
                SetBy::Choice(chosen) => {
                    let value = chosen.and_then(|settings| row.text(settings));
                    chosen_ui(ui, row.1, value, matches!(row.2, Look::Below(_)));
                }
            }
        }
    }
}

/// The folded settings that are rarely changed: geometry, inputs of the network, and training. `is_new` is false for a paused
/// training, which keeps its network; `size` is that of the next training.
pub fn advanced_ui(
    ui: &mut Ui,
    fields: &mut Fields<'_>,
    is_new: bool,
    has_recorded_rows: bool,
    size: Option<TrainingSize>,
) {
    let summary = match fields.set_by {
        SetBy::User => network::of_inputs(fields.settings),
        SetBy::Choice(chosen) => chosen.map_or_else(|| AUTOMATIC.to_owned(), network::of_inputs),
    };
    fold_ui(ui, "Advanced", &summary, |ui| {
        ui.add_enabled_ui(is_new, |ui| {
            network::inputs_ui(ui, fields, has_recorded_rows, size);
        });
        training::training_ui(ui, fields, is_new);
        if let Some(simulation) = fields.settings.simulation_mut() {
            let summary = format!("height {} mm", input_text(simulation.sensor.geometry.height_mm));
            fold_ui(ui, "Geometry", &summary, |ui| {
                ui.add_enabled_ui(is_new, |ui| geometry_ui(ui, &mut simulation.sensor));
            });
        }
    });
}

impl Row {
    fn setting(&self) -> &'static Setting<RunSettings> {
        let found = RUN_OPTIONS.iter().find(|option| option.setting.name == self.0);
        &found.expect("a row of the table").setting
    }

    fn choices(&self) -> Vec<Choice> {
        match self.2 {
            Look::Number(_) => Vec::new(),
            Look::List(choices) => choices.to_vec(),
            Look::Below(choices) => choices(),
        }
    }

    /// Returns the value as the window writes it; none if the setting does not apply.
    fn text(&self, settings: &RunSettings) -> Option<String> {
        Some(match self.setting().get(settings)? {
            Value::Number(value) => input_text(value),
            Value::Integer(value) => value.to_string(),
            Value::Text(value) => {
                let choice = self.choices().into_iter().find(|(name, _)| kind(name) == kind(&value));
                choice.map_or_else(|| capitalised(&value), |(_, text)| text.to_owned())
            }
        })
    }

    fn ui(&self, ui: &mut Ui, settings: &mut RunSettings, usual: &RunSettings) {
        let (Self(_, label, look), setting) = (*self, self.setting());
        let hint = meaning(label).unwrap_or(setting.help);
        if let Look::Number(unit) = look {
            return number_ui(ui, [label, hint, unit], setting, settings, usual);
        }
        let Some(Value::Text(value)) = setting.get(settings) else {
            return;
        };
        let is_possible = |name: &str| {
            setting
                .set(&mut settings.clone(), &Value::Text(name.to_owned()))
                .is_ok()
        };
        let choices = self.choices().into_iter().filter(|(name, _)| is_possible(name));
        let choices = choices.map(|(name, text)| (name, text, meaning(text).unwrap_or(setting.help)));
        let choices = Vec::from_iter(choices);
        let listed = choices.iter().find(|(name, ..)| kind(name) == kind(&value));
        let selected = listed.map_or("", |(name, ..)| *name);
        let picked = match look {
            Look::List(_) => list_ui(ui, label, hint, &choices, selected),
            _ => {
                let (named, width) = (ui.label(label).on_hover_text(hint), ui.available_width());
                let mut picked = None;
                combo_ui(ui, label, width, &choices, selected, &mut picked).labelled_by(named.id);
                picked
            }
        };
        if let Some(picked) = picked {
            let set = setting.set(settings, &Value::Text(picked.to_owned()));
            debug_assert!(set.is_ok(), "{set:?}");
        }
    }
}

/// Returns the values of a setting of the network or its training, and what the window calls them; none of a number.
pub fn choices(setting: &str) -> Vec<Choice> {
    let mut rows = network::INPUTS.iter().chain([&training::METHOD]);
    rows.find(|row| row.0 == setting).map_or_else(Vec::new, Row::choices)
}

/// Returns the definition of a term.
pub fn meaning(term: &str) -> Option<&'static str> {
    static HINTS: LazyLock<HashMap<&str, &str>> = LazyLock::new(|| {
        let terms = glossary::groups().into_iter().flat_map(|(_, terms)| terms);
        terms.map(|term| (term.name, term.hint)).collect()
    });
    HINTS.get(term).copied()
}

/// Returns the kind of a value, without the size after a colon: all numbers are of one kind.
fn kind(value: &str) -> &str {
    let (kind, _) = value.split_once(':').unwrap_or((value, ""));
    if kind.parse::<usize>().is_ok() { "1" } else { kind }
}

/// Field with a value that is chosen automatically.
fn chosen_ui(ui: &mut Ui, label: &str, value: Option<String>, is_below: bool) {
    let mut text = value.unwrap_or_else(|| AUTOMATIC.to_owned());
    let mut value_ui = |ui: &mut Ui, width: f32, align: Align| {
        let edit = TextEdit::singleline(&mut text)
            .align(Align2([align, Align::Center]))
            .margin(vec2(space(2), space(1)))
            .desired_width(width);
        ui.add_enabled(false, edit).on_disabled_hover_text(REASON)
    };
    if is_below {
        let label = ui.label(label).on_hover_text(REASON);
        value_ui(ui, f32::INFINITY, Align::Min).labelled_by(label.id);
    } else {
        field_ui(ui, label, REASON, |ui| value_ui(ui, space(21), Align::Center));
    }
}

/// Field of a setting of `of` that is a number, with its label, its hint and its unit.
fn number_ui<S: Clone>(ui: &mut Ui, texts: [&str; 3], setting: &Setting<S>, of: &mut S, usual: &S) {
    let [label, hint, unit] = texts;
    let Some(range) = setting.range() else { return };
    let (low, high) = (*range.start(), *range.end());
    let usual = setting.number(usual).unwrap_or(0.0);
    let hint = &format!("{hint}\n\nDefault {}.", input_text(usual));
    match (setting.field)(of) {
        Some(Field::Number(share)) if unit == "%" => {
            let range = in_percent(low)..=in_percent(high).min(100.0);
            percent_ui(ui, label, hint, share, usual, range);
        }
        Some(Field::Number(value)) => {
            quantity_ui(ui, label, hint, value, usually(usual, range), unit);
            if matches!(setting.kind, Kind::Integer(..)) {
                *value = value.round();
            }
        }
        Some(Field::Count(count)) => {
            let limits = usually(usual as usize, low as usize..=high as usize);
            count_ui(ui, label, hint, count, limits);
        }
        Some(Field::Integer(seed)) => {
            seed_ui(ui, label, hint, seed, usual as u64);
        }
        Some(Field::Optional(count)) => {
            let (mut shown, hint) = (count.map_or(0, usize::from), format!("{} 0 for none.", setting.help));
            count_ui(ui, label, &hint, &mut shown, usually(0, 0..=high as usize));
            *count = u8::try_from(shown).ok().filter(|&count| count > 0);
        }
        Some(Field::Text(..)) | None => {}
    }
}
