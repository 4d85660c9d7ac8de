//! File format of the history of a training, for `#[serde(with)]`: columns of equal length, a third of the size of records,
//! and the layout that plotting programs read.

use std::num::ParseFloatError;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

use super::EpochRecord;

/// Writes the records of all epochs, column by column.
///
/// # Errors
/// If the serializer fails.
pub fn serialize<S: Serializer>(records: &[EpochRecord], serializer: S) -> Result<S::Ok, S::Error> {
    Columns::of(records).serialize(serializer)
}

/// Reads the records of all epochs.
///
/// # Errors
/// If the deserializer fails, or the columns differ in length or lack an epoch.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<EpochRecord>, D::Error> {
    Columns::deserialize(deserializer)?.records().map_err(D::Error::custom)
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Columns {
    epoch: Vec<usize>,
    training_mse: Vec<Number>,
    validation_mse: Vec<Option<Number>>,
    test_mse: Vec<Option<Number>>,
    gradient_norm: Vec<Number>,
    parameter: Vec<Number>,
    effective_parameters: Vec<Option<Number>>,
    validation_failures: Vec<usize>,
}

impl Columns {
    fn of(records: &[EpochRecord]) -> Self {
        fn column<T>(records: &[EpochRecord], value: impl Fn(&EpochRecord) -> T) -> Vec<T> {
            records.iter().map(value).collect()
        }
        Self {
            epoch: column(records, |record| record.epoch),
            training_mse: column(records, |record| Number(record.training_mse)),
            validation_mse: column(records, |record| record.validation_mse.map(Number)),
            test_mse: column(records, |record| record.test_mse.map(Number)),
            gradient_norm: column(records, |record| Number(record.gradient_norm)),
            parameter: column(records, |record| Number(record.parameter)),
            effective_parameters: column(records, |record| record.effective_parameters.map(Number)),
            validation_failures: column(records, |record| record.validation_failures),
        }
    }

    fn records(self) -> Result<Vec<EpochRecord>, String> {
        let columns = self;
        let epochs = columns.epoch.len();
        let lengths = [
            ("training_mse", columns.training_mse.len()),
            ("validation_mse", columns.validation_mse.len()),
            ("test_mse", columns.test_mse.len()),
            ("gradient_norm", columns.gradient_norm.len()),
            ("parameter", columns.parameter.len()),
            ("effective_parameters", columns.effective_parameters.len()),
            ("validation_failures", columns.validation_failures.len()),
        ];
        if let Some((name, length)) = lengths.into_iter().find(|(_, length)| *length != epochs) {
            return Err(format!("history.{name} has {length} entries, but epoch has {epochs}"));
        }
        if let Some(missing) = (0..epochs).find(|&epoch| columns.epoch[epoch] != epoch) {
            return Err(format!("history.epoch: epoch {missing} is missing"));
        }
        let record = |epoch: usize| EpochRecord {
            epoch,
            training_mse: columns.training_mse[epoch].0,
            validation_mse: columns.validation_mse[epoch].map(|number| number.0),
            test_mse: columns.test_mse[epoch].map(|number| number.0),
            gradient_norm: columns.gradient_norm[epoch].0,
            parameter: columns.parameter[epoch].0,
            effective_parameters: columns.effective_parameters[epoch].map(|number| number.0),
            validation_failures: columns.validation_failures[epoch],
        };
        Ok((0..epochs).map(record).collect())
    }
}

/// Number that may be infinite or NaN; these are strings in the file, since JSON has no such numbers.
#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(into = "Written", try_from = "Written")]
struct Number(f64);

#[derive(Serialize, Deserialize)]
#[serde(untagged, expecting = "give a number, \"inf\", \"-inf\" or \"NaN\"")]
enum Written {
    Number(f64),
    Text(String),
}

impl From<Number> for Written {
    fn from(Number(value): Number) -> Self {
        if value.is_finite() {
            Self::Number(value)
        } else {
            Self::Text(value.to_string())
        }
    }
}

impl TryFrom<Written> for Number {
    type Error = ParseFloatError;

    fn try_from(written: Written) -> Result<Self, ParseFloatError> {
        match written {
            Written::Number(value) => Ok(Self(value)),
            Written::Text(text) => text.parse().map(Self),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn infinite_and_nan_values_survive_a_file() {
        let values = [1.5, -0.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 1e-310, 3.0];
        let record = |(epoch, &value): (usize, &f64)| EpochRecord {
            epoch,
            training_mse: value,
            validation_mse: Some(value),
            test_mse: None,
            gradient_norm: value,
            parameter: value,
            effective_parameters: Some(value),
            validation_failures: epoch,
        };
        let history = Vec::from_iter(values.iter().enumerate().map(record));
        let mut text = Vec::new();
        serialize(&history, &mut serde_json::Serializer::new(&mut text)).unwrap();
        let read = deserialize(&mut serde_json::Deserializer::from_slice(&text)).unwrap();
        for (read, value) in read.iter().zip(values) {
            let numbers = [read.training_mse, read.gradient_norm, read.parameter];
            for number in numbers
                .into_iter()
                .chain(read.validation_mse)
                .chain(read.effective_parameters)
            {
                assert!(number.to_bits() == value.to_bits() || number.is_nan() && value.is_nan());
            }
            assert_eq!(read.test_mse, None);
        }
        assert_eq!(read.len(), values.len());
    }
}
