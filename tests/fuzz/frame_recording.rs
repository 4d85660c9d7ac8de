//! Recordings of frames that the Live view replays.

use decoupler_core::scene::Rows;
use decoupler_files::{
    import::LineParser,
    live::{Recorder, Recording, Tally},
};

use crate::{
    corpus::replay,
    mutation::{for_each_seed, mutated},
};

/// Row-wires read.
const ROWS: [usize; 2] = [0, 1];
const CHANNELS: usize = 3;

fn read(bytes: &[u8]) -> Option<Recording> {
    let parser = LineParser::of_array("2x1_1x3".parse().unwrap(), Rows::Known, true).unwrap();
    match Recording::read(bytes, parser, ROWS.len() * CHANNELS, &mut Tally::default()) {
        Ok(recording) => Some(recording),
        Err(error) => {
            let message = error.to_string();
            assert!(message.len() < 1000 && !message.contains('\n'), "{message}");
            None
        }
    }
}

/// Returns true if the bytes are a recording: of positive resistances at ascending times, and unchanged when it is recorded
/// again.
fn check(bytes: &[u8]) -> bool {
    let Some(recording) = read(bytes) else {
        return false;
    };
    let times_s = recording.times_s();
    assert!(times_s.is_sorted() && times_s.iter().all(|time_s| time_s.is_finite()));
    let mut again = Vec::new();
    let mut recorder = Recorder::new(&mut again, &ROWS, CHANNELS).unwrap();
    for (frame, &time_s) in times_s.iter().enumerate() {
        let frame_ohm = recording.frame(frame);
        assert!(frame_ohm.iter().all(|ohm| *ohm > 0.0 && ohm.is_finite()));
        assert!(times_s[recording.frame_at(time_s)] == time_s);
        recorder.record(time_s, frame_ohm).unwrap();
    }
    let again = read(&again).unwrap();
    assert_eq!(again.times_s(), times_s);
    assert!((0..times_s.len()).all(|frame| again.frame(frame) == recording.frame(frame)));
    true
}

#[test]
fn any_input() {
    let accepted = std::sync::atomic::AtomicUsize::new(0);
    replay!(|bytes: &[u8]| {
        let count = |is_accepted| accepted.fetch_add(usize::from(is_accepted), std::sync::atomic::Ordering::Relaxed);
        count(check(bytes));
        for_each_seed(300, |rng| {
            count(check(&mutated(bytes, rng)));
        });
    });
    let accepted = accepted.into_inner();
    assert!(accepted > 50, "only {accepted} recordings are read");
}
