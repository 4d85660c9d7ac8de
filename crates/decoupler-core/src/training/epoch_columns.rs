//! File format of the history of a training, column by column.

use std::fmt;

use serde::{
    Deserialize, Deserializer, Serialize, Serializer,
    de::{Error, Visitor},
};

use super::EpochRecord;

/// History of a training, stored as columns of equal length: a third of the size of records, and the layout that
/// plotting programs read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Columns", into = "Columns")]
pub struct History(pub Vec<EpochRecord>);

#[derive(Default, Serialize, Deserialize)]
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

impl From<History> for Columns {
    fn from(history: History) -> Self {
        let mut columns = Self::default();
        for record in history.0 {
            let EpochRecord {
                epoch,
                training_mse,
                validation_mse,
                test_mse,
                gradient_norm,
                parameter,
                effective_parameters,
                validation_failures,
            } = record;
            columns.epoch.push(epoch);
            columns.training_mse.push(Number(training_mse));
            columns.validation_mse.push(validation_mse.map(Number));
            columns.test_mse.push(test_mse.map(Number));
            columns.gradient_norm.push(Number(gradient_norm));
            columns.parameter.push(Number(parameter));
            columns.effective_parameters.push(effective_parameters.map(Number));
            columns.validation_failures.push(validation_failures);
        }
        columns
    }
}

impl TryFrom<Columns> for History {
    type Error = String;

    fn try_from(columns: Columns) -> Result<Self, String> {
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
        for (name, length) in lengths {
            if length != epochs {
                return Err(format!("history.{name} has {length} entries, but epoch has {epochs}"));
            }
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
        Ok(Self((0..epochs).map(record).collect()))
    }
}

/// Number that may be infinite or NaN; these are strings in the file, since JSON has no such numbers.
#[derive(Clone, Copy)]
struct Number(f64);

impl Serialize for Number {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.0.is_finite() {
            serializer.serialize_f64(self.0)
        } else {
            serializer.collect_str(&self.0)
        }
    }
}

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NumberVisitor).map(Self)
    }
}

struct NumberVisitor;

impl Visitor<'_> for NumberVisitor {
    type Value = f64;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, \"inf\", \"-inf\" or \"NaN\"")
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<f64, E> {
        Ok(value)
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<f64, E> {
        Ok(value as f64)
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<f64, E> {
        Ok(value as f64)
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<f64, E> {
        match value {
            "inf" => Ok(f64::INFINITY),
            "-inf" => Ok(f64::NEG_INFINITY),
            "NaN" => Ok(f64::NAN),
            _ => Err(E::invalid_value(serde::de::Unexpected::Str(value), &self)),
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
        let history = History(values.iter().enumerate().map(record).collect());
        let text = serde_json::to_string(&history).unwrap();
        let read: History = serde_json::from_str(&text).unwrap();
        for (read, value) in read.0.iter().zip(values) {
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
        assert_eq!(read.0.len(), values.len());
    }
}
