use std::{fmt::Display, str::FromStr};

use thiserror::Error;

use decoupler_core::{
    dataset::{Seed, SplitBy},
    evaluation::experiments::{Axis, AxisKind},
    network::{Quantity, ScalingChoice},
    sensor::{ArrayScale, ArrayScaleError},
    training::Method,
};

/// An axis as the user types it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AxisForm {
    /// Setting that is varied.
    pub kind: AxisKind,
    /// Its values, separated by commas or blanks.
    pub values: String,
}

/// A value that cannot be understood.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ListError {
    /// Not a number.
    #[error("{name}: '{text}' is not {of}; write a list such as {example}")]
    Number {
        /// The axis.
        name: &'static str,
        /// Text that was typed.
        text: String,
        /// Numbers that the axis has.
        of: &'static str,
        /// A list that is understood.
        example: &'static str,
    },
    /// Not an array scale.
    #[error(transparent)]
    Array(#[from] ArrayScaleError),
    /// Not one of the words of the axis.
    #[error("{name}: {message}")]
    Word {
        /// The axis.
        name: &'static str,
        /// What is wrong, and the words there are.
        message: String,
    },
    /// Not a method.
    #[error("'{text}' is not a method: write {known}")]
    Method {
        /// Text that was typed.
        text: String,
        /// The names there are.
        known: String,
    },
}

/// Name of a setting as a label.
pub fn axis_label(kind: AxisKind) -> &'static str {
    match kind {
        AxisKind::Hidden => "Hidden nodes",
        AxisKind::Array => "Array scales",
        AxisKind::Samples => "Samples",
        AxisKind::Noise => "Noise",
        AxisKind::Inputs => "Inputs",
        AxisKind::Scaling => "Scaling",
        AxisKind::Method => "Methods",
        AxisKind::Epochs => "Epochs",
        AxisKind::Starts => "Starts",
        AxisKind::Split => "Split",
        AxisKind::Seed => "Seeds",
    }
}

/// Values of a setting to begin with.
pub fn axis_example(kind: AxisKind) -> &'static str {
    match kind {
        AxisKind::Hidden => "6, 8, 10, 12",
        AxisKind::Array => "10×6_3×18, 10×8_4×24, 10×10_5×30",
        AxisKind::Samples => "100, 300, 1000",
        AxisKind::Noise => "0, 0.001, 0.01",
        AxisKind::Inputs => "resistance, conductance, log",
        AxisKind::Scaling => "minmax, whiten",
        AxisKind::Method => "lm, scg, rp",
        AxisKind::Epochs => "30, 100, 300",
        AxisKind::Starts => "1, 3, 10",
        AxisKind::Split => "time, random",
        AxisKind::Seed => "0, 1, 2",
    }
}

impl AxisForm {
    /// An axis with the values to begin with.
    pub fn new(kind: AxisKind) -> Self {
        Self {
            kind,
            values: axis_example(kind).to_owned(),
        }
    }

    /// The values of `axis` as one would type them.
    pub fn of(axis: &Axis) -> Self {
        let values: Vec<String> = (0..axis.len()).map(|index| axis.label(index)).collect();
        Self {
            kind: axis.kind(),
            values: values.join(", "),
        }
    }

    /// The axis.
    ///
    /// # Errors
    /// The first value that cannot be understood.
    pub fn parse(&self) -> Result<Axis, ListError> {
        Ok(match self.kind {
            AxisKind::Hidden => Axis::Hidden(self.numbers()?),
            AxisKind::Array => Axis::Array(self.words().map(str::parse).collect::<Result<Vec<ArrayScale>, _>>()?),
            AxisKind::Samples => Axis::Samples(self.numbers()?),
            AxisKind::Noise => Axis::Noise(self.parsed("a number")?),
            AxisKind::Inputs => Axis::Inputs(self.chosen::<Quantity>()?),
            AxisKind::Scaling => Axis::Scaling(self.chosen::<ScalingChoice>()?),
            AxisKind::Starts => Axis::Starts(self.numbers()?),
            AxisKind::Split => Axis::Split(self.chosen::<SplitBy>()?),
            AxisKind::Method => Axis::Method(self.words().map(method).collect::<Result<_, _>>()?),
            AxisKind::Epochs => Axis::Epochs(self.numbers()?),
            AxisKind::Seed => Axis::Seed(self.numbers()?.into_iter().map(Seed).collect()),
        })
    }

    fn words(&self) -> impl Iterator<Item = &str> {
        let is_between = |letter: char| letter == ',' || letter == ';' || letter.is_whitespace();
        self.values.split(is_between).filter(|word| !word.is_empty())
    }

    fn numbers<N: FromStr>(&self) -> Result<Vec<N>, ListError> {
        self.parsed("a whole number")
    }

    fn chosen<C: FromStr<Err: Display>>(&self) -> Result<Vec<C>, ListError> {
        let choice = |word: &str| {
            word.parse().map_err(|error: C::Err| ListError::Word {
                name: axis_label(self.kind),
                message: error.to_string(),
            })
        };
        self.words().map(choice).collect()
    }

    fn parsed<N: FromStr>(&self, of: &'static str) -> Result<Vec<N>, ListError> {
        let number = |word: &str| {
            word.parse().map_err(|_| ListError::Number {
                name: axis_label(self.kind),
                of,
                text: word.to_owned(),
                example: axis_example(self.kind),
            })
        };
        self.words().map(number).collect()
    }
}

fn method(word: &str) -> Result<Method, ListError> {
    let mut all = Method::all().into_iter();
    all.find(|method| method.short_name().eq_ignore_ascii_case(word))
        .ok_or_else(|| ListError::Method {
            text: word.to_owned(),
            known: Method::all().map(|method| method.short_name()).join(", "),
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_offered_is_understood_and_written_back_alike() {
        for kind in AxisKind::ALL {
            let form = AxisForm::new(kind);
            let axis = form.parse().unwrap();
            assert!(axis.len() >= 2, "{kind:?}");
            assert_eq!(AxisForm::of(&axis), form);
        }
    }

    #[test]
    fn separators_do_not_matter_and_mistakes_are_named() {
        let parse = |kind, values: &str| {
            AxisForm {
                kind,
                values: values.to_owned(),
            }
            .parse()
        };
        assert_eq!(
            parse(AxisKind::Hidden, " 6;8\n10,,12 "),
            Ok(Axis::Hidden(vec![6, 8, 10, 12]))
        );
        let cases = [
            (
                AxisKind::Hidden,
                "6, eight",
                "Hidden nodes: 'eight' is not a whole number",
            ),
            (AxisKind::Samples, "-5", "Samples: '-5'"),
            (AxisKind::Array, "10x6", "'10x6' is not an array scale"),
            (AxisKind::Noise, "0.1 a", "Noise: 'a' is not a number"),
            (
                AxisKind::Split,
                "time daily",
                "Split: 'daily' is not a split: give time",
            ),
            (AxisKind::Method, "lm magic", "'magic' is not a method: write lm"),
        ];
        for (kind, values, expected) in cases {
            let message = parse(kind, values).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
