//! The checkpoint file: a run read back continues bit for bit, and any damage to the file is detected.

use std::{fs, path::PathBuf, time::Duration};

use decoupler_core::{
    dataset::{Seed, Simulation},
    evaluation::{Run, RunSettings},
    job::Job,
    sensor::SensorModel,
    training::{EpochRecord, Method, StopReason},
};
use decoupler_files::export::{CheckpointFile, DocumentError, NetworkFile};
use tempfile::TempDir;

fn settings(method: Method) -> RunSettings {
    let mut settings = RunSettings {
        source: Simulation {
            sensor: SensorModel::new("2x2_2x6".parse().unwrap()),
            samples: 20,
            validation_samples: 8,
            test_samples: 8,
            ..Simulation::default()
        }
        .into(),
        hidden: 2,
        starts: 2,
        seed: Seed(u64::MAX),
        ..RunSettings::default()
    };
    settings.training.method = method;
    settings.training.stopping.epochs = 9;
    settings
}

fn stepped(settings: RunSettings, epochs: usize) -> Run {
    let mut run = Run::prepare(settings).unwrap();
    for _ in 0..epochs {
        run.step();
    }
    run
}

fn place() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.checkpoint");
    (folder, path)
}

fn saved(epochs: usize) -> (TempDir, PathBuf, Vec<u8>) {
    let (folder, path) = place();
    CheckpointFile::from_run(&stepped(settings(Method::default()), epochs), None)
        .unwrap()
        .save(&path)
        .unwrap();
    let bytes = fs::read(&path).unwrap();
    (folder, path, bytes)
}

/// Returns the message on a file of these bytes, which must be refused in one line that names the file.
fn refusal(bytes: &[u8]) -> String {
    let (_folder, path) = place();
    fs::write(&path, bytes).unwrap();
    let message = CheckpointFile::load(&path).unwrap_err().to_string();
    assert!(
        message.contains("run.checkpoint") && !message.contains('\n'),
        "{message}"
    );
    message
}

#[test]
fn a_run_from_a_file_continues_bit_for_bit() {
    let (_folder, path) = place();
    for method in Method::all() {
        let whole = stepped(settings(method), 9);
        CheckpointFile::from_run(&stepped(settings(method), 4), None)
            .unwrap()
            .save(&path)
            .unwrap();
        let file = CheckpointFile::load(&path).unwrap();
        let mut run = file.resume(&Job::UNINTERRUPTED, &mut |_| ()).unwrap().0;
        while run.step().is_none() {}
        let mut files = [&run, &whole].map(|run| NetworkFile::from_run(run, None).unwrap());
        files.iter_mut().for_each(|file| file.training.seconds = 0.0);
        assert_eq!(files[0], files[1], "{method}");
    }
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
        let mut resumed = CheckpointFile::load(&path)
            .unwrap()
            .resume(&Job::UNINTERRUPTED, &mut |_| ())
            .unwrap()
            .0;
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
    let mut read = CheckpointFile::load(&path)
        .unwrap()
        .resume(&Job::UNINTERRUPTED, &mut |_| ())
        .unwrap()
        .0;
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
        *run = CheckpointFile::load(&path)
            .unwrap()
            .resume(&Job::UNINTERRUPTED, &mut |_| ())
            .unwrap()
            .0;
        while run.step().is_none() {}
    }
    assert!(read.leader().best_mse() < 0.5 * before, "{before}");
    assert_eq!(read.network(), run.network());
}

#[test]
fn a_file_cut_off_anywhere_is_detected() {
    let (_folder, _, bytes) = saved(3);
    let content = bytes.trim_ascii_end().len();
    for length in (0..content).step_by(37).chain(content - 40..content) {
        let message = refusal(&bytes[..length]);
        let expected = if length == 0 { "is empty" } else { "cut off at line 1" };
        assert!(message.contains(expected), "{length} of {content} bytes: {message}");
    }
}

#[test]
fn a_flipped_bit_anywhere_is_detected_or_harmless() {
    let (_folder, path, bytes) = saved(2);
    let whole = CheckpointFile::load(&path).unwrap();
    for place in (0..bytes.len()).step_by(41) {
        for bit in [0, 3, 6] {
            let mut flipped = bytes.clone();
            flipped[place] ^= 1 << bit;
            fs::write(&path, &flipped).unwrap();
            if let Ok(read) = CheckpointFile::load(&path) {
                // The name of the program may be any text.
                assert_eq!(
                    (read.settings, read.starts),
                    (whole.settings, whole.starts.clone()),
                    "{place}"
                );
                continue;
            }
            refusal(&flipped);
        }
    }
}

#[test]
fn a_changed_digit_of_a_weight_is_detected() {
    let (_folder, _, bytes) = saved(3);
    let text = String::from_utf8(bytes).unwrap();
    let start = text.find("\"best_weights\":[").unwrap();
    let digit = start + text[start..].find('.').unwrap() + 9;
    let other = if &text[digit..=digit] == "7" { "8" } else { "7" };
    let mut changed = text.clone();
    changed.replace_range(digit..=digit, other);
    assert!(refusal(changed.as_bytes()).contains("checksum"));
    let message = refusal(text.replacen("\"epochs\":9", "\"epochs\":99", 1).as_bytes());
    assert!(message.contains("is damaged: its checksum"), "{message}");
}

#[test]
fn other_files_and_versions_are_named() {
    let (_folder, path, bytes) = saved(1);
    let text = String::from_utf8(bytes).unwrap();
    let cases = [
        (
            "another text",
            "epoch,mse\n1,2\n".to_owned(),
            "not a checkpoint: expected value",
        ),
        ("other JSON", "{\"a\": 1}".to_owned(), "no field \"format\""),
        ("deep nesting", "[".repeat(100_000), "not a checkpoint"),
        (
            "a newer version",
            text.replacen("\"version\":4", "\"version\":5", 1),
            "has version 5 of the format, written by decoupler",
        ),
        (
            "an older version",
            text.replacen("\"version\":4", "\"version\":3", 1),
            "which reads version 4: open it with the program that wrote it",
        ),
        (
            "a newer version with other fields",
            "{\"format\":\"decoupler checkpoint\",\"version\":7,\"x\":0}".to_owned(),
            "version 7",
        ),
        (
            "an unknown version",
            text.replacen("\"version\":4", "\"version\":0", 1),
            "has version 0",
        ),
        (
            "a part missing in the middle",
            text.replacen("\"run\":{", "\"run\":", 1),
            "is damaged",
        ),
    ];
    for (sentence, text, expected) in cases {
        let message = refusal(text.as_bytes());
        assert!(message.contains(expected), "{sentence}: {message}");
    }
    NetworkFile::from_run(&stepped(settings(Method::default()), 1), None)
        .unwrap()
        .save(&path)
        .unwrap();
    let message = refusal(&fs::read(&path).unwrap());
    assert!(message.contains("its format is \"decoupler network\""), "{message}");
    fs::remove_file(&path).unwrap();
    assert!(matches!(CheckpointFile::load(&path), Err(DocumentError::Read { .. })));
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
