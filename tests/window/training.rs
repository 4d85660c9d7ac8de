//! Training, watched, held, ended and gone wrong.

use std::fs;

use decoupler::window::{Effect, Phase};
use decoupler_core::{
    evaluation::{Run, SimulatedSettings},
    training::{Method, MomentumSettings, StopReason},
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
    assert_eq!(driver.table().len(), 20, "four rows of five figures");
    let reason = run.stop_reason().unwrap();
    assert!(driver.has(&format!("Finished: {reason}")), "{reason}");
    let epochs = run.leader().latest().epoch;
    assert!(driver.has(&format!("Epoch {epochs} of 15")));
    let shown = driver.state().run.as_ref().unwrap();
    assert_eq!(shown.history, run.leader().history());
    driver.settle();
}

#[test]
fn the_published_errors_stand_below_where_the_paper_has_them() {
    let mut driver = Driver::open();
    driver.click("10×6");
    driver.enter("Epochs", "1");
    driver.train();
    // Table 3 of the paper: 10×6_3×18 with 12 hidden nodes and 1000 samples.
    let published: Vec<String> = driver
        .table()
        .into_iter()
        .filter(|cell| cell.starts_with("published"))
        .collect();
    assert_eq!(published.len(), 5, "{published:?}");
    let file = include_str!("../../assets/published_errors.csv");
    let row = file
        .lines()
        .find(|line| line.starts_with('3') && line.contains("10x6_3x18"))
        .unwrap();
    for cell in &published[..3] {
        let number: f64 = cell.rsplit(' ').next().unwrap().parse().unwrap();
        assert!(
            row.split(',').any(|field| field.parse() == Ok(number)),
            "{cell} in {row}"
        );
    }
    assert!(published[3].ends_with('–') && published[4].ends_with('–'));
}

#[test]
fn every_picture_of_a_trained_network_can_be_looked_at() {
    let mut driver = Driver::open();
    for tab in TABS {
        driver.click(tab);
        driver.settle();
    }
    driver.configure_small();
    driver.train();
    let heights = driver.get("Decoupled surface").value().unwrap();
    assert!(heights.starts_with("z ") && heights.ends_with(" mm"), "{heights}");

    driver.click_button("Error");
    let error = driver.get("Error surface").value().unwrap();
    assert!(error.starts_with("error ") && error.ends_with(" mm"), "{error}");
    assert!(!driver.has("Decoupled surface"));
    driver.click_button("Decoupled");
    assert!(driver.has("Decoupled surface"));

    driver.click_button("Top view");
    assert_eq!(driver.state().look.mode, ViewMode::Top);
    assert!(driver.has("Actual surface") && driver.has("Decoupled surface"));
    driver.click_button("3-D");
    assert_eq!(driver.state().look.mode, ViewMode::ThreeD);

    for tab in TABS {
        driver.click(tab);
        driver.settle();
    }
    driver.click("Regression");
    assert!(driver.says("Correlation R = 0."));

    let first = driver.get("Actual surface").value();
    assert!(!driver.is_enabled("Previous snapshot"));
    for snapshot in 2..=10 {
        driver.click("Next snapshot");
        assert_eq!(driver.views().train.snapshot + 1, snapshot);
    }
    assert_ne!(driver.get("Actual surface").value(), first);
    assert!(!driver.is_enabled("Next snapshot"));
    for _ in 1..10 {
        driver.click("Previous snapshot");
    }
    assert_eq!(driver.get("Actual surface").value(), first);

    driver.click("Show");
    let worst = driver.state().result().unwrap().errors.nodes().unwrap().worst_node;
    assert_eq!(driver.views().train.snapshot, worst.snapshot);
    assert_eq!(driver.views().train.lights.node, Some(worst.row * 6 + worst.node));
    for theme in ["Light theme", "Dark theme"] {
        driver.click_button(theme);
        driver.settle();
    }
}

/// A training that continues for as long as one looks.
pub(crate) fn endless() -> SimulatedSettings {
    let mut settings = small();
    settings.training.method = Method::Momentum(MomentumSettings::default());
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
fn a_held_training_stands_still_and_goes_on_as_if_it_had_never_been_held() {
    let mut driver = Driver::open();
    start_endless(&mut driver);
    assert!(!driver.is_enabled("▶ Train") && !driver.is_enabled("Hidden nodes"));
    driver.click("⏸ Pause");
    driver.wait("the pause", |driver| driver.has("Paused"));
    driver.wait_for_hold();
    let held = driver.epochs();
    // What the training thread knows once it has answered what came after Pause.
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
    assert!(driver.comes_to_rest());
    assert!(!driver.is_enabled("▶ Train") && driver.is_enabled("■ Stop"));

    driver.click("▶ Resume");
    driver.wait_for_epochs(20);
    driver.click("■ Stop");
    driver.wait("the end", |driver| {
        driver.state().phase == Phase::Ended(StopReason::Stopped)
    });
    assert!(driver.says("stopped by you"));
    let mut run = Run::prepare(endless()).unwrap();
    for _ in 0..driver.epochs() {
        run.step();
    }
    assert_eq!(driver.state().run.as_ref().unwrap().history, run.leader().history());
    assert_eq!(driver.table(), table_of(&run));
    assert!(driver.has("Decoupled surface") && driver.is_enabled("Hidden nodes"));
    driver.settle();
}

#[test]
fn keys_hold_resume_and_stop_and_the_next_training_starts_afresh() {
    let mut driver = Driver::open();
    start_endless(&mut driver);
    driver.press_with(Modifiers::COMMAND, Key::P);
    assert!(driver.has("Paused"));
    driver.press_with(Modifiers::COMMAND, Key::P);
    assert_eq!(driver.state().phase, Phase::Training);
    driver.press_with(Modifiers::COMMAND, Key::P);
    driver.press_with(Modifiers::COMMAND, Key::Period);
    driver.wait("the end", |driver| driver.says("stopped by you"));

    choose_method(&mut driver, "Levenberg-Marquardt");
    driver.enter("Epochs", "15");
    driver.train();
    assert_eq!(driver.table(), table_of(&trained(small())));
}

#[test]
fn stop_while_a_training_is_prepared_is_answered_at_once_and_the_one_before_stays() {
    let mut driver = Driver::open();
    driver.configure_small();
    for before in [Phase::Idle, Phase::Ended(StopReason::EpochsReached)] {
        assert_eq!(driver.state().phase, before);
        // So many that the training cannot have begun before it is stopped.
        let mut many = small();
        many.source.samples = 200_000;
        driver.window_mut().apply(Effect::Configure(Box::new(many)));
        driver.window_mut().apply(Effect::Train);
        assert_eq!(driver.state().phase, Phase::Preparing);
        driver.window_mut().apply(Effect::Stop);
        assert_eq!(driver.state().phase, before);
        driver.window_mut().apply(Effect::Configure(Box::new(small())));
        driver.train();
        assert_eq!(driver.table(), table_of(&trained(small())));
        assert!(!driver.says("stopped by you"));
    }
}

#[test]
fn the_verdict_names_a_remedy_that_fits_the_end() {
    let mut driver = Driver::open();
    driver.configure_small();
    choose_method(&mut driver, "Momentum, Eq. (11)");
    driver.enter("Epochs", "30");
    driver.train();
    assert!(driver.says("times that of always answering the mean: train for more epochs, or with more hidden nodes."));
    assert!(!driver.says("The settings have changed"));
    choose_method(&mut driver, "Levenberg-Marquardt");
    assert!(driver.says("The settings have changed since this training."));
    driver.enter("Epochs", "200");
    driver.enter("Hidden nodes", "14");
    driver.enter("Training samples", "1000");
    driver.train();
    assert!(driver.says("times as accurate as the linear map"));
}

#[test]
fn nodes_beyond_the_axes_are_said_to_be_drawn_at_their_edge() {
    let mut driver = Driver::open();
    driver.configure_small();
    choose_method(&mut driver, "Momentum, Eq. (11)");
    driver.enter("Learning rate", "1e6");
    driver.enter("Validation samples", "0");
    driver.train();
    let run = driver.state().run.as_ref().unwrap();
    let result = run.result.as_ref().unwrap();
    let nodes = run.test.array().unwrap().frame(result.answers.view(), 0).nodes_mm;
    // The best network is the one before the first step, which knows nothing yet.
    assert_eq!(result.best_epoch, 0);
    let (low, high) = (4.0 - 0.08, 5.0 + 0.08);
    let is_beyond = |node: &&glam::DVec3| !(7.5..=17.5).contains(&node.x) || !(low..=high).contains(&node.z);
    let count = nodes.iter().filter(is_beyond).count();
    assert!(count > 1, "{nodes:?}");
    assert!(driver.says(&format!("Beyond the axes: hatched, {count} nodes")));
}

#[test]
fn a_training_that_grows_without_bound_says_so_and_shows_no_infinities() {
    let mut driver = Driver::open();
    driver.configure_small();
    choose_method(&mut driver, "Momentum, Eq. (11)");
    driver.enter("Learning rate", "1e6");
    driver.enter("Epochs", "100000");
    // With some held out, their rising error would end it before it is infinite.
    driver.enter("Validation samples", "0");
    driver.train();
    assert_eq!(driver.state().phase, Phase::Ended(StopReason::Diverged));
    assert!(driver.says("diverged: the error grew above that of the start"));
    let verdict = driver.texts().into_iter().find(|text| {
        text.starts_with("Training diverged in epoch 1, and the network is no better than its random start")
    });
    assert!(verdict.is_some_and(|text| text.contains("learning rate to 0.01 (now 1e6)")));
    assert!(!driver.says("Train for more epochs"), "more of the same would not help");
    for tab in TABS {
        driver.click(tab);
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
