//! Training: progress, pausing, ending and failing.

use std::fs;

use decoupler::window::{Command, Effect, Phase};
use decoupler_core::{
    evaluation::{Run, RunSettings},
    training::{Method, StopReason},
};
use decoupler_files::figure::surface::ViewMode;
use eframe::egui::{Key, Modifiers};

use crate::{
    configuring::choose_method,
    driver::{Driver, small, table_of, trained},
};

const TABS: [&str; 5] = ["Loss", "Training state", "Histogram", "Regression", "Nodes"];

#[test]
fn a_training_ends_with_the_librarys_own_numbers() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    let run = trained(small());
    assert_eq!(driver.table(), table_of(&run));
    assert_eq!(driver.table().len(), 12, "three rows of four figures: Y does not vary");
    let reason = run.stop_reason().unwrap();
    assert!(driver.has(&format!("Finished: {reason}")), "{reason}");
    let epochs = run.leader().latest().epoch;
    assert!(driver.has(&format!("Epoch {epochs} of 15")));
    let shown = driver.state().run.as_ref().unwrap();
    assert_eq!(shown.history, run.leader().history());
    driver.settle();
}

#[test]
fn published_errors_are_listed_where_the_paper_has_them() {
    let mut driver = Driver::open();
    driver.choose("Paper's array", "10×6_3×18");
    driver.enter("Epochs", "1");
    driver.train();
    // Table 3 of the paper: 10×6_3×18 with 12 hidden nodes and 1000 samples.
    let published: Vec<String> = driver
        .table()
        .into_iter()
        .filter(|cell| cell.starts_with("published"))
        .collect();
    assert_eq!(published.len(), 4, "{published:?}");
    let file = include_str!("../../assets/published_errors.csv");
    let row = file
        .lines()
        .find(|line| line.starts_with('3') && line.contains("10x6_3x18"))
        .unwrap();
    for cell in &published[..2] {
        let number: f64 = cell.rsplit(' ').next().unwrap().parse().unwrap();
        assert!(
            row.split(',').any(|field| field.parse() == Ok(number)),
            "{cell} in {row}"
        );
    }
    assert!(published[2].ends_with('–') && published[3].ends_with('–'));
}

#[test]
fn every_picture_of_a_trained_network_can_be_displayed() {
    let mut driver = Driver::open();
    for tab in TABS {
        driver.show_chart(tab);
        driver.settle();
    }
    driver.configure_small();
    driver.train();
    let heights = driver.get("Decoded surface").value().unwrap();
    assert!(heights.starts_with("z ") && heights.ends_with(" mm"), "{heights}");

    driver.click_button("Error");
    let error = driver.get("Error surface").value().unwrap();
    assert!(error.starts_with("error ") && error.ends_with(" mm"), "{error}");
    assert!(!driver.has("Decoded surface"));
    driver.click_button("Decoded");
    assert!(driver.has("Decoded surface"));

    driver.click_button("Top view");
    assert_eq!(driver.state().look.mode, ViewMode::Top);
    assert!(driver.has("Actual surface") && driver.has("Decoded surface"));
    driver.click_button("3-D");
    assert_eq!(driver.state().look.mode, ViewMode::ThreeD);

    for tab in TABS {
        driver.show_chart(tab);
        driver.settle();
    }
    driver.click("Regression");
    assert!(driver.says("Correlation R = 0."));

    let first = driver.get("Actual surface").value();
    assert!(!driver.is_enabled("Previous snapshot"));
    for snapshot in 2..=10 {
        driver.click("Next snapshot");
        assert_eq!(driver.snapshot() + 1, snapshot);
    }
    assert_ne!(driver.get("Actual surface").value(), first);
    assert!(!driver.is_enabled("Next snapshot"));
    for _ in 1..10 {
        driver.click("Previous snapshot");
    }
    assert_eq!(driver.get("Actual surface").value(), first);

    driver.click("Show");
    let worst = driver.state().result().unwrap().errors.nodes().unwrap().worst_node;
    assert_eq!(driver.snapshot(), worst.snapshot);
    assert_eq!(driver.views().train.lights.node, Some(worst.row * 6 + worst.node));
    for theme in ["Light theme", "Dark theme"] {
        driver.act(theme);
        driver.settle();
    }
}

/// A training that does not end by itself.
pub(crate) fn endless() -> RunSettings {
    let mut settings = small();
    settings.training.method = Method::MOMENTUM;
    settings.training.stopping.epochs = 1_000_000;
    settings
}

pub(crate) fn start_endless(driver: &mut Driver) {
    driver.configure_small();
    choose_method(driver, "Momentum, Eq. (11)");
    driver.enter("Epochs", "1000000");
    assert_eq!(driver.state().draft, endless());
    driver.click("▶ Train");
    driver.wait_for_epochs(5);
}

#[test]
fn a_paused_training_is_idle_and_resumes_as_if_it_had_never_been_paused() {
    let mut driver = Driver::open();
    start_endless(&mut driver);
    assert!(!driver.is_enabled("▶ Train") && !driver.is_enabled("Hidden nodes"));
    driver.click("⏸ Pause");
    driver.wait("the pause", |driver| driver.has("Paused"));
    driver.wait_for_last_epoch();
    let held = driver.epochs();
    // The state of the training thread once it has answered a request made after Pause.
    let folder = tempfile::tempdir().unwrap();
    let curves = folder.path().join("curves.csv");
    driver.save("Loss curves, CSV", &curves);
    let lines = fs::read_to_string(curves).unwrap().lines().count();
    assert_eq!(
        (driver.epochs(), lines),
        (held, held + 2),
        "a heading, the start, and the epochs"
    );
    driver.click("Dismiss");
    assert!(driver.becomes_idle());
    assert!(!driver.is_enabled("▶ Train") && driver.is_enabled("■ Stop"));

    driver.click("▶ Resume");
    driver.wait_for_epochs(20);
    driver.click("■ Stop");
    driver.wait("the end", |driver| driver.says("Stopped at epoch"));
    assert!(driver.says("Stopped at epoch"));
    let mut run = Run::prepare(endless()).unwrap();
    for _ in 0..driver.epochs() {
        run.step();
    }
    assert_eq!(driver.state().run.as_ref().unwrap().history, run.leader().history());
    assert_eq!(driver.table(), table_of(&run));
    assert!(driver.has("Decoded surface") && driver.is_enabled("Hidden nodes"));
    driver.settle();
}

#[test]
fn keys_pause_resume_and_stop_and_the_next_training_starts_again() {
    let mut driver = Driver::open();
    start_endless(&mut driver);
    driver.press_with(Modifiers::COMMAND, Key::P);
    assert!(driver.has("Paused"));
    driver.press_with(Modifiers::COMMAND, Key::P);
    assert!(driver.is_enabled("⏸ Pause"));
    driver.press_with(Modifiers::COMMAND, Key::P);
    driver.press_with(Modifiers::COMMAND, Key::Period);
    driver.wait("the end", |driver| driver.says("Stopped at epoch"));

    choose_method(&mut driver, "Levenberg-Marquardt");
    driver.enter("Epochs", "15");
    driver.train();
    assert_eq!(driver.table(), table_of(&trained(small())));
}

#[test]
fn stopping_a_training_being_prepared_takes_effect_at_once_and_the_previous_one_stays() {
    let mut driver = Driver::open();
    driver.configure_small();
    for before in [Phase::Idle, Phase::Ended(StopReason::EpochsReached)] {
        assert_eq!(driver.state().phase, before);
        // So many that the training cannot have begun before it is stopped.
        let mut many = small();
        many.simulation_mut().unwrap().samples = 200_000;
        driver.window_mut().apply(Effect::Configure(Box::new(many)));
        driver.window_mut().apply(Effect::Do(Command::Train));
        assert_eq!(driver.state().phase, Phase::Preparing);
        driver.window_mut().apply(Effect::Do(Command::StopTraining));
        assert_eq!(driver.state().phase, before);
        driver.window_mut().apply(Effect::Configure(Box::new(small())));
        driver.train();
        assert_eq!(driver.table(), table_of(&trained(small())));
        assert!(!driver.says("Stopped at epoch"));
    }
}

#[test]
fn the_verdict_names_a_remedy_for_the_stop_reason() {
    let mut driver = Driver::open();
    driver.configure_small();
    choose_method(&mut driver, "Momentum, Eq. (11)");
    driver.enter("Epochs", "30");
    driver.train();
    assert!(driver.says("times that of always answering the mean: train for more epochs, or with more hidden nodes."));
    assert!(!driver.says("previous settings"));
    choose_method(&mut driver, "Levenberg-Marquardt");
    assert!(driver.has("Result of the previous settings."));
    driver.enter("Epochs", "200");
    driver.enter("Hidden nodes", "14");
    driver.enter("Training samples", "1000");
    driver.train();
    assert!(driver.says("times as accurate as the linear map"));
}

#[test]
fn a_diverging_training_says_so_and_shows_no_infinities() {
    let mut driver = Driver::open();
    driver.configure_small();
    choose_method(&mut driver, "Momentum, Eq. (11)");
    driver.enter("Learning rate", "1e6");
    driver.enter("Epochs", "100000");
    // With validation samples, their rising error would end the training before it becomes infinite.
    driver.enter("Validation samples", "0");
    driver.train();
    assert_eq!(driver.state().phase, Phase::Ended(StopReason::Diverged));
    assert!(driver.says("diverged: the error grew above that of the start"));
    let verdict = driver.texts().into_iter().find(|text| {
        text.starts_with("Training diverged in epoch 1, and the network is no better than its random start")
    });
    assert!(verdict.is_some_and(|text| text.contains("learning rate to 0.01 (now 1e6)")));
    assert!(!driver.says("Train for more epochs"), "more of the same would not help");
    assert!(!driver.has("Train longer"));
    for tab in TABS {
        driver.show_chart(tab);
        driver.settle();
        for text in driver.texts() {
            let words = text.split(|letter: char| !letter.is_alphanumeric());
            assert!(
                words.map(str::to_lowercase).all(|word| word != "nan" && word != "inf"),
                "{tab}: {text}"
            );
        }
    }
    driver.click_button("Error");
    assert!(driver.get("Error surface").value().unwrap().ends_with(" mm"));
}
