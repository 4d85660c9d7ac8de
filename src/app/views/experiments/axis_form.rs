use thiserror::Error;

use crate::{
    dataset::Seed,
    evaluation::experiments::Axis,
    sensor::{ArrayScale, ArrayScaleError},
    training::Method,
};

/// What an axis can vary.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AxisKind {
    /// Hidden nodes.
    Hidden,
    /// Array scales.
    Array,
    /// Training samples.
    Samples,
    /// Training methods.
    Method,
    /// Most epochs.
    Epochs,
    /// Seeds.
    Seed,
}

/// An axis as the user types it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AxisForm {
    /// What is varied.
    pub kind: AxisKind,
    /// Its values, separated by commas or blanks.
    pub values: String,
}

/// A value that cannot be understood.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ListError {
    /// Not a number.
    #[error("{name}: '{text}' is not a whole number; write a list such as {example}")]
    Number {
        /// The axis.
        name: &'static str,
        /// What was typed.
        text: String,
        /// A list that is understood.
        example: &'static str,
    },
    /// Not an array scale.
    #[error(transparent)]
    Array(#[from] ArrayScaleError),
    /// Not a method.
    #[error("'{text}' is not a method: write {known}")]
    Method {
        /// What was typed.
        text: String,
        /// The names there are.
        known: String,
    },
}

impl AxisKind {
    /// In the order offered.
    pub const ALL: [Self; 6] = [
        Self::Hidden,
        Self::Array,
        Self::Samples,
        Self::Method,
        Self::Epochs,
        Self::Seed,
    ];

    /// Its name as a label.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hidden => "Hidden nodes",
            Self::Array => "Array scales",
            Self::Samples => "Samples",
            Self::Method => "Methods",
            Self::Epochs => "Epochs",
            Self::Seed => "Seeds",
        }
    }

    /// Values to begin with.
    pub fn example(self) -> &'static str {
        match self {
            Self::Hidden => "6, 8, 10, 12",
            Self::Array => "10×6_3×18, 10×8_4×24, 10×10_5×30",
            Self::Samples => "100, 300, 1000",
            Self::Method => "lm, scg, rp",
            Self::Epochs => "30, 100, 300",
            Self::Seed => "0, 1, 2",
        }
    }
}

impl AxisForm {
    /// An axis with the values to begin with.
    pub fn new(kind: AxisKind) -> Self {
        Self {
            kind,
            values: kind.example().to_owned(),
        }
    }

    /// The values of `axis` as one would type them.
    pub fn of(axis: &Axis) -> Self {
        let kind = match axis {
            Axis::Hidden(_) => AxisKind::Hidden,
            Axis::Array(_) => AxisKind::Array,
            Axis::Samples(_) => AxisKind::Samples,
            Axis::Method(_) => AxisKind::Method,
            Axis::Epochs(_) => AxisKind::Epochs,
            Axis::Seed(_) => AxisKind::Seed,
        };
        let values: Vec<String> = (0..axis.len()).map(|index| axis.label(index)).collect();
        Self {
            kind,
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
            AxisKind::Method => Axis::Method(self.words().map(method).collect::<Result<_, _>>()?),
            AxisKind::Epochs => Axis::Epochs(self.numbers()?),
            AxisKind::Seed => Axis::Seed(self.numbers()?.into_iter().map(Seed).collect()),
        })
    }

    fn words(&self) -> impl Iterator<Item = &str> {
        let is_between = |letter: char| letter == ',' || letter == ';' || letter.is_whitespace();
        self.values.split(is_between).filter(|word| !word.is_empty())
    }

    fn numbers<N: std::str::FromStr>(&self) -> Result<Vec<N>, ListError> {
        let number = |word: &str| {
            word.parse().map_err(|_| ListError::Number {
                name: self.kind.name(),
                text: word.to_owned(),
                example: self.kind.example(),
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
            assert!(axis.len() >= 3, "{kind:?}");
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
            (AxisKind::Method, "lm magic", "'magic' is not a method: write lm"),
        ];
        for (kind, values, expected) in cases {
            let message = parse(kind, values).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
