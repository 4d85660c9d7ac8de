//! Trainings that are cut short when the program ends, and resumed at the next start.

use std::{fs, path::Path, time::Instant};

use decoupler_files::export::{CheckpointFile, CheckpointPlace};

use crate::{
    driver::{Driver, PATIENCE, small},
    folders::names,
    intervals::{noisy, train_to_calibration},
    recordings::written,
    training::{endless, start_endless},
};

const OFFER: &str = "Resume the training of ";

/// The checkpoints in a folder.
fn checkpoints(folder: &Path) -> Vec<String> {
    let names = names(folder).into_iter();
    names.filter(|name| name.ends_with(".checkpoint")).collect()
}

/// A window with an endless training that has a checkpoint.
fn training_in(folder: &Path) -> Driver {
    let mut driver = Driver::open_keeping_trainings(folder);
    start_endless(&mut driver);
    driver.wait("a checkpoint", |_| !checkpoints(folder).is_empty());
    driver
}

/// Ends windows without closing them, as when the program is killed, and waits until this many checkpoints are left.
fn kill<W>(windows: W, folder: &Path, left: usize) {
    drop(windows);
    // Their threads may outlive them for an epoch, unlike those of a program that is killed.
    let latest = Instant::now() + PATIENCE;
    while CheckpointPlace::find(folder).unwrap().1.len() < left {
        assert!(Instant::now() < latest, "{:?}", names(folder));
        std::thread::yield_now();
    }
}

/// Opens the next window and waits for the offer.
fn offered_in(folder: &Path) -> Driver {
    let mut driver = Driver::open_keeping_trainings(folder);
    driver.wait("the offer", |driver| driver.says(OFFER));
    driver
}

/// Returns true if the next window offers nothing. Its worker answers one request after the other.
fn nothing_is_offered_in(folder: &Path) -> bool {
    let mut driver = Driver::open_keeping_trainings(folder);
    driver.configure_small();
    driver.train();
    // The checkpoint is removed before the run is kept.
    driver.wait_for_kept_run();
    !driver.says(OFFER) && checkpoints(folder).is_empty()
}

#[test]
fn a_training_that_was_cut_short_is_offered_at_the_next_start_and_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    kill(training_in(folder), folder, 1);
    let saved = CheckpointFile::load(&folder.join("training-1.checkpoint")).unwrap();
    assert_eq!(saved.settings, endless());
    let epoch = saved.starts[0].history().last().unwrap().epoch;

    let mut driver = offered_in(folder);
    let offer = format!("{OFFER}10×6_3×18, which was cut short at epoch {epoch} of 1000000?");
    driver.assert_says(&offer);
    driver.click("Resume");
    driver.wait("its epochs", |driver| driver.epochs() > epoch);
    driver.wait_for_epochs(3);
    assert!(driver.is_enabled("⏸ Pause") && !driver.says(OFFER));
    assert_eq!(driver.state().draft, endless());
    // Cut short again, it is offered again.
    kill(driver, folder, 1);
    let mut driver = offered_in(folder);
    driver.click("Resume");
    driver.wait_for_epochs(1);
    assert!(!driver.close(), "it is not saved elsewhere");
    driver.harness().step();
    driver.click_button("Cancel");
    driver.click("■ Stop");
    driver.wait("the end", |driver| {
        driver.says("Stopped at epoch") && checkpoints(folder).is_empty()
    });
    drop(driver);
    assert!(nothing_is_offered_in(folder));
}

#[test]
fn a_training_that_was_cut_short_is_discarded_or_asked_about_later() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    kill(training_in(folder), folder, 1);
    let mut driver = offered_in(folder);
    driver.click("Dismiss");
    assert!(!driver.says(OFFER));
    // The training of this session has a place of its own.
    start_endless(&mut driver);
    driver.wait("another checkpoint", |_| checkpoints(folder).len() == 2);
    kill(driver, folder, 2);
    let mut driver = offered_in(folder);
    driver.click("Discard");
    driver.wait("the other", |driver| driver.says(OFFER));
    driver.click("Discard");
    driver.wait("the removal", |_| checkpoints(folder).is_empty());
    drop(driver);
    assert!(nothing_is_offered_in(folder));
}

#[test]
fn two_windows_keep_their_trainings_apart() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let first = training_in(folder);
    let mut second = Driver::open_keeping_trainings(folder);
    start_endless(&mut second);
    second.wait("another checkpoint", |_| checkpoints(folder).len() == 2);
    assert!(!second.says(OFFER), "the other window is at work on it");
    second.click("■ Stop");
    second.wait("its end", |_| checkpoints(folder) == ["training-1.checkpoint"]);
    kill((first, second), folder, 1);
    let driver = offered_in(folder);
    assert!(driver.says(OFFER));
}

#[test]
fn a_training_that_is_discarded_at_closing_is_not_offered() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut driver = training_in(folder);
    assert!(!driver.close());
    driver.harness().step();
    driver.click_button("Close");
    assert!(driver.close());
    drop(driver);
    assert!(nothing_is_offered_in(folder));
}

#[test]
fn a_damaged_checkpoint_is_reported_and_can_be_discarded() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("training-1.checkpoint"), "{").unwrap();
    let mut driver = Driver::open_keeping_trainings(folder);
    driver.wait("the report", |driver| {
        driver.says("A training was cut short and cannot be resumed")
    });
    driver.click("Resume");
    driver.wait("the same again", |driver| {
        driver.says("Ready: press Train") && driver.says("cannot be resumed")
    });
    driver.click("Discard");
    driver.wait("the removal", |_| checkpoints(folder).is_empty());
}

#[test]
fn a_training_that_ended_without_its_intervals_gets_them_when_resumed() {
    let folder = tempfile::tempdir().unwrap();
    // Its five trainings take much longer than a frame, on a busy machine too, and less than the minute above which none is
    // begun.
    let path = written(&folder, "press.csv", &noisy(20_000));
    let kept = folder.path().join("data");
    let mut driver = Driver::open_keeping_trainings(&kept);
    driver.open_recordings(&[&path]);
    driver.limit_epochs("100");
    train_to_calibration(&mut driver);
    kill(driver, &kept, 1);
    let mut driver = offered_in(&kept);
    driver.click("Resume");
    driver.wait_for_training();
    driver.wait_for_kept_run();
    assert!(driver.kept(0).intervals.is_some());
    assert_eq!(checkpoints(&kept), [""; 0]);
}

#[test]
fn the_last_run_is_shown_after_a_restart_and_each_of_the_list_can_be_opened() {
    let folder = tempfile::tempdir().unwrap();
    let (file, runs) = (folder.path().join("window.json"), folder.path().join("runs"));
    let mut driver = Driver::open_again(&file, &runs);
    driver.configure_small();
    driver.train();
    driver.wait_for_kept_run();
    let table = driver.table();
    drop(driver);

    let mut driver = Driver::open_again(&file, &runs);
    driver.wait("the last run", |driver| driver.table() == table);
    driver.assert_says("Finished: ");
    assert!(!driver.has("Train longer"), "its state is not kept");
    let bundle = folder.path().join("network.json");
    driver.save("Network file, JSON", &bundle);
    driver.wait("its network", |_| bundle.exists());
    driver.enter("Hidden nodes", "3");
    driver.train();
    driver.wait("another run", |driver| driver.runs().len() == 2);
    assert_ne!(driver.table(), table);

    driver.click_button("Compare");
    let name = driver.runs()[0].name.clone();
    driver.click(&format!("Open {name}"));
    driver.wait("the first run", |driver| driver.table() == table);
    assert_eq!((driver.shown(), driver.state().draft), ("Train", small()));
}
