//! Closing the window: nothing half-written, no training lost without a question.

use std::{fs, path::Path, time::Instant};

use decoupler::window::{Command, Effect};
use decoupler_core::job::Job;
use decoupler_files::export::CheckpointFile;
use eframe::egui::{Key, ViewportCommand, ViewportEvent, ViewportId};

use crate::{
    configuring::choose_method,
    driver::{Driver, PATIENCE},
    experiments::{run_to_the_end, tiny},
    intervals::noisy,
    recordings::{opened, written},
    trading,
    training::{endless, start_endless},
};

const SAVE: &str = "Save training and close";
const QUESTION: &str = "Close with unsaved work?";
const CLOSE: &str = "Close";
const STAY: &str = "Cancel";

/// Returns true if the window sent this command in the last frame.
fn asked(driver: &mut Driver, command: &ViewportCommand) -> bool {
    let output = driver.harness().output();
    output.viewport_output[&ViewportId::ROOT].commands.contains(command)
}

/// Clicks the button of the title bar; returns whether the window closes at once.
pub(crate) fn close(driver: &mut Driver) -> bool {
    let input = driver.harness().input_mut();
    let events = &mut input.viewports.get_mut(&ViewportId::ROOT).unwrap().events;
    events.push(ViewportEvent::Close);
    driver.harness().step();
    !asked(driver, &ViewportCommand::CancelClose)
}

/// Waits until the window closes by itself.
fn wait_for_closing(driver: &mut Driver) {
    let latest = Instant::now() + PATIENCE;
    while !asked(driver, &ViewportCommand::Close) {
        driver.wait_for_frame("closing", latest);
    }
    assert!(close(driver), "the close that the window asked for is let through");
}

fn files_in(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect()
}

#[test]
fn without_an_unfinished_training_the_window_closes_at_once() {
    let mut driver = Driver::open();
    driver.configure_small();
    assert!(close(&mut driver));
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    assert!(close(&mut driver));
    assert!(!driver.says(QUESTION));
}

#[test]
fn an_unfinished_training_is_asked_about_once_and_continues_if_the_user_stays() {
    let mut driver = Driver::open();
    start_endless(&mut driver);
    assert!(!close(&mut driver));
    assert!(!close(&mut driver), "the question is not answered by closing once more");
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
    assert!(!close(&mut driver));
    driver.harness().step();
    driver.click_button(STAY);
    driver.wait_for_epochs(3);
    assert!(driver.is_enabled("⏸ Pause"));

    assert!(!close(&mut driver));
    driver.harness().step();
    driver.click_button(CLOSE);
    wait_for_closing(&mut driver);
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
    assert!(!close(&mut driver));
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
    assert!(files_in(&runs).iter().any(|name| name.starts_with("run-")));
    assert!(close(&mut driver));
}

#[test]
fn a_training_saved_on_closing_resumes_where_it_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::open_keeping_trainings(folder.path());
    start_endless(&mut driver);
    ask(&mut driver);
    let shown = driver.epochs();
    driver.click_button(SAVE);
    wait_for_closing(&mut driver);
    drop(driver);
    let file = CheckpointFile::load(&folder.path().join("training-1.checkpoint")).unwrap();
    assert_eq!(file.settings, endless());
    let run = file.resume(&Job::UNINTERRUPTED, &mut |_| ()).unwrap().0;
    assert!(run.leader().latest().epoch >= shown && run.stop_reason().is_none());
    let mut driver = Driver::open_keeping_trainings(folder.path());
    driver.wait("the offer", |driver| driver.says("Resume the training of "));
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
    let latest = Instant::now() + PATIENCE;
    while !driver.says("has ended") {
        driver.wait_for_frame("the end", latest);
        assert!(!asked(&mut driver, &ViewportCommand::Close), "no one has answered");
    }
    driver.harness().run_steps(5);
    assert!(!asked(&mut driver, &ViewportCommand::Close));
    assert!(driver.has("Train: Training"));
    assert_eq!(places(&mut driver), before);
    driver.click_button(CLOSE);
    wait_for_closing(&mut driver);
}

/// Clicks the button of the title bar and waits for the question.
fn ask(driver: &mut Driver) {
    assert!(!close(driver));
    driver.harness().run_steps(3);
    assert!(driver.has(QUESTION), "{:#?}", driver.texts());
}

#[test]
fn a_training_on_a_recording_is_saved_at_closing() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(&folder, "press.csv", &noisy(60));
    let kept = folder.path().join("data");
    let mut driver = Driver::open_keeping_trainings(&kept);
    driver.open_recordings(&[&path]);
    driver.choose_by_hand();
    choose_method(&mut driver, "Momentum, Eq. (11)");
    driver.limit_epochs("1000000");
    driver.click("▶ Train");
    driver.wait_for_epochs(3);
    ask(&mut driver);
    driver.click_button(SAVE);
    wait_for_closing(&mut driver);
    drop(driver);
    let file = CheckpointFile::load(&kept.join("training-1.checkpoint")).unwrap();
    assert_eq!(file.settings.training.stopping.epochs, 1_000_000);
    let run = file.resume(&Job::UNINTERRUPTED, &mut |_| ()).unwrap().0;
    assert!(run.leader().latest().epoch >= 3);
}

#[test]
fn an_experiment_and_a_trade_off_are_not_ended_without_asking() {
    for (topic, run, line) in [
        ("Table 1", "▶ Run", "Study: Table 1"),
        ("Speed against accuracy", "▶ Run", "Study: Speed against accuracy"),
    ] {
        let mut driver = Driver::open();
        driver.click_button("Study");
        driver.click(topic);
        driver.click(run);
        ask(&mut driver);
        assert!(driver.has(line), "{:#?}", driver.texts());
        assert!(driver.says("0 of ") && !driver.has(SAVE));
        driver.click_button(STAY);
        driver.click("■ Cancel");
        assert!(close(&mut driver), "nothing is running any more");
    }
}

#[test]
fn a_finished_sweep_and_trade_off_are_not_discarded_without_asking() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::open();
    driver.click_button("Study");
    tiny(&mut driver);
    run_to_the_end(&mut driver);
    ask(&mut driver);
    assert!(driver.has("Study: Table 1"), "{:#?}", driver.texts());
    assert!(
        driver.has("2 trials finished, not exported as a table"),
        "{:#?}",
        driver.texts()
    );
    driver.click_button(STAY);
    // Asking for a path saves nothing.
    driver.export("Table, CSV");
    driver.click_button("Cancel");
    ask(&mut driver);
    driver.click_button(STAY);
    driver.save("Table, CSV", &folder.path().join("table.csv"));
    assert!(close(&mut driver));

    let mut driver = Driver::open();
    driver.click("10×6");
    driver.click_button("Study");
    driver.click("Speed against accuracy");
    trading::tiny(&mut driver);
    driver.type_into("Noise levels (%)", "0");
    trading::measure(&mut driver);
    ask(&mut driver);
    assert!(driver.has("Study: Speed against accuracy") && driver.says("not exported as a table"));
    driver.click_button(STAY);
    driver.save("All points, CSV", &folder.path().join("points.csv"));
    assert!(close(&mut driver));
}

#[test]
fn a_cross_validation_and_an_analysis_are_not_ended_without_asking() {
    let (mut driver, _path, _folder) = opened(160);
    driver.limit_epochs("100000");
    driver.click_button("Study");
    driver.click("Cross-validation");
    driver.click_button("▶ Run");
    ask(&mut driver);
    assert!(
        driver.has("Study: Cross-validation") && driver.says("5 trainings"),
        "{:#?}",
        driver.texts()
    );
    driver.click_button(STAY);
    driver.click("■ Cancel");
    driver.settle();
    driver.click("What the readings determine");
    driver.click_button("▶ Run");
    ask(&mut driver);
    assert!(
        driver.has("Study: What the readings determine"),
        "{:#?}",
        driver.texts()
    );
    driver.click_button(CLOSE);
    wait_for_closing(&mut driver);
}

#[test]
fn a_training_being_prepared_is_not_ended_without_asking() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.window_mut().apply(Effect::Do(Command::Train));
    assert!(!close(&mut driver), "its samples are being drawn");
    driver.harness().run_steps(2);
    assert!(driver.has("Train: Training"), "{:#?}", driver.texts());
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
    assert!(!close(&mut driver));
    driver.harness().step();
    assert!(
        driver.says("pipe") && driver.says("is being written"),
        "{:#?}",
        driver.texts()
    );
    driver.click_button(STAY);
    assert!(!close(&mut driver));
    driver.harness().step();
    let reading = std::thread::spawn(move || fs::read_to_string(pipe).unwrap());
    driver.click_button(CLOSE);
    wait_for_closing(&mut driver);
    drop(driver);
    let table = reading.join().unwrap();
    assert!(table.lines().count() > 3 && table.ends_with('\n'), "{table}");
}
