//! Recordings of frames that the Live view replays.

use std::{fs, sync::LazyLock};

use decoupler_core::{
    evaluation::{Run, RunSettings},
    job::Job,
};
use decoupler_files::{
    export::NetworkFile,
    live::{Recorder, Recording, Tally},
};

use crate::{
    corpus::replay,
    mutation::{accepted, mutated},
};

/// Row-wires read.
const ROWS: [usize; 2] = [0, 1];
const CHANNELS: usize = 3;

static NETWORK: LazyLock<NetworkFile> = LazyLock::new(|| {
    let mut settings = RunSettings::default();
    let simulation = settings.simulation_mut().unwrap();
    simulation.sensor.scale = "2x1_1x3".parse().unwrap();
    (simulation.samples, settings.hidden) = (40, 2);
    settings.training.stopping.epochs = 1;
    let mut run = Run::prepare(settings).unwrap();
    while run.step().is_none() {}
    NetworkFile::from_run(&run, None).unwrap()
});

fn read(bytes: &[u8]) -> Option<Recording> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frames.csv");
    fs::write(&path, bytes).unwrap();
    match Recording::read(&path, &NETWORK, &mut Tally::default(), &Job::UNINTERRUPTED) {
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
    replay!(50, |bytes: &[u8]| usize::from(check(bytes))
        + accepted(300, |rng| check(&mutated(bytes, rng))));
}
