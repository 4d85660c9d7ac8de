//! The checkpoint file: times, diverged trainings, and invalid contents. That every training continues bit for bit is tested in
//! `properties`.

use std::time::Duration;

use decoupler_core::{
    dataset::Seed,
    evaluation::{Run, RunSettings},
    job::Job,
    training::{EpochRecord, Method, StopReason},
};
use decoupler_files::export::CheckpointFile;

use crate::trained::{place, resumed, stepped};

fn settings(method: Method) -> RunSettings {
    let mut settings = crate::trained::settings("2x2_2x6", 2, 9);
    (settings.training.method, settings.starts) = (method, 2);
    settings
}

/// Starts run in parallel, so the wall time is not the sum of their times.
#[test]
fn the_wall_time_is_that_of_all_sessions_or_unknown() {
    let (_folder, path) = place();
    let hour = Some(Duration::from_secs(3600));
    // A single start determines the wall time.
    let cases = [(3, hour), (3, None), (1, hour), (1, None), (3, Some(Duration::MAX))];
    for (starts, saved) in cases {
        let run = stepped(
            RunSettings {
                starts,
                ..settings(Method::default())
            },
            4,
        );
        let mut file = CheckpointFile::from_run(&run, None).unwrap();
        assert!(file.wall_time == run.wall_time() && file.wall_time > Some(Duration::ZERO));
        file.wall_time = saved;
        file.save(&path).unwrap();
        let mut resumed = resumed(CheckpointFile::load(&path).unwrap());
        let alone = (starts == 1).then(|| run.leader().elapsed());
        let before = resumed.wall_time();
        assert_eq!(before, saved.or(alone));
        resumed.step();
        let after = resumed.wall_time();
        assert!(
            after.is_some() == before.is_some() && after >= before,
            "{before:?} {after:?}"
        );
    }
}

/// Divergence leaves numbers that are not finite; the checkpoint stores them, and another method can continue.
#[test]
fn a_diverged_training_can_be_saved_and_continued_with_another_method() {
    let (_folder, path) = place();
    let diverging = Method::GradientDescent { learning_rate: 1e3 };
    let mut run = stepped(settings(diverging), 9);
    assert_eq!(run.stop_reason(), Some(StopReason::Diverged));
    CheckpointFile::from_run(&run, None).unwrap().save(&path).unwrap();
    let mut read = resumed(CheckpointFile::load(&path).unwrap());
    let text = |run: &Run| -> Vec<_> {
        let text = |record: &EpochRecord| format!("{record:?}");
        run.leader().history().iter().map(text).collect()
    };
    assert_eq!(text(&read), text(&run));
    assert_eq!(read.stop_reason(), Some(StopReason::Diverged));
    let before = run.leader().best_mse();
    for run in [&mut read, &mut run] {
        run.continue_with(Method::default()).unwrap();
        CheckpointFile::from_run(run, None).unwrap().save(&path).unwrap();
        *run = resumed(CheckpointFile::load(&path).unwrap());
        while run.step().is_none() {}
    }
    assert!(read.leader().best_mse() < 0.5 * before, "{before}");
    assert_eq!(read.network(), run.network());
}

/// Files with a correct checksum but invalid contents.
#[test]
fn invalid_contents_are_refused() {
    type Edit = fn(&mut CheckpointFile);
    let run = stepped(settings(Method::default()), 2);
    let (_folder, path) = place();
    let refused = |edit: Edit| {
        let mut file = CheckpointFile::from_run(&run, None).unwrap();
        edit(&mut file);
        file.save(&path).unwrap();
        match CheckpointFile::load(&path) {
            Ok(file) => file.resume(&Job::UNINTERRUPTED, &mut |_| ()).err().unwrap().to_string(),
            Err(error) => error.to_string(),
        }
    };
    let cases: [(Edit, &str); 6] = [
        (|file| file.settings.hidden = 0, "hidden nodes: 0 is not possible"),
        (|file| file.settings.hidden = 3, "another number of hidden nodes"),
        (|file| file.settings.seed = Seed(1), "on these samples it is"),
        (
            |file| {
                let mut settings = file.settings;
                settings.simulation_mut().unwrap().sensor.scale = "2x3_2x9".parse().unwrap();
                file.settings = settings;
            },
            "the samples have",
        ),
        (
            |file| file.settings.starts = 3,
            "2 saved trainings, but the settings ask for 3",
        ),
        (
            |file| file.settings.training.stopping.max_fail = 0,
            "settings.training: validation failures is 0",
        ),
    ];
    for (edit, expected) in cases {
        let message = refused(edit);
        assert!(message.contains(expected), "{expected}: {message}");
    }
}
