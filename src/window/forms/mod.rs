//! Forms of settings, for every view and both sources: sensor, scene, network and training. A form is a loop over rows of
//! the table of settings; what is chosen automatically is shown disabled, with the reason.

mod network;
mod presets;
mod scene;
mod sensor;
mod training;

pub use network::{hidden_ui, inputs_ui, of_inputs, workload_ui};
pub use presets::{follow_preset, preset_ui, scene_choice_ui};
pub use scene::{SAMPLES, condition_ui, of_samples, of_scene, outlook_notes_ui, scene_ui};
pub use sensor::{array_ui, geometry_ui, of_geometry};
pub use training::{EPOCHS, METHOD, RESTARTS, method_ui, training_ui};

use std::ops::RangeInclusive;

use decoupler_core::{
    evaluation::{RUN_OPTIONS, RunSettings},
    scene::RowModel,
    settings::{Field, Kind, Setting, Value},
};
use eframe::egui::{Align, Align2, ComboBox, Response, TextEdit, Ui, vec2};

use super::{
    theme::space,
    widgets::fields::{
        Limits, capitalised, count_ui, field_ui, in_percent, input_text, list_ui, options_ui, percent_ui, quantity_ui,
        seed_ui, usually,
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

/// A setting with the name and the form that it has in the window.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    label: &'static str,
    /// Tooltip.
    hint: &'static str,
    look: Look,
    setting: Source,
}

/// Where a setting is described.
#[derive(Clone, Copy, Debug)]
enum Source {
    /// In the table of a run, under this name.
    Table(&'static str),
    /// Here.
    Own(Setting<RunSettings>),
}

/// Form of a field.
#[derive(Clone, Copy, Debug)]
enum Look {
    /// Number with this unit; a fraction of one if that is %.
    Number(&'static str),
    /// A few options side by side.
    Options(&'static [Choice]),
    /// Drop-down list.
    List(&'static [Choice]),
    /// Drop-down list below the name, for texts that fill a line.
    Below(fn() -> Vec<Choice>),
}

/// Value of a setting, its text in the window, and its meaning.
type Choice = (&'static str, &'static str, &'static str);

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
                    let field_ui = if row.is_below() { chosen_below_ui } else { chosen_ui };
                    field_ui(ui, row.label, value);
                }
            }
        }
    }

    /// Returns the settings to be summarised; none before they are chosen.
    pub fn known(&self) -> Option<&RunSettings> {
        match self.set_by {
            SetBy::User => Some(self.settings),
            SetBy::Choice(chosen) => chosen,
        }
    }

    /// Returns a summary of the settings.
    pub fn summary(&self, of: impl FnOnce(&RunSettings) -> String) -> String {
        self.known().map_or_else(|| AUTOMATIC.to_owned(), of)
    }
}

/// Value of a setting that has not been chosen yet.
const AUTOMATIC: &str = "automatic";

/// Tooltip of every setting that is chosen automatically.
const REASON: &str = "Chosen by cross-validation when you press Train. To set it yourself, untick “Choose settings \
                      automatically”.";

impl Row {
    /// A row of the table of a run.
    const fn new(name: &'static str, label: &'static str, hint: &'static str, look: Look) -> Self {
        let setting = Source::Table(name);
        Self {
            label,
            hint,
            look,
            setting,
        }
    }

    /// A number that only the window offers.
    const fn number(
        label: &'static str,
        hint: &'static str,
        (kind, unit): (Kind, &'static str),
        field: fn(&mut RunSettings) -> Option<Field<'_>>,
    ) -> Self {
        Self {
            label,
            hint,
            look: Look::Number(unit),
            setting: Source::Own(Setting::new(label, kind, hint, field)),
        }
    }

    fn setting(&self) -> Setting<RunSettings> {
        match self.setting {
            Source::Own(setting) => setting,
            Source::Table(name) => {
                let found = RUN_OPTIONS.iter().find(|option| option.setting.name == name);
                found.expect("the table has every named row").setting
            }
        }
    }

    /// Returns true if the value is below the name.
    fn is_below(&self) -> bool {
        matches!(self.look, Look::Below(_))
    }

    fn choices(&self) -> Vec<Choice> {
        match self.look {
            Look::Number(_) => Vec::new(),
            Look::Options(choices) | Look::List(choices) => choices.to_vec(),
            Look::Below(choices) => choices(),
        }
    }

    /// Returns the value as the window writes it; none if the setting does not apply.
    fn text(&self, settings: &RunSettings) -> Option<String> {
        let value = self.setting().get(settings)?;
        Some(match value {
            Value::Number(value) => input_text(value),
            Value::Integer(value) => value.to_string(),
            Value::Text(value) => match self.choices().iter().find(|choice| is_value(choice, &value)) {
                Some((_, text, _)) => (*text).to_owned(),
                None => capitalised(&value),
            },
        })
    }

    fn ui(&self, ui: &mut Ui, settings: &mut RunSettings, usual: &RunSettings) {
        let (label, hint, setting) = (self.label, self.hint, self.setting());
        if let Look::Number(unit) = self.look {
            return number_ui(ui, [label, hint, unit], &setting, settings, usual);
        }
        let Some(Value::Text(value)) = setting.get(settings) else {
            return;
        };
        let choices = self.choices();
        let listed = choices.iter().find(|choice| is_value(choice, &value));
        let selected = listed.map_or(value.as_str(), |(name, ..)| *name);
        let text = capitalised(&value);
        let is_listed = listed.is_some();
        let mut offered: Vec<(&str, &str, &str)> = choices;
        if !is_listed {
            offered.push((selected, &text, "A value from a file that the window does not offer."));
        }
        let picked = match self.look {
            Look::Options(_) => options_ui(ui, label, hint, &offered, selected),
            Look::List(_) => list_ui(ui, label, hint, &offered, selected),
            _ => list_below_ui(ui, label, hint, &offered, selected),
        };
        if let Some(picked) = picked {
            let set = setting.set(settings, &Value::Text(picked.to_owned()));
            debug_assert!(set.is_ok(), "{set:?}");
        }
    }
}

/// Returns true if `choice` stands for `value`, whose sizes after a colon may differ.
fn is_value(choice: &Choice, value: &str) -> bool {
    let name = |text: &str| text.split(':').next().map(str::to_owned);
    name(choice.0) == name(value)
}

/// Field with a value that is chosen automatically.
fn chosen_ui(ui: &mut Ui, label: &str, value: Option<String>) {
    field_ui(ui, label, REASON, |ui| fixed_ui(ui, value, space(21), Align::Center));
}

/// As [`chosen_ui`], with the value below its name.
fn chosen_below_ui(ui: &mut Ui, label: &str, value: Option<String>) {
    let label = ui.label(label).on_hover_text(REASON);
    fixed_ui(ui, value, f32::INFINITY, Align::Min).labelled_by(label.id);
}

fn fixed_ui(ui: &mut Ui, value: Option<String>, width: f32, align: Align) -> Response {
    let mut text = value.unwrap_or_else(|| AUTOMATIC.to_owned());
    let edit = TextEdit::singleline(&mut text)
        .align(Align2([align, Align::Center]))
        .margin(vec2(space(2), space(1)))
        .desired_width(width);
    ui.add_enabled(false, edit).on_disabled_hover_text(REASON)
}

/// Field of a setting of `of` that is a number, with its label, its hint and its unit.
fn number_ui<S: Clone>(ui: &mut Ui, texts: [&str; 3], setting: &Setting<S>, of: &mut S, usual: &S) {
    let ([label, hint, unit], usual) = (texts, setting.number(usual));
    let Some(range) = setting.range() else { return };
    let (low, high) = range.clone().into_inner();
    let shown = usual.map(|usual| input_text(if unit == "%" { in_percent(usual) } else { usual }));
    let hint = match shown {
        Some(shown) => format!("{hint}\n\nDefault {}.", format!("{shown} {unit}").trim_end()),
        None => hint.to_owned(),
    };
    match (setting.field)(of) {
        Some(Field::Number(share)) if unit == "%" => {
            let range = in_percent(low)..=in_percent(high).min(100.0);
            percent_ui(ui, label, &hint, share, usual.unwrap_or(*share), range);
        }
        Some(Field::Number(value)) => {
            quantity_ui(ui, label, &hint, value, limits(usual, range), unit);
            if matches!(setting.kind, Kind::Integer(..)) {
                *value = value.round();
            }
        }
        Some(Field::Count(count)) => {
            let range = low as usize..=high as usize;
            count_ui(
                ui,
                label,
                &hint,
                count,
                limits(usual.map(|usual| usual as usize), range),
            );
        }
        Some(Field::Integer(seed)) => {
            seed_ui(ui, label, &hint, seed, usual.map_or(0, |usual| usual as u64));
        }
        Some(Field::Optional(count)) => {
            let mut shown = count.map_or(0, usize::from);
            count_ui(ui, label, &hint, &mut shown, usually(0, 0..=high as usize));
            *count = u8::try_from(shown).ok().filter(|&count| count > 0);
        }
        Some(Field::Text(..)) | None => {}
    }
}

fn limits<N>(usual: Option<N>, range: RangeInclusive<N>) -> Limits<N> {
    match usual {
        Some(usual) => usually(usual, range),
        None => range.into(),
    }
}

/// A list below its name, as wide as the form. Returns the value just selected.
fn list_below_ui<'a>(
    ui: &mut Ui,
    label: &str,
    hint: &str,
    choices: &[(&'a str, &str, &str)],
    selected: &str,
) -> Option<&'a str> {
    let named = ui.label(label).on_hover_text(hint);
    let shown = choices.iter().find(|(name, ..)| *name == selected);
    let combo = ComboBox::from_id_salt(label)
        .selected_text(shown.map_or("", |(_, text, _)| *text))
        .width(ui.available_width())
        .height(space(90));
    let mut picked = None;
    let combo = combo.show_ui(ui, |ui| {
        for &(name, text, meaning) in choices {
            let choice = ui.selectable_label(name == selected, text).on_hover_text(meaning);
            if choice.clicked() && name != selected {
                picked = Some(name);
            }
        }
    });
    combo.response.labelled_by(named.id);
    picked
}
