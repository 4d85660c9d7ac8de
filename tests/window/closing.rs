//! Closing the window: nothing half-written, no training lost without a question.

use std::{fs, path::Path, time::Instant};

use decoupler::{
    app::{Effect, Phase},
    export::CheckpointFile,
    training::StopReason,
};
use eframe::egui::{Key, ViewportCommand, ViewportEvent, ViewportId};

use crate::{
    driver::{Driver, PATIENCE},
    training::{endless, start_endless},
};

const SAVE: &str = "Save checkpoint and close…";
const DISCARD: &str = "Discard and close";

/// Whether the window asked for this in the frame drawn last.
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
    assert!(!driver.says("Close during a training?"));
}

#[test]
fn an_unfinished_training_is_asked_about_once_and_goes_on_if_the_user_stays() {
    let mut driver = Driver::open();
    start_endless(&mut driver);
    assert!(!close(&mut driver));
    assert!(!close(&mut driver), "the question is not answered by closing once more");
    driver.harness().step();
    assert!(driver.has("Close during a training?") && driver.says("of 1000000. Closing discards it"));
    driver.press(Key::Escape);
    assert!(!driver.has("Close during a training?"));
    driver.wait_for_epochs(3);
    assert!(!close(&mut driver));
    driver.harness().step();
    driver.click_button("Stay");
    driver.wait_for_epochs(3);
    assert_eq!(driver.state().phase, Phase::Training);

    assert!(!close(&mut driver));
    driver.harness().step();
    driver.click_button(DISCARD);
    wait_for_closing(&mut driver);
}

#[test]
fn a_training_saved_on_closing_resumes_where_it_stood() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("kept.checkpoint");
    let mut driver = Driver::open();
    start_endless(&mut driver);
    assert!(!close(&mut driver));
    driver.harness().step();
    driver.click_button(SAVE);
    driver.harness().run_steps(5);
    // Who gives no path stays.
    driver.click_button("Cancel");
    driver.wait_for_epochs(3);
    assert!(!driver.has(SAVE));

    assert!(!close(&mut driver));
    driver.harness().step();
    let shown = driver.epochs();
    driver.click_button(SAVE);
    driver.harness().run_steps(5);
    driver.type_into("File", &path.display().to_string());
    driver.click_button("Save");
    wait_for_closing(&mut driver);
    drop(driver);
    assert_eq!(files_in(folder.path()), ["kept.checkpoint"]);
    let file = CheckpointFile::load(&path).unwrap();
    assert_eq!(file.settings, endless());
    let run = file.resume().unwrap();
    assert!(run.leader().latest().epoch >= shown && run.stop_reason().is_none());
}

#[test]
fn a_checkpoint_that_cannot_be_saved_keeps_the_window_open() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::open();
    start_endless(&mut driver);
    assert!(!close(&mut driver));
    driver.harness().step();
    driver.click_button(SAVE);
    driver.harness().run_steps(5);
    driver.type_into("File", &folder.path().join("none/file").display().to_string());
    driver.click_button("Save");
    driver.wait("the reason", |driver| driver.says("does not exist; make it first"));
    assert!(!asked(&mut driver, &ViewportCommand::Close));
    driver.wait_for_epochs(3);
    driver.click("■ Stop");
    driver.wait("the end", |driver| {
        driver.state().phase == Phase::Ended(StopReason::Stopped)
    });
    assert!(close(&mut driver));
}

#[test]
fn a_training_that_ends_while_it_is_asked_about_needs_no_answer() {
    let mut driver = Driver::open();
    start_endless(&mut driver);
    assert!(!close(&mut driver));
    driver.window_mut().apply(Effect::Stop);
    wait_for_closing(&mut driver);
}

/// A pipe takes no byte until someone reads it.
#[cfg(unix)]
#[test]
fn a_file_under_way_is_finished_before_the_window_closes() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    assert!(made.unwrap().success());
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver.export("Error table, CSV");
    driver.type_into("File", &pipe.display().to_string());
    driver.click_button("Save");
    assert!(!close(&mut driver));
    driver.harness().step();
    assert!(driver.has("Finishing files") && driver.says("pipe. The window closes by itself"));
    driver.click_button("Stay");
    assert!(!driver.has("Finishing files"));
    assert!(!close(&mut driver));
    let reading = std::thread::spawn(move || fs::read_to_string(pipe).unwrap());
    wait_for_closing(&mut driver);
    drop(driver);
    let table = reading.join().unwrap();
    assert!(table.lines().count() > 3 && table.ends_with('\n'), "{table}");
}
