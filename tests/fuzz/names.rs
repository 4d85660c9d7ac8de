//! Parsers of names: accepted values are unchanged after printing and parsing.

use std::{
    fmt::{self, Display},
    str::FromStr,
};

use decoupler_core::{
    decoupling::DecoderKind,
    evaluation::Preset,
    network::{Quantity, ScalingChoice},
    scene::{Loading, Movement, Rows},
    sensor::ArrayScale,
    text::{Named, UnknownName},
};

use crate::{
    corpus::replay,
    mutation::{for_each_seed, mutated},
};

/// Value of an enum whose variants have names.
#[derive(PartialEq)]
pub(crate) struct Name<T>(T);

impl<T: Named> FromStr for Name<T> {
    type Err = UnknownName;

    fn from_str(text: &str) -> Result<Self, UnknownName> {
        T::parse(text).map(Self)
    }
}

impl<T: Named> Display for Name<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.name())
    }
}

fn check<T: FromStr<Err: Display> + Display + PartialEq>(words: &[&str]) {
    for word in words {
        assert!(word.parse::<T>().is_ok(), "{word}");
        for_each_seed(300, |rng| {
            let bytes = mutated(word.as_bytes(), rng);
            check_word::<T>(&String::from_utf8_lossy(&bytes));
        });
    }
}

fn check_word<T: FromStr<Err: Display> + Display + PartialEq>(text: &str) {
    match text.parse::<T>() {
        Ok(value) => {
            let printed = value.to_string();
            let again = printed.parse::<T>();
            assert!(again.is_ok_and(|again| again == value), "{text}: {printed}");
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

/// Every input is given to every parser.
#[test]
fn any_input() {
    replay!(|bytes: &[u8]| {
        for text in String::from_utf8_lossy(bytes).lines() {
            check_word::<ArrayScale>(text);
            check_word::<Rows>(text);
            check_word::<Loading>(text);
            check_word::<Name<Movement>>(text);
            check_word::<Name<Quantity>>(text);
            check_word::<Name<ScalingChoice>>(text);
            check_word::<Name<DecoderKind>>(text);
            check_word::<Name<Preset>>(text);
        }
    });
}

#[test]
fn array_scales() {
    check::<ArrayScale>(&["10x10_5x30", "10×6_3×18", "1x1_1x1", "512X512_512x512"]);
}

#[test]
fn scenes() {
    check::<Rows>(&["all", "known", "7"]);
    check::<Loading>(&[
        "random",
        "smooth:3.5",
        "indenter",
        "indenter:sphere",
        "indenter:flat-punch",
    ]);
    check::<Name<Movement>>(&["z", "xyz"]);
}

#[test]
fn choices() {
    check::<Name<Quantity>>(&["resistance", "conductance", "log"]);
    check::<Name<ScalingChoice>>(&["minmax", "whiten"]);
    check::<Name<DecoderKind>>(&["mean", "network", "rbf"]);
    check::<Name<Preset>>(&["paper", "best"]);
}
