use decoupler_core::{
    evaluation::experiments::{Axis, AxisKind},
    settings::{Kind, SettingError},
};
use eframe::egui::{TextEdit, Ui, vec2};

use crate::window::theme::space;

/// Values of a setting, as typed.
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

    /// Parses the list.
    ///
    /// # Errors
    /// The first value that cannot be parsed, with an example.
    pub fn parse(&self) -> Result<Axis, String> {
        let is_between = |letter: char| letter == ',' || letter == ';' || letter.is_whitespace();
        let words = self.values.split(is_between).filter(|word| !word.is_empty());
        let (name, example) = WORDS[self.kind as usize];
        Axis::parse(self.kind, words).map_err(|error| match (&error, self.kind.setting().kind) {
            (SettingError::Text(_, message), Kind::Choice | Kind::Text) => format!("{name}: {message}"),
            (SettingError::Text(_, message), _) => format!("{name}: {message}; write a list such as {example}"),
            _ => error.to_string(),
        })
    }

    /// Shows the list as a text field, named after its setting unless `name` is given.
    pub fn ui(&mut self, ui: &mut Ui, name: Option<&str>, hint: &str) {
        let label = ui.label(name.unwrap_or(label(self.kind))).on_hover_text(hint);
        let edit = TextEdit::multiline(&mut self.values)
            .desired_rows(1)
            .desired_width(f32::INFINITY)
            .hint_text(WORDS[self.kind as usize].1)
            .margin(vec2(space(2), space(1)));
        ui.add(edit).labelled_by(label.id).on_hover_text(hint);
    }
}

/// Label and example of each list of values, in the order of [`AxisKind`].
const WORDS: [(&str, &str); 11] = [
    ("Hidden nodes", "6, 8, 10, 12"),
    ("Array scales", "10×6_3×18, 10×8_4×24, 10×10_5×30"),
    ("Samples", "100, 300, 1000"),
    ("Noise levels", "0, 0.001, 0.01"),
    ("Inputs", "resistance, conductance, log"),
    ("Scaling", "minmax, whiten"),
    ("Methods", "lm, scg, rp"),
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
            let axis = list.parse().unwrap();
            assert!(axis.values.len() >= 2, "{kind:?}");
            assert_eq!(ValueList::of(&axis), list);
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
            (AxisKind::Noise, "0.1 a", "Noise levels: 'a' is not a number"),
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
