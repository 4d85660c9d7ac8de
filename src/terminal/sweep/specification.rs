use std::{
    fmt,
    fs::File,
    io::{self, Read},
    path::{Path, PathBuf},
};

use decoupler_files::import::Plan;
use serde::{
    Deserialize, Deserializer,
    de::{Error, MapAccess, Visitor},
};
use serde_json::Value;

use super::train_options::TrainOptions;
use crate::terminal::failure::{MAX_TRIALS, SpecificationError};

/// Largest file of a specification, in bytes.
const LARGEST_BYTES: u64 = 1 << 24;

/// Options of `train` that all trials share, and those that vary.
pub(super) struct Specification {
    path: PathBuf,
    /// Arguments of all trials.
    pub(super) shared: Vec<String>,
    /// Axes in the order of the file.
    pub(super) axes: Vec<Axis>,
    /// Recording that all trials share; its paths are absolute.
    pub(super) recording: Option<Plan>,
}

/// An option and the values that it takes.
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
    /// Reads the file at `path` and checks each option and value by itself.
    pub(super) fn read(path: &Path, train: &mut TrainOptions) -> Result<Self, SpecificationError> {
        let text = read_text(path).map_err(|source| SpecificationError::Read {
            path: path.to_owned(),
            source,
        })?;
        let layout: Layout = serde_json::from_str(&text).map_err(|error| SpecificationError::Layout {
            path: path.to_owned(),
            message: error.to_string(),
        })?;
        let mut specification = Self {
            path: path.to_owned(),
            shared: Vec::new(),
            axes: Vec::new(),
            recording: layout.recording.map(|plan| plan.within(folder(path)).absolute()),
        };
        for (option, value) in &layout.train.0 {
            let words = specification.words(option, value, &format!("train.{option}"), train)?;
            specification.shared.extend(words);
        }
        for (option, values) in &layout.axes.0 {
            if layout.train.0.iter().any(|(other, _)| other == option) {
                let message = "it is in train as well; leave it out of one of the two".to_owned();
                return Err(specification.error(format!("axes.{option}"), message));
            }
            let axis = specification.axis(option, values, train)?;
            specification.axes.push(axis);
        }
        specification.count()?;
        Ok(specification)
    }

    /// Specification from the arguments of the terminal: each axis has values separated by commas.
    pub(super) fn of_arguments(
        recording: Option<Plan>,
        shared: Vec<String>,
        axes: Vec<(&str, &Vec<String>)>,
        train: &mut TrainOptions,
    ) -> Result<Self, SpecificationError> {
        let mut specification = Self {
            path: PathBuf::from("the arguments"),
            shared,
            axes: Vec::new(),
            recording: recording.map(|plan| plan.absolute()),
        };
        for (option, values) in axes {
            let value = |text: &String| text.parse().map_or_else(|_| Value::from(&**text), Value::Number);
            let values = values.iter().map(value);
            let axis = specification.axis(option, &values.collect(), train)?;
            specification.axes.push(axis);
        }
        specification.count()?;
        Ok(specification)
    }

    fn axis(&self, option: &str, values: &Value, train: &mut TrainOptions) -> Result<Axis, SpecificationError> {
        let Some(values) = values.as_array().filter(|values| !values.is_empty()) else {
            let message = format!("{values} is no list of values; write [VALUE, ...]");
            return Err(self.error(format!("axes.{option}"), message));
        };
        let values = values.iter().enumerate().map(|(index, value)| {
            let place = format!("axes.{option}, value {}", index + 1);
            Ok(AxisValue {
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
    ) -> Result<Vec<String>, SpecificationError> {
        let value = if TrainOptions::is_path(option) {
            &located(value, folder(&self.path))
        } else {
            value
        };
        let words = train.words(option, value);
        let accepted = words.and_then(|words| {
            if train.stands_alone(option) {
                train.parse(&words)?;
            }
            Ok(words)
        });
        accepted.map_err(|message| self.error(place.to_owned(), message))
    }

    /// Number of trials.
    pub(super) fn count(&self) -> Result<usize, SpecificationError> {
        let counts = self.axes.iter().map(|axis| axis.values.len());
        let count = counts.into_iter().try_fold(1, usize::checked_mul);
        count
            .filter(|count| *count <= MAX_TRIALS)
            .ok_or_else(|| SpecificationError::TooMany(self.path.clone()))
    }

    /// Arguments of the trial at `position`.
    pub(super) fn words_at(&self, position: usize) -> Vec<&String> {
        let mut rest = position;
        let mut of_axes = Vec::new();
        // The last axis varies fastest.
        for axis in self.axes.iter().rev() {
            of_axes.push(&axis.values[rest % axis.values.len()].words);
            rest /= axis.values.len();
        }
        self.shared.iter().chain(of_axes.into_iter().rev().flatten()).collect()
    }

    /// An error at `place` of the file.
    pub(super) fn error(&self, place: String, message: String) -> SpecificationError {
        SpecificationError::Option {
            path: self.path.clone(),
            place,
            message,
        }
    }
}

fn folder(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new(""))
}

/// Paths of a value, relative to `folder`.
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
        return Err(io::Error::other("it is larger than 16 MiB, which no specification is"));
    }
    Ok(text)
}

/// Entries of a JSON object in their order. A key that is there twice is an error instead of being overwritten.
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
                return Err(A::Error::custom(format_args!("{key} is there twice; leave one out")));
            }
            entries.push((key, value));
        }
        Ok(UniqueKeys(entries))
    }
}
