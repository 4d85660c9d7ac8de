use std::{
    fmt::{self, Display},
    fs::File,
    io::{self, Read},
    path::{Path, PathBuf},
};

use clap::{Arg, ArgAction, Args, Command, FromArgMatches};
use decoupler_core::{decoupling::DecoderKind, evaluation::RUN_OPTIONS, text::in_one_line};
use decoupler_files::{
    export::RecipeFile,
    import::{Plan, Setup},
};
use serde::{
    Deserialize, Deserializer,
    de::{Error, MapAccess, Visitor},
};
use serde_json::Value;

use crate::terminal::{
    failure::Failure,
    import_arguments::{ImportArguments, RecipeArguments},
    one_line,
    settings_arguments::TrainingArguments,
};

/// Maximum number of trials of a sweep. Every program that works on a sweep reads all of them.
const MAX_TRIALS: usize = 100_000;

/// Maximum size of a specification file in bytes.
const LARGEST_BYTES: u64 = 1 << 24;

/// Options of `train` shared by all trials, and varied options.
pub(super) struct Specification {
    path: PathBuf,
    /// Arguments of all trials.
    pub(super) shared: Vec<String>,
    /// Axes in the order of the file.
    pub(super) axes: Vec<Axis>,
    /// Recording shared by all trials; its paths are absolute.
    pub(super) recording: Option<Plan>,
}

/// A varied option and its values.
pub(super) struct Axis {
    pub(super) option: String,
    pub(super) values: Vec<AxisValue>,
}

pub(super) struct AxisValue {
    pub(super) value: Value,
    /// Arguments that give the option this value.
    pub(super) words: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Layout {
    #[serde(default)]
    train: UniqueKeys,
    axes: UniqueKeys,
    /// Recording with paths relative to the folder of the specification.
    #[serde(default)]
    recording: Option<Plan>,
}

impl Specification {
    /// Reads the file at `path` and checks each option and value separately.
    pub(super) fn read(path: &Path, train: &mut TrainOptions) -> Result<Self, Failure> {
        let text = read_text(path).map_err(|error| Failure::Path("read", path.to_owned(), error))?;
        let mut layout: Layout = serde_json::from_str(&text).map_err(|error| {
            Failure::Arguments(format!(
                "'{}' is not a specification: {}; write {{\"train\": {{OPTION: VALUE, ...}}, \"axes\": {{OPTION: [VALUE, ...], \
                 ...}}}} with the options of decoupler train",
                path.display(),
                in_one_line(&error.to_string())
            ))
        })?;
        if let Some(plan) = &mut layout.recording {
            // Earlier versions wrote 0 where the method determines the share.
            plan.division.validation_fraction = plan.division.validation_fraction.filter(|share| *share > 0.0);
        }
        Self::of(path, layout, train)
    }

    fn of(path: &Path, layout: Layout, train: &mut TrainOptions) -> Result<Self, Failure> {
        let mut specification = Self {
            path: path.to_owned(),
            shared: Vec::new(),
            axes: Vec::new(),
            recording: layout.recording.map(|plan| plan.within(folder(path)).absolute()),
        };
        if let Some(file) = specification.recording.as_ref().and_then(Plan::irregular) {
            let message = format!("'{}' is a pipe or device; give a file", file.display());
            return Err(specification.error("recording", message));
        }
        for (option, value) in &layout.train.0 {
            let words = specification.words(option, value, &format!("train.{option}"), train)?;
            specification.shared.extend(words);
        }
        for (option, values) in &layout.axes.0 {
            if layout.train.0.iter().any(|(other, _)| other == option) {
                let message = "it is also in train; remove it from one of the two";
                return Err(specification.error(&format!("axes.{option}"), message));
            }
            let axis = specification.axis(option, values, train)?;
            specification.axes.push(axis);
        }
        specification.count()?;
        Ok(specification)
    }

    /// Specification from command-line arguments: each axis has values separated by commas.
    pub(super) fn of_arguments(
        recording: Option<Plan>,
        axes: Vec<(String, Vec<String>)>,
        train: &mut TrainOptions,
    ) -> Result<Self, Failure> {
        let value = |text: String| text.parse().map_or_else(|_| Value::from(&*text), Value::Number);
        let axes = axes
            .into_iter()
            .map(|(option, values)| (option, values.into_iter().map(value).collect()));
        let layout = Layout {
            train: UniqueKeys::default(),
            axes: UniqueKeys(axes.collect()),
            recording,
        };
        Self::of(Path::new("the arguments"), layout, train)
    }

    fn axis(&self, option: &str, values: &Value, train: &mut TrainOptions) -> Result<Axis, Failure> {
        let Some(values) = values.as_array().filter(|values| !values.is_empty()) else {
            let message = format!("{values} is not a list of values; write [VALUE, ...]");
            return Err(self.error(&format!("axes.{option}"), message));
        };
        let values = values.iter().enumerate().map(|(index, value)| {
            let place = format!("axes.{option}, value {}", index + 1);
            Ok::<_, Failure>(AxisValue {
                value: value.clone(),
                words: self.words(option, value, &place, train)?,
            })
        });
        Ok(Axis {
            option: option.to_owned(),
            values: values.collect::<Result<_, _>>()?,
        })
    }

    /// Arguments that give `option` this value, which `train` accepts.
    fn words(
        &self,
        option: &str,
        value: &Value,
        place: &str,
        train: &mut TrainOptions,
    ) -> Result<Vec<String>, Failure> {
        let value = if TrainOptions::is_path(option) {
            &located(value, folder(&self.path))
        } else {
            value
        };
        let words = train.words(option, value);
        let accepted = words.and_then(|words| {
            if train.is_independent(option) {
                train.parse(&words)?;
            }
            Ok(words)
        });
        accepted.map_err(|message| self.error(place, message))
    }

    /// Number of trials.
    pub(super) fn count(&self) -> Result<usize, Failure> {
        let counts = self.axes.iter().map(|axis| axis.values.len());
        let count = counts.into_iter().try_fold(1, usize::checked_mul);
        count
            .filter(|count| *count <= MAX_TRIALS)
            .ok_or_else(|| {
                let path = self.path.display();
                Failure::Arguments(format!(
                    "'{path}': its axes have more than {MAX_TRIALS} combinations; give fewer values, or several specifications"
                ))
            })
    }

    /// The varied options of the trial at `position`, each with its value.
    fn values_at(&self, position: usize) -> Vec<(&str, &AxisValue)> {
        let mut rest = position;
        let mut values = Vec::new();
        // The last axis varies fastest.
        for axis in self.axes.iter().rev() {
            values.push((&*axis.option, &axis.values[rest % axis.values.len()]));
            rest /= axis.values.len();
        }
        values.reverse();
        values
    }

    /// Arguments of the trial at `position`.
    pub(super) fn words_at(&self, position: usize) -> Vec<&String> {
        let varied = self.values_at(position).into_iter();
        self.shared
            .iter()
            .chain(varied.flat_map(|(_, value)| &value.words))
            .collect()
    }

    /// Values of the axes at `position`, as in `hidden 8, seed 3`.
    pub(super) fn describe(&self, position: usize) -> String {
        let values = self.values_at(position).into_iter();
        let values = Vec::from_iter(values.map(|(option, value)| format!("{option} {}", written(&value.value))));
        if values.is_empty() {
            return "the only trial".to_owned();
        }
        // Any text may be a value.
        in_one_line(&values.join(", "))
    }

    /// An error at `place` of the file.
    pub(super) fn error(&self, place: &str, message: impl Display) -> Failure {
        let (place, message) = (in_one_line(place), in_one_line(&message.to_string()));
        Failure::Arguments(format!("'{}': {place}: {message}", self.path.display()))
    }
}

/// A value without the quotes of JSON.
fn written(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(values) => values.iter().map(written).collect::<Vec<_>>().join(" "),
        other => other.to_string(),
    }
}

fn folder(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new(""))
}

/// Prefixes the paths of a value with `folder`.
fn located(value: &Value, folder: &Path) -> Value {
    match value {
        Value::String(path) => Value::from(folder.join(path).to_string_lossy()),
        Value::Array(values) => values.iter().map(|value| located(value, folder)).collect(),
        other => other.clone(),
    }
}

fn read_text(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    File::open(path)?.take(LARGEST_BYTES + 1).read_to_string(&mut text)?;
    if text.len() as u64 > LARGEST_BYTES {
        return Err(io::Error::other(
            "it is larger than 16 MiB, the limit for a specification",
        ));
    }
    Ok(text)
}

/// Entries of a JSON object in their order. A duplicate key is an error.
#[derive(Default)]
pub(super) struct UniqueKeys(pub(super) Vec<(String, Value)>);

impl<'de> Deserialize<'de> for UniqueKeys {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Entries)
    }
}

struct Entries;

impl<'de> Visitor<'de> for Entries {
    type Value = UniqueKeys;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object of options and values")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<UniqueKeys, A::Error> {
        let mut entries: Vec<(String, Value)> = Vec::new();
        while let Some((key, value)) = map.next_entry::<String, Value>()? {
            if entries.iter().any(|(other, _)| *other == key) {
                return Err(A::Error::custom(format_args!("{key} is given twice; remove one")));
            }
            entries.push((key, value));
        }
        Ok(UniqueKeys(entries))
    }
}

/// Options of `train` that name its files and its output; a sweep has its own.
const OF_ONE_RUN: [&str; 6] = ["checkpoint", "resume", "checkpoint-interval", "out", "json", "folds"];

/// Options whose values are paths.
const PATHS: [&str; 6] = ["data", "join", "positions", "recipe", "test-data", "test-join"];

/// Arguments that determine the result of a trial.
pub(super) struct TrialArguments {
    pub(super) training: TrainingArguments,
    import: ImportArguments,
}

impl TrialArguments {
    /// Setup of a trial of `specification`; paths are absolute.
    pub(super) fn setup(&self, specification: &Specification) -> Result<Setup, Failure> {
        let columns = self.training.scene.columns();
        let source = match &specification.recording {
            Some(_) if self.import.is_given() || !columns.is_empty() => {
                let message = "the specification has a recording; leave --data, --recipe and --inputs out";
                return Err(Failure::Arguments(message.to_owned()));
            }
            Some(recording) => Some(RecipeFile::Recording(self.import.divided(recording.clone())?)),
            None => self.import.source(&columns)?,
        };
        let source = source.map(|source| match source {
            RecipeFile::Recording(plan) => RecipeFile::Recording(plan.absolute()),
            simulated @ RecipeFile::Simulated(_) => simulated,
        });
        self.training
            .refuse_auto("a sweep has the same settings in every trial")?;
        self.training.setup(source)
    }

    /// Decoders to measure: those given, by default all for a simulated array and none for a recording.
    pub(super) fn decoders(&self, setup: &Setup) -> Vec<DecoderKind> {
        match setup.plan() {
            None => self.training.scene.decoders(),
            Some(_) => self.training.scene.decoder.clone(),
        }
    }
}

/// Parser of the options of `train` that determine its result.
pub(super) struct TrainOptions(Command);

impl TrainOptions {
    pub(super) fn new() -> Self {
        let command = Command::new("train").disable_help_flag(true);
        let command = ImportArguments::augment_args(TrainingArguments::augment_args(command));
        Self(RecipeArguments::augment_args(command))
    }

    /// Converts an option and its value from a specification to command-line arguments. Each is one word, so that no
    /// value can be mistaken for an option.
    ///
    /// # Errors
    /// If the option is unknown, or the value is not a number, a text or a list of them.
    pub(super) fn words(&self, option: &str, value: &Value) -> Result<Vec<String>, String> {
        if OF_ONE_RUN.contains(&option) {
            return Err("a sweep manages its results and checkpoints itself; leave this option out".to_owned());
        }
        // A setting that is rarely changed has no option of its own.
        let rare = RUN_OPTIONS
            .iter()
            .any(|row| row.is_rare() && row.setting.word("-") == option);
        let (long, prefix) = if rare {
            ("set", format!("{option}="))
        } else {
            (option, String::new())
        };
        let mut arguments = self.0.get_arguments();
        let Some(argument) = arguments.find(|argument| argument.get_long() == Some(long)) else {
            return Err(self.unknown());
        };
        let is_repeated = !rare && matches!(argument.get_action(), ArgAction::Append);
        let word = |value: &Value| {
            let text = match value {
                Value::String(text) => text.clone(),
                Value::Number(number) => number.to_string(),
                _ => return Err(format!("{value} is neither a number nor a text in quotes")),
            };
            Ok(format!("--{long}={prefix}{text}"))
        };
        match value {
            Value::Array(values) if is_repeated && !values.is_empty() => values.iter().map(word).collect(),
            Value::Array(values) if is_repeated || values.is_empty() => {
                Err("the list is empty; leave the option out".to_owned())
            }
            Value::Array(_) => Err(format!("{option} takes one value; to vary it, move it to \"axes\"")),
            value => Ok(vec![word(value)?]),
        }
    }

    fn unknown(&self) -> String {
        let options = self.0.get_arguments().filter_map(Arg::get_long).map(str::to_owned);
        let rare = RUN_OPTIONS
            .iter()
            .filter(|row| row.is_rare())
            .map(|row| row.setting.word("-"));
        let names = options.chain(rare).filter(|name| !OF_ONE_RUN.contains(&&**name));
        format!("train has no such option; it has {}", Vec::from_iter(names).join(", "))
    }

    /// Returns `true` if the option does not depend on others.
    pub(super) fn is_independent(&self, option: &str) -> bool {
        let of_import = RecipeArguments::augment_args(ImportArguments::augment_args(Command::new("import")));
        let is_division = ["split", "test-fraction", "validation-fraction"].contains(&option);
        is_division
            || !of_import
                .get_arguments()
                .any(|argument| argument.get_long() == Some(option))
    }

    /// Returns `true` if the values of the option are paths.
    pub(super) fn is_path(option: &str) -> bool {
        PATHS.contains(&option)
    }

    /// Parses arguments made by [`Self::words`] as `train` does.
    ///
    /// # Errors
    /// The message of `train` on one line.
    pub(super) fn parse<'a>(&mut self, words: impl IntoIterator<Item = &'a String>) -> Result<TrialArguments, String> {
        let line = std::iter::once("train").chain(words.into_iter().map(String::as_str));
        let mut matches = self
            .0
            .try_get_matches_from_mut(line)
            .map_err(|error| one_line(&error))?;
        let mut parsed = || {
            let mut import = ImportArguments::from_arg_matches_mut(&mut matches)?;
            import.rest = RecipeArguments::from_arg_matches_mut(&mut matches)?;
            let training = TrainingArguments::from_arg_matches_mut(&mut matches)?;
            Ok(TrialArguments { training, import })
        };
        parsed().map_err(|error: clap::Error| one_line(&error))
    }
}

#[cfg(test)]
mod tests {
    use decoupler_files::export::{TrialOptions, decoders_in_order, train_options};
    use serde_json::json;

    use super::*;

    #[test]
    fn the_last_axis_varies_fastest() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sweep.json");
        let axes = json!({"hidden": [6, 8], "set": ["mu=1", ["mu=2", "mu-decrease=0.5"], "mu=3"]});
        std::fs::write(&path, json!({"axes": axes}).to_string()).unwrap();
        let specification = Specification::read(&path, &mut TrainOptions::new()).unwrap();
        let positions = [0, 1, 5].map(|position| specification.describe(position));
        assert_eq!(
            positions,
            [
                "hidden 6, set mu=1",
                "hidden 6, set mu=2 mu-decrease=0.5",
                "hidden 8, set mu=3"
            ]
        );
    }

    fn read_back(options: &TrialOptions) -> TrainingArguments {
        let mut train = TrainOptions::new();
        let words = options.iter().flat_map(|(option, value)| match value {
            Value::Array(values) if values.is_empty() => Vec::new(),
            _ => train.words(option, value).unwrap(),
        });
        let words: Vec<String> = words.collect();
        train.parse(&words).unwrap().training
    }

    /// Covers every option of `train`, so that a new option cannot be forgotten here.
    #[test]
    fn every_option_survives_a_round_trip() {
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
            ("combine", "mean", ""),
            ("begin", "ridge", ""),
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
            let arguments = train.parse(&[]).unwrap().training;
            train_options(&arguments.settings(None).unwrap(), &arguments.scene.decoders())
        };
        for (option, value, with) in cases {
            let mut words = train.words(option, &value.into()).unwrap();
            words.extend((!with.is_empty()).then(|| with.to_owned()));
            let arguments = train.parse(&words).unwrap().training;
            let (settings, decoders) = (
                arguments.settings(None).unwrap(),
                decoders_in_order(&arguments.scene.decoders()),
            );
            let options = train_options(&settings, &decoders);
            assert_ne!(options, defaults, "{option}");
            let back = read_back(&options);
            assert_eq!(back.settings(None).unwrap(), settings, "{option}");
            assert_eq!(decoders_in_order(&back.scene.decoders()), decoders, "{option}");
        }
        let training = TrainingArguments::augment_args(Command::new("train"));
        let options = training.get_arguments().filter_map(Arg::get_long).map(str::to_owned);
        let offered = options.chain(RUN_OPTIONS.iter().map(|row| row.setting.word("-")));
        let tested = cases.map(|(option, ..)| option);
        for option in offered {
            assert!(tested.contains(&&*option), "{option}");
        }
    }
}
