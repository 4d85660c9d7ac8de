//! Parsers of names: accepted values are unchanged after printing and parsing.

use std::{fmt::Display, str::FromStr};

use decoupler_core::{
    decoupling::DecoderKind,
    evaluation::Preset,
    network::{Quantity, ScalingChoice},
    scene::{Loading, Movement, Rows},
    sensor::ArrayScale,
};

use crate::{
    corpus::replay,
    mutation::{for_each_seed, mutated},
};

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
            check_word::<Movement>(text);
            check_word::<Quantity>(text);
            check_word::<ScalingChoice>(text);
            check_word::<DecoderKind>(text);
            check_word::<Preset>(text);
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
    check::<Movement>(&["z", "xyz"]);
}

#[test]
fn choices() {
    check::<Quantity>(&["resistance", "conductance", "log"]);
    check::<ScalingChoice>(&["minmax", "whiten"]);
    check::<DecoderKind>(&["mean", "network", "rbf"]);
    check::<Preset>(&["paper", "best"]);
}
