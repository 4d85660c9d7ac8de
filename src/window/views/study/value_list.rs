use decoupler_core::{
    evaluation::experiments::{Axis, AxisKind},
    settings::{Kind, SettingError, Value},
};
use eframe::egui::{TextEdit, Ui, vec2};

use crate::window::{
    forms::choices,
    theme::space,
    widgets::fields::{in_percent, input_text, of_percent},
};

/// Values of a setting, as typed or ticked; levels of noise in percent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ValueList {
    /// Setting that is varied.
    pub kind: AxisKind,
    /// Its values, separated by commas or blanks.
    pub values: String,
}

impl ValueList {
    /// Creates the list with example values.
    pub fn new(kind: AxisKind) -> Self {
        Self {
            kind,
            values: WORDS[kind as usize].1.to_owned(),
        }
    }

    /// Creates the list of the values of `axis`.
    pub fn of(axis: &Axis) -> Self {
        let values = Vec::from_iter((0..axis.values.len()).map(|index| axis.label(index)));
        Self {
            kind: axis.kind,
            values: values.join(", "),
        }
    }

    fn words(&self) -> impl Iterator<Item = &str> {
        let is_between = |letter: char| ",;%".contains(letter) || letter.is_whitespace();
        self.values.split(is_between).filter(|word| !word.is_empty())
    }

    /// Parses the list.
    ///
    /// # Errors
    /// The first value that cannot be parsed, with an example.
    pub fn parse(&self) -> Result<Axis, String> {
        let (name, example) = WORDS[self.kind as usize];
        let mut axis =
            Axis::parse(self.kind, self.words()).map_err(|error| match (&error, self.kind.setting().kind) {
                (SettingError::Text(_, message), Kind::Choice | Kind::Text) => format!("{name}: {message}"),
                (SettingError::Text(_, message), _) => format!("{name}: {message}; write a list such as {example}"),
                _ => error.to_string(),
            })?;
        for value in &mut axis.values {
            if let Value::Number(percent) = value {
                *percent = of_percent(*percent);
            }
        }
        Ok(axis)
    }

    /// Shows the list, named after its setting unless `name` is given: as checkboxes of what can be chosen, or as a text field.
    pub fn ui(&mut self, ui: &mut Ui, name: Option<&str>, hint: &str) {
        let label = ui.label(name.unwrap_or(label(self.kind))).on_hover_text(hint);
        let choices = match self.kind {
            AxisKind::Split => vec![("time", "Time"), ("group", "Group"), ("random", "Random")],
            kind => choices(kind.name()),
        };
        if choices.is_empty() {
            let edit = TextEdit::multiline(&mut self.values)
                .desired_rows(1)
                .desired_width(f32::INFINITY)
                .hint_text(WORDS[self.kind as usize].1)
                .margin(vec2(space(2), space(1)));
            ui.add(edit).labelled_by(label.id).on_hover_text(hint);
            return;
        }
        let mut chosen = Vec::new();
        for (name, text) in choices {
            let mut is_chosen = self.words().any(|word| word == name);
            ui.checkbox(&mut is_chosen, text).on_hover_text(name);
            chosen.extend(is_chosen.then_some(name));
        }
        self.values = chosen.join(", ");
    }
}

/// Writes levels of noise in percent, as they are typed; the values of no other setting have fractions.
pub fn write_percent(axis: &mut Axis) {
    for value in &mut axis.values {
        if let Value::Number(noise) = value {
            *value = Value::Text(noise_text(*noise));
        }
    }
}

/// Returns a level of noise in percent.
pub fn noise_text(noise: f64) -> String {
    format!("{} %", input_text(in_percent(noise)))
}

/// Label and example of each list of values, in the order of [`AxisKind`].
const WORDS: [(&str, &str); 11] = [
    ("Hidden nodes", "6, 8, 10, 12"),
    ("Array scales", "10×6_3×18, 10×8_4×24, 10×10_5×30"),
    ("Samples", "100, 300, 1000"),
    ("Noise levels (%)", "0, 0.1, 1"),
    ("Inputs", "resistance, conductance, log"),
    ("Scaling", "minmax, whiten"),
    ("Methods", "lm, br, scg"),
    ("Epochs", "30, 100, 300"),
    ("Restarts", "1, 3, 10"),
    ("Split", "time, random"),
    ("Seeds", "0, 1, 2"),
];

/// Returns the label of a list of values.
pub fn label(kind: AxisKind) -> &'static str {
    WORDS[kind as usize].0
}

#[cfg(test)]
mod tests {
    use decoupler_core::evaluation::RunSettings;

    use super::*;

    #[test]
    fn example_values_are_parsed_and_printed_unchanged() {
        for kind in AxisKind::of_runs(&RunSettings::default()).chain([AxisKind::Split]) {
            let list = ValueList::new(kind);
            let mut axis = list.parse().unwrap();
            write_percent(&mut axis);
            assert!(axis.values.len() >= 2, "{kind:?}");
            let words = Vec::from_iter(list.words());
            assert_eq!(Vec::from_iter(ValueList::of(&axis).words()), words);
        }
    }

    #[test]
    fn separators_do_not_matter_and_errors_name_the_value() {
        let list = |kind, values: &str| ValueList {
            kind,
            values: values.to_owned(),
        };
        assert_eq!(
            list(AxisKind::Hidden, " 6;8\n10,,12 ").parse(),
            Ok(Axis::integers(AxisKind::Hidden, [6, 8, 10, 12]))
        );
        let cases = [
            (
                AxisKind::Hidden,
                "6, eight",
                "Hidden nodes: 'eight' is not a whole number",
            ),
            (AxisKind::Samples, "-5", "Samples: '-5'"),
            (AxisKind::Array, "10x6", "'10x6' is not an array scale"),
            (AxisKind::Noise, "0.1 a", "Noise levels (%): 'a' is not a number"),
            (
                AxisKind::Split,
                "time daily",
                "Split: 'daily' is not a split: give time",
            ),
            (
                AxisKind::Method,
                "lm magic",
                "'magic' is not a training method: give lm",
            ),
        ];
        for (kind, values, expected) in cases {
            let message = list(kind, values).parse().unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}
