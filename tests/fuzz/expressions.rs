//! Small languages of arguments and recipes: names, derived columns, conditions, markers of missing values, spans of time,
//! faults. An accepted text is unchanged after printing and parsing.

use std::{
    fmt::{self, Display},
    str::FromStr,
};

use decoupler_core::{
    dataset::{Span, SplitBy},
    decoupling::DecoderKind,
    evaluation::{Combination, Initialization, Preset},
    network::{Quantity, ScalingChoice},
    scene::{Loading, Movement, Rows},
    sensor::ArrayScale,
    text::{Named, UnknownName},
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
    mutation::{accepted, mutated},
};

/// Value of an enum whose variants have names.
#[derive(PartialEq)]
struct Name<T>(T);

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
        check::<ArrayScale>(text),
        check::<Rows>(text),
        check::<Loading>(text),
        check::<Name<Movement>>(text),
        check::<Name<Quantity>>(text),
        check::<Name<ScalingChoice>>(text),
        check::<Name<DecoderKind>>(text),
        check::<Name<Preset>>(text),
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
    replay!(1000, |bytes: &[u8]| {
        let text = String::from_utf8_lossy(bytes);
        let count = |text: &str| {
            let mutations = accepted(100, |rng| {
                check_all(&String::from_utf8_lossy(&mutated(text.as_bytes(), rng)))
            });
            usize::from(check_all(text)) + mutations
        };
        text.lines().map(count).sum::<usize>()
    });
}
