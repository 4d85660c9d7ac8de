//! Closing the window: nothing half-written, no training lost without a question.

use std::fs;

use decoupler::window::{Command, Effect, SourceKind};
use decoupler_core::job::Job;
use decoupler_files::export::CheckpointFile;
use eframe::egui::{Key, ViewportCommand};

use crate::{
    driver::Driver,
    experiments::{run_to_the_end, tiny},
    folders::names,
    sources::{BOTH, open_small},
    trading,
    training::{endless, start_endless},
};

const SAVE: &str = "Save training and close";
const QUESTION: &str = "Close with unsaved work?";
const CLOSE: &str = "Close";
const STAY: &str = "Cancel";

#[test]
fn an_unfinished_training_is_asked_about_once_and_continues_if_the_user_stays() {
    let mut driver = Driver::open();
    start_endless(&mut driver);
    assert!(!driver.close());
    assert!(!driver.close(), "the question is not answered by closing once more");
    driver.harness().step();
    assert!(
        driver.has(QUESTION) && driver.has("Train: Training"),
        "{:#?}",
        driver.texts()
    );
    assert!(
        driver.says(" of 1000000") && !driver.has(SAVE),
        "nothing is kept by this window"
    );
    driver.press(Key::Escape);
    assert!(!driver.has(QUESTION));
    driver.wait_for_epochs(3);
    assert!(!driver.close());
    driver.harness().step();
    driver.click_button(STAY);
    driver.wait_for_epochs(3);
    assert!(driver.is_enabled("⏸ Pause"));

    assert!(!driver.close());
    driver.harness().step();
    driver.click_button(CLOSE);
    driver.wait_for_closing();
}

#[test]
fn runs_that_could_not_be_written_are_asked_about_and_written_later() {
    let home = tempfile::tempdir().unwrap();
    let runs = home.path().join("runs");
    let mut driver = Driver::open_keeping(&runs);
    driver.configure_small();
    driver.wait("the folder", |driver| driver.state().runs.path.is_some());
    // As on a full disk: no file can be created there.
    fs::remove_dir(&runs).unwrap();
    fs::write(&runs, "").unwrap();
    driver.train();
    driver.wait("the failure", |driver| driver.state().runs.unwritten == 1);
    assert!(!driver.close());
    driver.harness().step();
    assert!(
        driver.has(QUESTION) && driver.has("Run list: Unwritten runs"),
        "{:#?}",
        driver.texts()
    );
    driver.click_button(STAY);
    fs::remove_file(&runs).unwrap();
    fs::create_dir(&runs).unwrap();
    driver.harness().event(eframe::egui::Event::WindowFocused(true));
    driver.harness().step();
    driver.wait("the run in the folder", |driver| driver.state().runs.unwritten == 0);
    assert!(names(&runs).iter().any(|name| name.starts_with("run-")));
    assert!(driver.close());
}

#[test]
fn a_training_that_ends_during_the_question_moves_no_button_and_does_not_close_the_window() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::open_keeping_trainings(folder.path());
    start_endless(&mut driver);
    ask(&mut driver);
    let places = |driver: &mut Driver| [STAY, CLOSE, SAVE].map(|label| driver.get(label).rect());
    let before = places(&mut driver);
    driver.window_mut().apply(Effect::Do(Command::StopTraining));
    driver.wait("the end", |driver| {
        assert!(!driver.sent(&ViewportCommand::Close), "no one has answered");
        driver.says("has ended")
    });
    driver.harness().run_steps(5);
    assert!(!driver.sent(&ViewportCommand::Close));
    assert!(driver.has("Train: Training"));
    assert_eq!(places(&mut driver), before);
    driver.click_button(CLOSE);
    driver.wait_for_closing();
}

/// Clicks the button of the title bar and waits for the question.
fn ask(driver: &mut Driver) {
    assert!(!driver.close());
    driver.harness().run_steps(3);
    driver.assert_has(QUESTION);
}

#[test]
fn a_training_saved_at_closing_resumes_where_it_stopped() {
    for source in BOTH {
        let mut opened = open_small(source);
        let kept = opened.folder.path().join("data");
        opened.driver = Driver::open_keeping_trainings(&kept);
        if source == SourceKind::Recording {
            opened.driver.take_recording(&opened.setup);
        }
        opened.change(|settings| settings.training = endless().training);
        let mut driver = opened.driver;
        driver.click("▶ Train");
        driver.wait_for_epochs(3);
        ask(&mut driver);
        let shown = driver.epochs();
        driver.click_button(SAVE);
        driver.wait_for_closing();
        drop(driver);
        let file = CheckpointFile::load(&kept.join("training-1.checkpoint")).unwrap();
        assert_eq!(file.settings, *opened.setup.settings());
        let run = file.resume(&Job::UNINTERRUPTED, &mut |_| ()).unwrap().0;
        assert!(run.leader().latest().epoch >= shown && run.stop_reason().is_none());
        let mut driver = Driver::open_keeping_trainings(&kept);
        driver.wait("the offer", |driver| driver.says("Resume the training of "));
    }
}

#[test]
fn no_study_and_no_preparation_is_ended_without_asking() {
    for (source, topic, progress) in [
        (SourceKind::Array, "Table 1", "0 of "),
        (SourceKind::Array, "Speed against accuracy", "0 of "),
        (SourceKind::Recording, "Cross-validation", "5 trainings"),
        (SourceKind::Recording, "What the readings determine", ""),
    ] {
        let mut opened = open_small(source);
        opened.change(|settings| settings.training.stopping.epochs = 100_000);
        let mut driver = opened.driver;
        driver.click_button("Study");
        driver.click(topic);
        driver.click_button("▶ Run");
        ask(&mut driver);
        driver.assert_has(&format!("Study: {topic}"));
        assert!(driver.says(progress) && !driver.has(SAVE), "{:#?}", driver.texts());
        driver.click_button(STAY);
        driver.click_button("■ Cancel");
        assert!(driver.close(), "nothing is running any more");
    }
    let mut driver = Driver::open();
    driver.window_mut().apply(Effect::Do(Command::Train));
    ask(&mut driver);
    assert!(driver.has("Train: Training"), "its samples are being drawn");
}

#[test]
fn a_finished_sweep_and_trade_off_are_not_discarded_without_asking() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::open();
    driver.click_button("Study");
    tiny(&mut driver);
    run_to_the_end(&mut driver);
    ask(&mut driver);
    driver.assert_has("Study: Table 1");
    driver.assert_has("2 trials finished, not exported as a table");
    driver.click_button(STAY);
    // Asking for a path saves nothing.
    driver.export("Table, CSV");
    driver.click_button("Cancel");
    ask(&mut driver);
    driver.click_button(STAY);
    driver.save("Table, CSV", &folder.path().join("table.csv"));
    assert!(driver.close());

    let mut driver = Driver::open();
    driver.choose("Paper's array", "10×6_3×18");
    driver.click_button("Study");
    driver.click("Speed against accuracy");
    trading::tiny(&mut driver);
    driver.type_into("Noise levels (%)", "0");
    trading::measure(&mut driver);
    ask(&mut driver);
    assert!(driver.has("Study: Speed against accuracy") && driver.says("not exported as a table"));
    driver.click_button(STAY);
    driver.save("All points, CSV", &folder.path().join("points.csv"));
    assert!(driver.close());
}

/// A pipe takes no byte until someone reads it.
#[cfg(unix)]
#[test]
fn a_file_being_written_is_finished_before_the_window_closes() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    assert!(made.unwrap().success());
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver.wait_for_kept_run();
    driver.export("Error table, CSV");
    driver.type_into("File", &pipe.display().to_string());
    driver.click_button("Save");
    assert!(!driver.close());
    driver.harness().step();
    assert!(
        driver.says("pipe") && driver.says("is being written"),
        "{:#?}",
        driver.texts()
    );
    driver.click_button(STAY);
    assert!(!driver.close());
    driver.harness().step();
    let reading = std::thread::spawn(move || fs::read_to_string(pipe).unwrap());
    driver.click_button(CLOSE);
    driver.wait_for_closing();
    drop(driver);
    let table = reading.join().unwrap();
    assert!(table.lines().count() > 3 && table.ends_with('\n'), "{table}");
}
