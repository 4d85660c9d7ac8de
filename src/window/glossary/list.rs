use super::{
    Term,
    errors::ERROR_TERMS,
    sensor::{SCENE_TERMS, SENSOR_TERMS},
    training::{NETWORK_TERMS, TRAINING_TERMS},
};
use decoupler_core::{
    decoupling::{DecoderKind, Precision},
    training::Method,
};

/// Terms that belong together.
#[derive(Clone, Debug)]
pub struct Group {
    /// Their subject.
    pub heading: &'static str,
    /// In the order of the pipeline.
    pub terms: Vec<Term>,
}

/// Every term of the field, in the order of the pipeline.
pub fn groups() -> Vec<Group> {
    let described = |name, definition| Term {
        name,
        definition,
        equation: "",
        hint: definition,
    };
    let methods = Method::all().into_iter();
    let methods = methods.map(|method| described(method.name(), method.description()));
    let decoders = DecoderKind::ALL.map(|kind| described(kind.name(Precision::Double), kind.meaning()));
    [
        ("Sensor", SENSOR_TERMS.to_vec()),
        ("Scene", SCENE_TERMS.to_vec()),
        ("Network", NETWORK_TERMS.to_vec()),
        ("Training", TRAINING_TERMS.to_vec()),
        ("Training methods", methods.collect()),
        ("Errors", ERROR_TERMS.to_vec()),
        ("Decoders", decoders.to_vec()),
    ]
    .map(|(heading, terms)| Group { heading, terms })
    .into()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_term_stands_once_with_a_sentence() {
        let mut names = BTreeSet::new();
        for term in groups().into_iter().flat_map(|group| group.terms) {
            assert!(names.insert((term.name, term.definition)), "{} stands twice", term.name);
            assert!(
                term.definition.len() > 8 && term.hint.starts_with(term.definition),
                "{term:?}"
            );
            assert!(term.hint.ends_with(term.equation), "{term:?}");
        }
    }
}
