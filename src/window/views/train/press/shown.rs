use std::sync::Arc;

use ndarray::Array2;

use super::subject::Subject;
use crate::window::{test_view::TestView, views::train::drawn::Frames};
use decoupler_core::{
    decoupling::CompiledNetworks,
    evaluation::{Pressed, PressedAnswer},
    network::Networks,
    scene::Touch,
};

/// Everything that a touch and the network's answer depend on.
#[derive(Clone, Debug)]
pub(super) struct Question {
    pub(super) touch: Touch,
    pub(super) test: TestView,
    pub(super) subject: Option<Subject>,
}

/// A touch with everything that is shown of it.
#[derive(Clone, Debug)]
pub struct Shown {
    pub(super) question: Question,
    /// The touched sensor.
    pub(super) pressed: Arc<Pressed>,
    /// Its surface, the network's, and their difference.
    pub(super) frames: Frames,
    /// Drops of its readings below those at rest, in percent: rows read × M4.
    pub drops_percent: Option<Array2<f64>>,
    /// The network's answer, if there is a network, or why it has none.
    pub(super) answer: Option<Result<PressedAnswer, String>>,
    /// Number of readings outside the range of the network's training.
    pub(super) outside: usize,
}

impl Question {
    /// Returns true if both ask the same.
    pub(super) fn is(&self, other: &Self) -> bool {
        let is_same_subject = match (&self.subject, &other.subject) {
            (Some(one), Some(other)) => one.is(other),
            (one, other) => one.is_none() && other.is_none(),
        };
        is_same_subject && self.is_of(&other.test) && self.touch == other.touch
    }

    /// Returns true if it is about this sensor, with its rows and its stroke: a training begins with another test set of the
    /// same.
    pub(super) fn is_of(&self, test: &TestView) -> bool {
        let of = |test: &TestView| (test.sensor, test.stroke_mm);
        of(&self.test) == of(test) && self.test.rows == test.rows
    }

    /// Returns true if the answer takes a few milliseconds at most.
    pub(super) fn is_light(&self) -> bool {
        /// About three milliseconds.
        const MAX_PAIRS: f64 = 2e6;
        /// Weights of the networks: as long.
        const MAX_WEIGHTS: usize = 2_000_000;
        let weights = self.subject.as_ref().map_or(0, |subject| subject.networks.weights());
        Pressed::node_pairs(&self.test.sensor, &self.test.rows) <= MAX_PAIRS && weights <= MAX_WEIGHTS
    }

    /// Presses, reads and decodes.
    pub(super) fn answer(self) -> Result<Shown, String> {
        let test = &self.test;
        let pressed = Pressed::new(&test.sensor, &test.rows, &self.touch, test.stroke_mm);
        let pressed = pressed.map_err(|error| error.to_string())?;
        let networks = self.subject.as_ref().map(|subject| &*subject.networks);
        let answer = networks.map(|networks| {
            let mut decoder = CompiledNetworks::<f64>::new(networks, test.rows.len());
            let answer = pressed.answer(&mut decoder, &|| false);
            let answer = answer.map_err(|error| error.to_string())?;
            answer.ok_or_else(|| "it was not decoded".to_owned())
        });
        let actual = test.frame_of(pressed.nodes_mm());
        let decoupled = answer.as_ref().and_then(|answer| answer.as_ref().ok()).map(|answer| {
            let decoupled = test.frame_of(answer.nodes_mm());
            let error = actual.error_of(&decoupled);
            (decoupled, error)
        });
        Ok(Shown {
            frames: Frames { actual, decoupled },
            drops_percent: test.drops_percent(pressed.readings_ohm()),
            outside: networks.map_or(0, |networks| outside(networks, pressed.readings_ohm())),
            answer,
            pressed: Arc::new(pressed),
            question: self,
        })
    }
}

/// Number of readings outside the range that the networks were trained in.
fn outside(networks: &Networks, readings_ohm: &Array2<f64>) -> usize {
    let rows = readings_ohm.rows().into_iter().enumerate();
    let of_row = rows.map(|(row_index, readings)| {
        let inputs = networks.at(row_index).inputs();
        let readings = readings.to_slice().expect("a row of a standard array is contiguous");
        let range = inputs.range();
        range.map_or(0, |range| range.outside(inputs.quantity(), readings).count())
    });
    of_row.sum()
}
