//! The pressed sensor, and its answer by the network.

use std::sync::Arc;

use decoupler_core::{
    dataset::Dataset,
    decoupling::{DecodeError, decode_set},
    evaluation::{Errors, frame_us},
    network::Networks,
};
use glam::DVec2;
use ndarray::Array2;

use super::Finger;
use crate::window::{
    test_view::{Drawing, Skin},
    views::train::decoders::Subject,
};

/// Everything that a touch and the network's answer depend on.
#[derive(Clone, Debug)]
pub(super) struct Question {
    pub(super) finger: Finger,
    pub(super) place_mm: DVec2,
    pub(super) skin: Arc<Skin>,
    /// The network that decodes it.
    pub(super) subject: Option<Subject>,
    /// True for the built-in one.
    pub(super) is_demo: bool,
    /// True once the network no longer changes.
    pub(super) is_idle: bool,
}

impl Question {
    /// Returns true if both questions are the same.
    pub(super) fn is(&self, other: &Self) -> bool {
        self.is_of(&other.skin) && self.key() == other.key()
    }

    /// Returns true if it is about this sensor, with the same rows and stroke: a new training has another test set of the
    /// same sensor.
    pub(super) fn is_of(&self, skin: &Skin) -> bool {
        (self.skin.sensor, self.skin.stroke_mm) == (skin.sensor, skin.stroke_mm) && self.skin.rows == skin.rows
    }

    fn key(&self) -> (Finger, DVec2, Option<*const Networks>, bool) {
        let networks = self.subject.as_ref().map(|subject| Arc::as_ptr(&subject.networks));
        (self.finger, self.place_mm, networks, self.is_idle)
    }
}

/// What is shown of a touch.
#[derive(Clone, Debug)]
pub struct Shown {
    /// The pressed sensor: one snapshot, without noise.
    pub(super) pressed: Arc<Dataset>,
    /// Its surface, the network's, and their difference.
    pub drawing: Drawing,
    /// Drops of its readings below those at rest, in percent: rows read × M4.
    pub drops_percent: Option<Array2<f64>>,
    /// The network's answer, if there is a network, or why it has none.
    pub(super) answer: Option<Result<Answer, String>>,
    /// Number of readings outside the range of the network's training.
    pub(super) outside: usize,
}

/// Answer of the network to a pressed sensor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Answer {
    pub(super) errors: Errors,
    /// Time to decode the frame, in microseconds.
    pub(super) frame_us: f64,
}

/// Presses, reads and decodes.
pub(super) fn solve(question: Question) -> (Question, Result<Shown, String>) {
    let shown = press(&question).map(|pressed| {
        let networks = question.subject.as_ref().map(|subject| &*subject.networks);
        let decoded = networks.map(|networks| decode(networks, &pressed, question.skin.stroke_mm));
        let answers = decoded.as_ref().and_then(|decoded| decoded.as_ref().ok());
        Shown {
            drawing: question.skin.drawing(&pressed, answers.map(|(answers, _)| answers), 0),
            drops_percent: question.skin.drops_percent(&pressed, 0),
            answer: decoded.map(|decoded| decoded.map(|(_, answer)| answer).map_err(|error| error.to_string())),
            outside: networks.map_or(0, |networks| outside(networks, &pressed)),
            pressed,
        }
    });
    (question, shown)
}

/// Returns the sensor pressed: positions of its nodes, and readings of its wires by Eq. (2).
fn press(question: &Question) -> Result<Arc<Dataset>, String> {
    let Question {
        finger, place_mm, skin, ..
    } = question;
    let (sensor, rows) = (&skin.sensor, &skin.rows);
    let depth_mm = finger.depth_share * skin.stroke_mm;
    let deformation = finger.indenter().press(sensor, *place_mm, depth_mm);
    let (mut readings_ohm, mut places_mm) = (Vec::new(), Vec::new());
    for &row in rows {
        let readings = sensor.row_resistances(row, deformation.row_mm(row));
        readings_ohm.extend(readings.map_err(|error| error.to_string())?);
        places_mm.extend(
            deformation
                .row_positions_mm(sensor, row)
                .flat_map(|place| place.to_array()),
        );
    }
    let [readings_ohm, places_mm] = [readings_ohm, places_mm].map(|values| {
        let shape = (rows.len(), values.len() / rows.len().max(1));
        Array2::from_shape_vec(shape, values).expect("every row has as many values")
    });
    let set = Dataset::new(readings_ohm, places_mm, Some(rows), vec![0; rows.len()]);
    Ok(Arc::new(set.map_err(|error| error.to_string())?))
}

/// Decodes a pressed sensor; the answers are rows read × 3·M2.
fn decode(networks: &Networks, pressed: &Dataset, stroke_mm: f64) -> Result<(Array2<f64>, Answer), DecodeError> {
    let mut decoder = networks.decoder();
    let answers = decode_set(&mut decoder, pressed)?;
    let errors = Errors::measure(pressed, &answers, stroke_mm);
    let frame_us = frame_us(&mut decoder, pressed)?;
    Ok((answers, Answer { errors, frame_us }))
}

/// Number of readings outside the range that the networks were trained in.
fn outside(networks: &Networks, pressed: &Dataset) -> usize {
    let of_sample = |sample| {
        let inputs = networks.at(pressed.row_index(sample)).inputs();
        let range = inputs.range();
        range.map_or(0, |range| {
            range
                .outside(inputs.quantity(), pressed.sample_readings(sample))
                .count()
        })
    };
    (0..pressed.samples()).map(of_sample).sum()
}
