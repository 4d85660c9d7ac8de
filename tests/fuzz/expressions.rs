//! Small languages of arguments and recipes: derived columns, conditions, markers of missing values, spans of time, faults.
//! An accepted text is unchanged after printing and parsing.

use std::{fmt::Display, str::FromStr};

use decoupler_core::{
    dataset::{Span, SplitBy},
    evaluation::{Combination, Initialization},
};
use decoupler_files::{
    export::{
        TrialId,
        bundle::{BundleDecoder, BundleFormat, BundlePrecision},
    },
    import::{Condition, Decimal, Derived, Encoding, Missing, Separator},
    live::{Fault, Source},
};

use crate::{
    corpus::replay,
    mutation::{for_each_seed, mutated},
    names::Name,
};

/// Returns true if the text is accepted.
fn check<T: FromStr<Err: Display> + Display + PartialEq>(text: &str) -> bool {
    match text.parse::<T>() {
        Ok(value) => {
            let printed = value.to_string();
            assert!(!printed.contains("NaN") || text.contains("NaN"), "{text}: {printed}");
            let again = printed.parse::<T>();
            assert!(again.is_ok_and(|again| again == value), "{text:?}: {printed:?}");
            true
        }
        Err(error) => {
            assert!(!error.to_string().is_empty());
            false
        }
    }
}

/// Gives the text to every parser; returns true if one accepts it, other than markers, which may be any text.
fn check_all(text: &str) -> bool {
    check::<Missing>(text);
    // Its text names the kind of source, not the source.
    let is_source = text
        .parse::<Source>()
        .is_ok_and(|source| matches!(source, Source::Tcp(_)));
    [
        is_source,
        check::<Derived>(text),
        check::<Condition>(text),
        check::<Span>(text),
        check::<Name<SplitBy>>(text),
        text.parse::<Fault>().is_ok(),
        check::<Name<Combination>>(text),
        check::<Name<Initialization>>(text),
        check::<Name<Separator>>(text),
        check::<Name<Decimal>>(text),
        check::<Name<Encoding>>(text),
        check::<Name<BundleDecoder>>(text),
        check::<Name<BundleFormat>>(text),
        check::<Name<BundlePrecision>>(text),
        check::<TrialId>(text),
    ]
    .contains(&true)
}

#[test]
fn any_input() {
    let accepted = std::sync::atomic::AtomicUsize::new(0);
    let check = |text: &str| {
        accepted.fetch_add(usize::from(check_all(text)), std::sync::atomic::Ordering::Relaxed);
    };
    replay!(|bytes: &[u8]| {
        for text in String::from_utf8_lossy(bytes).lines() {
            check(text);
            for_each_seed(100, |rng| {
                check(&String::from_utf8_lossy(&mutated(text.as_bytes(), rng)));
            });
        }
    });
    let accepted = accepted.into_inner();
    assert!(accepted > 500, "only {accepted} texts are accepted");
}
