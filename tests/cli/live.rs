//! The session of the window's Live view, without the window.

use std::{
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use decoupler_core::{job::Job, scene::Noise};
use decoupler_files::{
    export::NetworkFile,
    live::{Session, SessionEvent, SessionPlan, Source, SourcePlan, Unit},
};

/// Returns the answers for a file that is replayed, and for the same file as a stream.
pub(crate) fn answers(network: &Path, input: &Path) -> [Vec<Vec<f64>>; 2] {
    let network = Arc::new(NetworkFile::load(network).unwrap());
    let replay = SourcePlan::Replay(input.to_owned());
    let stream = SourcePlan::Stream(Source::File(input.to_owned()));
    [replay, stream].map(|source| {
        let plan = SessionPlan {
            network: Arc::clone(&network),
            source,
            noise: Noise::default(),
            zero: None,
            unit: Unit::Frames,
        };
        let mut session = Session::open(plan, &Job::UNINTERRUPTED).unwrap();
        let (mut answers, mut now) = (Vec::new(), Instant::now());
        // A clock of its own, which jumps from frame to frame of a replay.
        while let Some(due) = session.input.due(now) {
            now = due.max(now);
            match session.next(now, Duration::from_secs(600)) {
                SessionEvent::Answer => {
                    session.count();
                    answers.push(session.last.values.clone());
                }
                SessionEvent::End(end) => {
                    end.unwrap();
                    break;
                }
                SessionEvent::Nothing | SessionEvent::Bad(_) => {}
            }
        }
        answers
    })
}
