use clap::{ArgAction, Args, Command, FromArgMatches};
use serde_json::Value;

use crate::cli::{parse_error::one_line, training_arguments::TrainingArguments};

/// Options of `train` that name its files and its output; a sweep has its own.
const OF_ONE_RUN: [&str; 5] = ["checkpoint", "resume", "checkpoint-interval", "out", "json"];

/// The parser of the options of `train` that determine its result.
pub(super) struct TrainOptions(Command);

impl TrainOptions {
    pub(super) fn new() -> Self {
        Self(TrainingArguments::augment_args(
            Command::new("train").disable_help_flag(true),
        ))
    }

    /// Writes an option with the value from a specification as arguments of the terminal. Each is one word, so that no
    /// value can be taken for an option.
    ///
    /// # Errors
    /// A message about an unknown option, or a value that is neither a number, a text nor a list of them.
    pub(super) fn words(&self, option: &str, value: &Value) -> Result<Vec<String>, String> {
        let mut arguments = self.0.get_arguments();
        let Some(argument) = arguments.find(|argument| argument.get_long() == Some(option)) else {
            return Err(self.unknown(option));
        };
        let is_repeated = matches!(argument.get_action(), ArgAction::Append);
        let word = |value: &Value| {
            let text = match value {
                Value::String(text) => text.clone(),
                Value::Number(number) => number.to_string(),
                _ => return Err(format!("{value} is neither a number nor a text in quotes")),
            };
            Ok(format!("--{option}={text}"))
        };
        match value {
            Value::Array(values) if is_repeated && !values.is_empty() => values.iter().map(word).collect(),
            Value::Array(values) if is_repeated || values.is_empty() => {
                Err("an empty list says nothing; leave the option out".to_owned())
            }
            Value::Array(_) => Err(format!(
                "{option} takes one value; several are an axis: move it to \"axes\""
            )),
            value => Ok(vec![word(value)?]),
        }
    }

    fn unknown(&self, option: &str) -> String {
        if OF_ONE_RUN.contains(&option) {
            return "a sweep keeps its results and checkpoints itself; leave this option out".to_owned();
        }
        let names: Vec<_> = self
            .0
            .get_arguments()
            .filter_map(|argument| argument.get_long())
            .collect();
        format!("train has no such option; it has {}", names.join(", "))
    }

    /// Parses arguments of [`Self::words`] as `train` does.
    ///
    /// # Errors
    /// The message of `train` in one line.
    pub(super) fn parse<'a>(
        &mut self,
        words: impl IntoIterator<Item = &'a String>,
    ) -> Result<TrainingArguments, String> {
        let line = std::iter::once("train").chain(words.into_iter().map(String::as_str));
        let mut matches = self
            .0
            .try_get_matches_from_mut(line)
            .map_err(|error| one_line(&error))?;
        TrainingArguments::from_arg_matches_mut(&mut matches).map_err(|error| one_line(&error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::{TrialOptions, decoders_in_order, train_options};

    fn read_back(options: &TrialOptions) -> TrainingArguments {
        let mut train = TrainOptions::new();
        let words = options.iter().flat_map(|(option, value)| match value {
            Value::Array(values) if values.is_empty() => Vec::new(),
            _ => train.words(option, value).unwrap(),
        });
        let words: Vec<String> = words.collect();
        train.parse(&words).unwrap()
    }

    /// Every option of `train`, so that none can be forgotten here when `train` has a new one.
    #[test]
    fn every_option_is_written_out_and_read_back() {
        let cases = [
            ("preset", "best", ""),
            ("rows", "3", ""),
            ("axes", "xyz", ""),
            ("loading", "smooth:2.5", ""),
            ("inputs", "log", ""),
            ("scaling", "whiten", ""),
            ("noise", "0.001", ""),
            ("noise-ohm", "1e-3", ""),
            ("adc-bits", "12", ""),
            ("drift", "0.01", ""),
            ("noise-in", "training", "--noise=0.1"),
            ("decoder", "polish,mean", ""),
            ("array", "10x6_3x18", ""),
            ("hidden", "7", ""),
            ("starts", "3", ""),
            ("method", "gdm", ""),
            ("set", "mu=0.3", ""),
            ("epochs", "17", ""),
            ("goal", "1e-7", ""),
            ("max-fail", "9", ""),
            ("min-gradient", "0", ""),
            ("samples", "321", ""),
            ("test-samples", "11", ""),
            ("validation-samples", "0", ""),
            ("seed", "18446744073709551615", ""),
        ];
        let mut train = TrainOptions::new();
        let defaults = {
            let arguments = train.parse(&[]).unwrap();
            train_options(&arguments.settings().unwrap(), &arguments.scene.decoders())
        };
        for (option, value, with) in cases {
            let words: Vec<_> = [format!("--{option}={value}"), with.to_owned()].into();
            let words: Vec<_> = words.into_iter().filter(|word| !word.is_empty()).collect();
            let arguments = train.parse(&words).unwrap();
            let (settings, decoders) = (
                arguments.settings().unwrap(),
                decoders_in_order(&arguments.scene.decoders()),
            );
            let options = train_options(&settings, &decoders);
            assert_ne!(options, defaults, "{option}");
            let back = read_back(&options);
            assert_eq!(back.settings().unwrap(), settings, "{option}");
            assert_eq!(decoders_in_order(&back.scene.decoders()), decoders, "{option}");
        }
        let offered: Vec<_> = train
            .0
            .get_arguments()
            .filter_map(|argument| argument.get_long())
            .collect();
        let tested = cases.map(|(option, ..)| option);
        for option in &offered {
            assert!(tested.contains(option), "{option}");
        }
    }
}
